"""The return map: fixed points, multipliers, regressions."""

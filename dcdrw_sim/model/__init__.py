"""The rig as equations: dynamics, strikes, scales, presets and starts."""

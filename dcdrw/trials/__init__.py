"""Trials: running, filming, analysing and reporting them."""

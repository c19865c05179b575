"""The figures of model, sweep and regimes."""

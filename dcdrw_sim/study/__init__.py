"""Many rigs judged: sweeps, regimes, designs."""

"""The simulated rig and its node."""

"""The model: dynamics, strikes, integration, and the simulator node."""

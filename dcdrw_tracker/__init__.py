"""From joint states to phase and synchronization: cores and nodes."""

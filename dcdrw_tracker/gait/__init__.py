"""From wheel rotations to phase and synchronization."""

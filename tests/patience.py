"""How long tests wait for what must come."""

PATIENCE = 240.0
"""Limit of every wait [s], so that what hangs ends: no truth of the project, and on a busy machine much comes late."""

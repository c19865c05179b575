"""Recordings: writing, reading and mending them."""

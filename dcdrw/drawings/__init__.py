"""Drawings of the rig and of designs."""

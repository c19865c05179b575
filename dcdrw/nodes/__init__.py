"""Nodes that record, replay, watch and draw a trial."""

"""Motions in time: Taylor series, strikes, one pair or many at once."""

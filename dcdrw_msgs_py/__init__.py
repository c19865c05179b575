"""The wire contract: quantities, samples, topics, conversions, node helpers."""

"""The live page: its state, its server and its files."""

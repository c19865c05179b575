"""The synchronizer: from the phase to a bounded force that brings the pair into step."""

"""What recorded trials tell of a rig: its parameters with their errors, and what they cannot tell."""

"""From tags or poses to unbounded wheel rotations."""

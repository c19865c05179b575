"""What the trials of these tests have in common."""

STIFF = '/**:\n  ros__parameters:\n    k: 60\n    rate: 200\n'

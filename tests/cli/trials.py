"""What the trials of these tests have in common."""

from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
STIFF = '/**:\n  ros__parameters:\n    k: 60\n    rate: 200\n'

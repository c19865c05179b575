"""`python -m dcdrw`."""

import sys

from dcdrw.entry import run

sys.exit(run('dcdrw'))

"""`python -m dcdrw`."""

import sys

from dcdrw.entry import run

if __name__ == '__main__':
    sys.exit(run('dcdrw'))

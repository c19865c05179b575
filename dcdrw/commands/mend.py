"""`dcdrw mend`: a damaged recording, or one that was not closed, into a new one that is whole."""

import argparse
import sys
from pathlib import Path

from dcdrw.files import free_folder
from dcdrw.recordings.mending import mend
from dcdrw.recordings.recording import Recording
from dcdrw_msgs_py.words import counted

_EPILOG = """\
The commands of this suite read a damaged recording as it is; other tools, ros2 bag play for instance, need it mended.
RECORDING itself stays as it is.
Exit status: 0 every message is there, 1 some were damaged and are left out, 2 wrong input.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Write every message that can be read of a recording into a new one (MCAP), with its index.'
    parser.epilog = _EPILOG
    parser.add_argument(
        'recording', type=Path, metavar='RECORDING', help='its folder, that of a trial, or one of its files'
    )
    parser.add_argument('--out', type=Path, required=True, metavar='DIR', help='folder of the new one; must not exist')


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    free_folder(options.out)
    with Recording(options.recording) as recording:
        count = mend(recording, options.out)
        for text in recording.damage:
            print(f'dcdrw mend: left out: {text}', file=sys.stderr)
        for text in recording.notes:
            print(f'dcdrw mend: {text}', file=sys.stderr)
        print(f'Written: {options.out}/ with {counted(count, "message")}')
        return 1 if recording.damage else 0

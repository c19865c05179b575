"""`dcdrw legs`: sensors on people's legs in; heel strikes and the phase of each leg out."""

import argparse
import math
import sys
from pathlib import Path

from dcdrw.console import add_json, check_json, positive, tell, tell_where
from dcdrw.files import add_force, free_folder
from dcdrw.trials.leg_walk import is_complete, read_walk, sentences, summarize_walk, write_walk

_EPILOG = """\
FILE is a recording with the topics that leg_tracker takes, or a .csv whose columns are named: time [s] or stamp_ns,
then of each leg left_acc_x … left_gyr_z, left_contact (0 or 1), left_force [N] or left_hip [rad], with front_ or
rear_ before it where there are two halves, and without the side where there is one leg. Two heading rows (sensor,
axis) do, too; two columns without a heading are the time and one foot's force. Other units stand in brackets behind a
name: time [ms], left_hip [deg]. Angular rates beyond 35 whose unit is not named are taken to be in deg/s, for no leg
turns so fast in rad/s.

DIR gets summary.json, and
  heel_strikes.csv  each heel strike: leg, stamp_ns, and the stamp known_ns of the reading that made it certain
  phases.csv        stamp_ns; 2π per stride of each leg [rad]; ψ of each half as a wheel [rad]; empty where unknown
Exit status: 0 the heel strikes of every leg are told by all that there is, 1 those of a leg are not, or a part of the
recording is damaged and left out, 2 wrong input.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = "Follow people's legs by their sensors, as leg_tracker does, as fast as it goes."
    parser.epilog = _EPILOG
    parser.add_argument('file', type=Path, metavar='FILE')
    parser.add_argument(
        '--rate', type=positive, default=math.nan, metavar='HZ', help='of a .csv that does not tell its times'
    )
    parser.add_argument('--rig', type=Path, metavar='FILE.yaml', help='parameters of leg_tracker that differ')
    parser.add_argument('--namespace', default='', metavar='NS', help='of the suite, where several were recorded')
    parser.add_argument('--out', type=Path, metavar='DIR', help='write the results here')
    add_json(parser)
    add_force(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    folder = options.out
    check_json(options)
    if folder and not options.force:
        free_folder(folder)
    walk, damage, notes = read_walk(options.file, options.rate, options.rig, options.namespace)
    for text in (*damage, *notes):
        print(f'dcdrw legs: {text}', file=sys.stderr)
    summary = summarize_walk(walk)
    tell(options, sentences(summary), summary)
    if folder:
        write_walk(walk, folder, str(options.file), options.force)
        tell_where(options, f'Written: {folder}/')
    return 0 if is_complete(summary) and not damage else 1

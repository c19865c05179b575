"""`dcdrw analyze`: recordings in, the same results as a live trial's out, and whether the nodes agreed."""

import argparse
import sys
from contextlib import nullcontext
from pathlib import Path

from dcdrw.console import add_json, check_json, in_words, tell
from dcdrw.drawings.figure_files import add_formats
from dcdrw.files import add_force, free_folder
from dcdrw.trials.expectation import add_expect, expectation_status
from dcdrw.trials.results import describe, read_trial, result, sample_file, write_results
from dcdrw.trials.summary import summarize
from dcdrw_msgs_py.diagnosis import PairState
from dcdrw_msgs_py.topics import JOINT_STATES

_EPILOG = """\
A recording is the folder of one, or that of a trial, or a file of one (.mcap or .db3, compressed or not), by this suite
or by ros2 bag record.
The parameters are those that were recorded, or the defaults, and what --rig changes. Without --out, nothing is
written. Exit status: 0 each was judged by all that it holds, 1 a verdict rests on less, or there is none (the
sentence says why), or one of several could not be read, 2 wrong input, 3 one did not end as --expect says.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Run the estimator and the monitor over recorded joint states, as fast as they go.'
    parser.epilog = _EPILOG
    parser.add_argument('recordings', type=Path, nargs='+', metavar='RECORDING')
    parser.add_argument(
        '--rig',
        type=Path,
        metavar='FILE.yaml',
        help="parameters that differ, the joints' names for instance: a ROS 2 parameter file",
    )
    parser.add_argument(
        '--topic',
        default=JOINT_STATES.name,
        metavar='NAME',
        help='where the joint states are, in any namespace (default: %(default)s)',
    )
    parser.add_argument('--namespace', default='', metavar='NS', help='of the suite, where several were recorded')
    parser.add_argument(
        '--out',
        type=Path,
        metavar='DIR',
        help='write summary, picture, samples and footfalls here, or into a folder for each',
    )
    add_formats(parser)
    add_json(parser)
    add_expect(parser)
    add_force(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    folders = (
        [options.out]
        if len(options.recordings) == 1
        else [options.out and options.out / _name(path) for path in options.recordings]
    )
    for folder in filter(None, folders):
        if not options.force:
            free_folder(folder)
        if folders.count(folder) > 1:
            raise ValueError(f'several recordings are called {folder.name}: analyze them one by one')
    check_json(options)
    several, status = len(options.recordings) > 1, 0
    lines: list[str] = []
    results: list[dict[str, object]] = []
    states: list[PairState] = []
    for path, folder in zip(options.recordings, folders, strict=True):
        try:
            with sample_file(folder, options.force) if folder else nullcontext() as table:
                trial, agreements = read_trial(
                    path,
                    rig=options.rig,
                    topic=options.topic,
                    namespace=options.namespace,
                    sinks=[table] if table else [],
                )
        except (ValueError, OSError) as error:
            if not several:
                raise
            print(f'dcdrw analyze: {in_words(error)}', file=sys.stderr)  # the others are worth their verdict
            status = 1
            continue
        for text in (*trial.damage, *trial.notes):
            print(f'dcdrw analyze: {text}', file=sys.stderr)
        summary = summarize(trial)
        status = status if summary.complete else 1
        prefix = f'{path}: ' if several else ''
        more = {'recording': str(path), 'agreement': describe(agreements)}
        results.append(result(trial, more))
        states.append(trial.state)
        lines.append(prefix + summary.sentence)
        lines += (
            f'{prefix}{topic}: {equal} of {recorded} recorded are the same here to the last bit'
            for topic, (recorded, equal) in agreements.items()
        )
        if folder:
            write_results(trial, folder, more, options.force, options.formats)
            lines.append(f'{prefix}written: {folder}/')
    tell(options, lines, results if several else results[0])
    return status or expectation_status(options.expect, states)


def _name(path: Path) -> str:
    return path.resolve().stem if path.is_file() else path.resolve().name

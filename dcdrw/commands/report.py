"""`dcdrw report`: a day of trials on one page, and every number as CSV."""

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path

from dcdrw.console import add_json, check_json, in_words, tell
from dcdrw.files import Table, add_force, refuse_existing, table_file, write_text
from dcdrw.trials.day import STEP_COLUMNS, TRIAL_COLUMNS, RecordedTrial, new_name, open_trial, step_rows, table
from dcdrw.trials.expectation import add_expect, expectation_status
from dcdrw.trials.report_page import page
from dcdrw.trials.results import SAMPLES, SAMPLES_HEADER, SampleTable
from dcdrw_msgs_py.topics import JOINT_STATES

_EPILOG = """\
A recording is the folder of one, or that of a trial, or a file of one (.mcap or .db3, compressed or not), by this suite
or by ros2 bag record.
The page holds its pictures itself and needs no network. Beside it, in the folder REPORT.csv: trials.csv (a row for
each trial), steps.csv (a row for each footfall) and samples.csv (all).

Exit status: 0 each recording was judged by all that it holds, 1 one could not be read, holds no trial that was run, or
has a verdict that rests on less: the page says why, 2 none could be read.

example:
  dcdrw report trials/* --out today.html
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Compare recorded trials on one page: pictures, verdicts, how fast each came into step.'
    parser.epilog = _EPILOG
    parser.add_argument('recordings', type=Path, nargs='+', metavar='RECORDING')
    parser.add_argument('--out', type=Path, required=True, metavar='REPORT.html', help='the page to write')
    add_json(parser)
    add_expect(parser)
    add_force(parser)
    parser.add_argument('--title', default='Trials', metavar='TEXT', help='its heading (default: %(default)s)')
    parser.add_argument(
        '--rig',
        type=Path,
        metavar='FILE.yaml',
        help='parameters that differ from those recorded: a ROS 2 parameter file',
    )
    parser.add_argument(
        '--topic',
        default=JOINT_STATES.name,
        metavar='NAME',
        help='where the joint states are, in any namespace (default: %(default)s)',
    )
    parser.add_argument('--namespace', default='', metavar='NS', help='of the suite, where several were recorded')


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    if options.out.suffix not in ('.html', '.htm'):
        raise ValueError(f'--out must end in .html, got {options.out}')
    tables = options.out.with_suffix('.csv')
    refuse_existing((options.out, tables), options.force)
    check_json(options)
    trials: list[RecordedTrial] = []
    lines: list[str] = []
    with _samples(tables, options.force) as open_samples:
        for path in options.recordings:
            name = new_name(path, trials)
            samples = SampleTable(open_samples, _COLUMNS, (name,))
            try:
                trial = open_trial(path, name, options.rig, options.topic, options.namespace, [samples])
            except (ValueError, OSError) as error:  # the other trials of the day are worth their page
                print(f'dcdrw report: left out: {in_words(error)}', file=sys.stderr)
                samples.begin()
                continue
            samples.finish()
            trials.append(trial)
            lines.append(f'{name}: {trial.summary.sentence}')
            for text in (*trial.analysis.damage, *trial.analysis.notes):
                print(f'dcdrw report: {text}', file=sys.stderr)
        if not trials:
            raise ValueError('none of the recordings can be read: there is nothing to report')
    small = {
        'trials.csv': table(TRIAL_COLUMNS, ([column(trial) for column in TRIAL_COLUMNS.values()] for trial in trials)),
        'steps.csv': table(STEP_COLUMNS, (row for trial in trials for row in step_rows(trial))),
    }
    text = page(options.title, trials, small)
    tables.mkdir(parents=True, exist_ok=True)
    for name, content in small.items():
        write_text(tables / name, content, options.force)
    write_text(options.out, text, options.force)
    lines.append(f'Written: {options.out} and {tables}/')
    tell(options, lines, [{'trial': trial.name, **trial.summary._asdict()} for trial in trials])
    whole = len(trials) == len(options.recordings) and all(trial.summary.complete for trial in trials)
    return expectation_status(options.expect, (trial.summary.state for trial in trials)) if whole else 1


_COLUMNS = (*SAMPLES_HEADER, 'error_percent')


@contextmanager
def _samples(folder: Path, force: bool) -> Iterator[Callable[[], Table]]:
    """What opens the one table of the samples of all trials."""
    with ExitStack() as stack:

        @cache
        def open_samples() -> Table:
            folder.mkdir(parents=True, exist_ok=True)
            return stack.enter_context(table_file(folder / SAMPLES, ('trial', *_COLUMNS), force))

        yield open_samples

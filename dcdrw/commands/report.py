"""`dcdrw report`: a day of trials on one page, and every number as CSV."""

import argparse
import csv
import math
import sys
from collections.abc import Iterable
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from dcdrw.commands.analyze import SAMPLES_HEADER, read_trial
from dcdrw.recordings.recorder import INFORMATION, METADATA, PARAMETERS
from dcdrw.recordings.recording import find
from dcdrw.trials.analysis import Analysis
from dcdrw.trials.decay import Decay, fit_decay
from dcdrw.trials.report_page import page
from dcdrw.trials.summary import final_band, sentence
from dcdrw_msgs_py.rig import FRONT, RigParams
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.topics import JOINT_STATES

SIMULATED, MEASURED = 'simulated', 'measured'

_EPILOG = """\
A recording is the folder of one, or that of a trial, or an .mcap or .db3 file, by this suite or by ros2 bag record.
The page holds its pictures itself and needs no network. Beside it, in the folder REPORT.csv: trials.csv (a row for
each trial), steps.csv (a row for each footfall) and samples.csv (all).

example:
  dcdrw report trials/* --out today.html
"""


class Trial(NamedTuple):
    """A recorded trial and what was recorded about it."""

    name: str
    analysis: Analysis
    source: str
    """SIMULATED or MEASURED."""
    about: dict[str, str]
    """Note, machine, version and so on; empty where nothing was recorded."""
    decay: Decay
    """Of its error from step to step."""
    rig: RigParams
    """k, b and slope are NaN where neither a simulator nor a rig file told them."""


TRIAL_COLUMNS: dict[str, Any] = {
    'trial': lambda trial: trial.name,
    'source': lambda trial: trial.source,
    'initial_phase_percent': lambda trial: 100.0 * trial.analysis.status.initial_phase,
    'synchronized': lambda trial: trial.analysis.status.synchronized,
    'steps_to_synchronization': lambda trial: trial.analysis.status.steps_to_synchronization,
    'final_phase_low_percent': lambda trial: 50.0 + final_band(trial.analysis)[0],
    'final_phase_high_percent': lambda trial: 50.0 + final_band(trial.analysis)[1],
    'contraction_per_step': lambda trial: trial.decay.ratio,
    'limit_percent': lambda trial: 50.0 + trial.decay.limit,
    'k': lambda trial: trial.rig.k,
    'b': lambda trial: trial.rig.b,
    'slope_deg': lambda trial: math.degrees(trial.rig.slope),
    'front_steps': lambda trial: trial.analysis.status.steps,
    'slips': lambda trial: trial.analysis.status.slips,
    'seconds': lambda trial: float(trial.analysis.motion.seconds[-1]),
    'samples_lost': lambda trial: trial.analysis.status.cadence.lost,
    'started': lambda trial: trial.about.get('started', ''),
    'note': lambda trial: trial.about.get('note', ''),
}
STEP_COLUMNS = ('trial', 'wheel', 'steps', 'seconds', 'x', 'error_percent')


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        'report',
        help='recorded trials on one page',
        epilog=_EPILOG,
        description='Compare recorded trials on one page: pictures, verdicts, how fast each came into step.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('recordings', type=Path, nargs='+', metavar='RECORDING')
    parser.add_argument('--out', type=Path, required=True, metavar='REPORT.html', help='the page to write')
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
    parser.set_defaults(run=run, prog='dcdrw report')


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    tables = options.out.with_suffix('.csv')
    for path in (options.out, tables):
        if path.exists():
            raise ValueError(f'{path} exists already, not overwriting; choose another --out')
    trials: list[Trial] = []
    for path in options.recordings:
        try:
            trials.append(open_trial(path, _new_name(path, trials), options.rig, options.topic))
            print(f'{trials[-1].name}: {sentence(trials[-1].analysis)}')
        except (ValueError, OSError) as error:  # the other trials of the day are worth their page
            print(f'dcdrw report: left out: {error}', file=sys.stderr)
    if not trials:
        raise ValueError('none of the recordings can be read: there is nothing to report')
    small = {
        'trials.csv': table(TRIAL_COLUMNS, ([column(trial) for column in TRIAL_COLUMNS.values()] for trial in trials)),
        'steps.csv': table(STEP_COLUMNS, (row for trial in trials for row in _steps(trial))),
    }
    text = page(options.title, trials, small)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    tables.mkdir()
    for name, content in small.items():
        (tables / name).write_text(content, encoding='utf-8')
    with (tables / 'samples.csv').open('w', encoding='utf-8', newline='') as file:
        writer = csv.writer(file)
        writer.writerow(('trial', *SAMPLES_HEADER, 'error_percent'))
        for trial in trials:
            columns = [getattr(trial.analysis.motion, name).tolist() for name in (*SAMPLES_HEADER, 'error_percent')]
            writer.writerows((trial.name, *row) for row in zip(*columns, strict=True))
    options.out.write_text(text, encoding='utf-8')
    print(f'Written: {options.out} and {tables}/')
    return 0 if len(trials) == len(options.recordings) else 1


def open_trial(path: Path, name: str, rig: Path | None = None, topic: str = JOINT_STATES.name) -> Trial:
    """Analyze a recording, and read what was recorded about it.

    Raises:
        ValueError, OSError: as `dcdrw.commands.analyze.read_trial`.

    """
    analysis, _ = read_trial(path, rig=rig, topic=topic)
    if not len(analysis.motion.stamp_ns):
        raise ValueError(f'{path} has no joint state that could be used')
    folder = find(path)
    folder = folder if folder.is_dir() else folder.parent
    errors = analysis.status.history
    source = _source(folder)
    built = analysis.params.rig
    if source == MEASURED and not rig:
        built = built._replace(k=math.nan, b=math.nan, slope=math.nan)
    return Trial(name, analysis, source, _about(folder), fit_decay(errors), built)


def table(header: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """CSV; what is unknown is empty."""
    file = StringIO()
    writer = csv.writer(file)
    writer.writerow(header)
    writer.writerows(['' if isinstance(value, float) and math.isnan(value) else value for value in row] for row in rows)
    return file.getvalue()


def _steps(trial: Trial) -> Iterable[tuple[Any, ...]]:
    """Every footfall, with the error at those of the front wheel."""
    errors = iter(trial.analysis.status.history)
    start = int(trial.analysis.motion.stamp_ns[0])
    for fall in trial.analysis.footfalls:
        error = next(errors, math.nan) if fall.wheel == FRONT else math.nan
        yield trial.name, fall.wheel, fall.steps, (fall.stamp_ns - start) / SECOND, fall.x, error


def _new_name(path: Path, others: list[Trial]) -> str:
    """The recording's name; that of the trial where it is the one within its folder."""
    path = path.resolve()
    name = path.stem if path.is_file() else path.parent.name if path.name == 'recording' else path.name
    taken = {trial.name for trial in others}
    return next(
        candidate
        for candidate in (name, *(f'{name} ({number})' for number in range(2, len(taken) + 3)))
        if candidate not in taken
    )


def _source(folder: Path) -> str:
    """Whether a simulator ran; the coupler of a trial without one is what --rig says."""
    try:
        content = yaml.safe_load((folder / PARAMETERS).read_text(encoding='utf-8'))
    except OSError:
        return MEASURED
    return SIMULATED if isinstance(content, dict) and 'simulator' in content else MEASURED


def _about(folder: Path) -> dict[str, str]:
    try:
        content = yaml.safe_load((folder / METADATA).read_text(encoding='utf-8'))
    except OSError:
        return {}
    about = content[INFORMATION].get('custom_data') or {}
    return {name: str(value) for name, value in about.items() if name != 'parameters' and value}

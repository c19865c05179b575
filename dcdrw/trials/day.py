"""A day of recorded trials: each with what was recorded about it, and the tables that hold every number."""

import math
from collections.abc import Iterable, Sequence
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

from dcdrw.files import Table
from dcdrw.recordings.bag_folder import find_bag
from dcdrw.recordings.recorder import PARAMETERS
from dcdrw.trials.analysis import Analysis
from dcdrw.trials.motion import Sink
from dcdrw.trials.results import read_trial
from dcdrw.trials.summary import Summary, summarize
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.topics import JOINT_STATES
from dcdrw_msgs_py.yaml_file import read_yaml
from dcdrw_tracker.gait.contraction import Decay, fit_decay

SIMULATED, MEASURED = 'simulated', 'measured'


class RecordedTrial(NamedTuple):
    """A recorded trial and what was recorded about it."""

    name: str
    analysis: Analysis
    summary: Summary
    source: str
    """SIMULATED or MEASURED."""
    about: dict[str, str]
    """Note, machine, version and so on; empty where nothing was recorded."""
    decay: Decay
    """How the error decays from step to step."""
    rig: RigParams
    """k, b and slope are NaN where neither a simulator nor a rig file told them."""


TRIAL_COLUMNS: dict[str, Any] = {
    'trial': lambda trial: trial.name,
    'source': lambda trial: trial.source,
    'state': lambda trial: trial.summary.state.value,
    'reason': lambda trial: trial.summary.reason,
    'synchronized': lambda trial: trial.summary.synchronized,
    'initial_phase_percent': lambda trial: 100.0 * trial.analysis.status.initial_phase,
    'steps_to_synchronization': lambda trial: trial.summary.steps_to_synchronization,
    'steps_to_synchronization_at_latest': lambda trial: trial.summary.steps_to_synchronization_at_latest,
    'final_phase_low_percent': lambda trial: 50.0 + trial.analysis.status.final_band_percent[0],
    'final_phase_high_percent': lambda trial: 50.0 + trial.analysis.status.final_band_percent[1],
    'contraction_per_step': lambda trial: trial.analysis.status.contraction,
    'limit_percent': lambda trial: 50.0 + trial.decay.limit,
    'k': lambda trial: trial.rig.k,
    'b': lambda trial: trial.rig.b,
    'slope_deg': lambda trial: math.degrees(trial.rig.slope),
    'front_steps': lambda trial: trial.summary.front_steps,
    'slips': lambda trial: trial.summary.slips,
    'seconds': lambda trial: trial.summary.duration_s,
    'complete': lambda trial: trial.summary.complete,
    'judged_from_s': lambda trial: trial.summary.judged_from_s,
    'samples_lost': lambda trial: trial.summary.samples.lost,
    'samples_refused': lambda trial: sum(trial.summary.samples.refused.values()),
    'restarts': lambda trial: trial.analysis.status.restarts,
    'remarks': lambda trial: ' '.join(remark.text for remark in trial.summary.remarks),
    'started': lambda trial: trial.about.get('started', ''),
    'note': lambda trial: trial.about.get('note', ''),
}
STEP_COLUMNS = ('trial', 'wheel', 'steps', 'seconds', 'x', 'error_percent')


def open_trial(
    path: Path,
    name: str,
    rig: Path | None = None,
    topic: str = JOINT_STATES.name,
    namespace: str = '',
    sinks: Sequence[Sink] = (),
) -> RecordedTrial:
    """Analyze a recording, and read what was recorded about it.

    Raises:
        ValueError, OSError: as `dcdrw.trials.results.read_trial`.

    """
    analysis, _ = read_trial(path, rig=rig, topic=topic, namespace=namespace, sinks=sinks)
    bag = find_bag(path)
    folder = bag.path if bag.path.is_dir() else bag.path.parent
    decay = fit_decay(analysis.status.history, analysis.status.contraction)
    source = _source(folder)
    built = analysis.params.rig
    if source == MEASURED and not rig:
        built = built._replace(k=math.nan, b=math.nan, slope=math.nan)
    return RecordedTrial(name, analysis, summarize(analysis), source, _about(bag.about), decay, built)


def table(header: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """CSV, as a text."""
    file = StringIO()
    Table(file, header).add(rows)
    return file.getvalue()


def step_rows(trial: RecordedTrial) -> Iterable[tuple[Any, ...]]:
    """Every footfall of the part that is judged, with the error at those of the front wheel that were seen."""
    errors = {fall: error for fall, error, seen in trial.analysis.strike_errors() if seen}
    for fall in trial.analysis.judged_footfalls:
        yield (
            trial.name,
            fall.wheel,
            fall.steps,
            (fall.stamp_ns - trial.analysis.start_ns) / SECOND,
            fall.x,
            errors.get(fall, math.nan),
        )


def new_name(path: Path, others: list[RecordedTrial]) -> str:
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
        content = read_yaml(folder / PARAMETERS)
    except (OSError, ValueError):
        return MEASURED
    return SIMULATED if isinstance(content, dict) and any(_is_simulator(name) for name in content) else MEASURED


def _is_simulator(section: Any) -> bool:
    return str(section).rpartition('/')[2] == 'simulator'


def _about(about: dict[str, str]) -> dict[str, str]:
    return {name: value for name, value in about.items() if name != 'parameters' and value}

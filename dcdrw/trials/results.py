"""The results of a recorded trial: read and judged, held against what its nodes published, written into a folder."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from dcdrw.console import Bar
from dcdrw.drawings.figure_files import figure_files
from dcdrw.files import Table, table_file, to_json, write_csv, write_text, write_whole
from dcdrw.recordings.dating import dated
from dcdrw.recordings.derived_joints import derived_joints, joint_topic
from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.recordings.leg_recording import is_walked
from dcdrw.recordings.recorded_runs import recorded_runs, with_runs
from dcdrw.recordings.recording import Recording
from dcdrw.suite.parameter_file import TrialParams, read_parameter_file
from dcdrw.trials.acts import Clock, recorded_acts
from dcdrw.trials.agreement import Agreement, Comparison
from dcdrw.trials.analysis import Analysis, analyze
from dcdrw.trials.figure import draw_trial
from dcdrw.trials.motion import MotionTable, Sink
from dcdrw.trials.summary import sentence, summarize
from dcdrw_msgs_py.rolling import phi_pitch
from dcdrw_msgs_py.samples import Footfall
from dcdrw_msgs_py.topics import JOINT_STATES

SAMPLES = 'samples.csv'
SAMPLES_HEADER = ('stamp_ns', 'theta1', 'omega1', 'theta2', 'omega2', 'phi', 'phi_rate', 'step_difference', 'restarts')


def read_trial(
    path: Path,
    params: TrialParams | None = None,
    rig: Path | None = None,
    topic: str = JOINT_STATES.name,
    namespace: str = '',
    sinks: Sequence[Sink] = (),
) -> tuple[Analysis, dict[str, Agreement]]:
    """Analyze the trial in a recording, and hold the result against what the nodes published then.

    Args:
        path: the recording, or the trial's folder.
        params: by default those that were recorded, or where there are none the suite's defaults.
        rig: a parameter file; what it names takes the place of these.
        topic: where the joint states are, in any namespace.
        namespace: of the suite, where the recording has several.
        sinks: each is given every sample; of those of a long trial, the analysis keeps only a part.

    Raises:
        ValueError: no recording, no such topic, or no joint states that can be read.
        OSError: a file cannot be read.

    """
    with Recording(path) as recording:
        name, batches = _joint_states(recording, topic, rig, namespace)
        space = name.rpartition('/')[0]
        if params is None:
            params = TrialParams()
            if recording.parameters:
                params = read_parameter_file(recording.parameters, params, space)
        if rig:
            params = read_parameter_file(rig, params, space)
        comparison = Comparison(recording, phi_pitch(params.sync.front, params.sync.rear), space)
        clock = Clock()
        states = clock.watch(dated(batches, params.phase))
        trial = analyze(states, params, [*sinks, comparison], rolls=not is_walked(recording, space))
        if trial.unreadable and not len(trial.motion.stamp_ns):
            mend = (
                ' (front_joint and rear_joint in a rig file name them)' if trial.unreadable.startswith('joint') else ''
            )
            raise ValueError(f'{path}: {name}: {trial.unreadable}{mend}')
        agreements = comparison.agreements()
        acts = recorded_acts(recording, space, clock)
        return trial._replace(damage=tuple(recording.damage), notes=tuple(recording.notes), acts=acts), agreements


class SampleTable:
    """Writes every sample of a trial into a CSV file as it becomes known: a `Sink`.

    Args:
        open_table: makes the table once there is a sample.
        columns: of a `MotionTable`.
        label: the first cells of every row.

    """

    def __init__(self, open_table: Callable[[], Table], columns: Sequence[str], label: tuple[str, ...] = ()) -> None:
        self._open, self._columns, self._label = open_table, columns, label
        self._table: Table | None = None
        self._error: OSError | None = None

    def take(self, motion: MotionTable) -> None:
        """Write the next rows."""
        self._do(lambda table: table.add((*self._label, *row) for row in self._rows(motion)))

    def begin(self) -> None:
        """Take back what came before the wheels were let go."""
        if self._table:
            self._do(lambda table: table.forget())

    def finish(self) -> None:
        """Make the table also where there was no sample.

        Raises:
            OSError: what kept it from being written. Until then nothing is said of it: the trial is worth its verdict.

        """
        self._do(lambda table: table.mark())
        if self._error:
            raise self._error

    def _rows(self, motion: MotionTable) -> Iterable[tuple[Any, ...]]:
        return zip(*(getattr(motion, name).tolist() for name in self._columns), strict=True)

    def _do(self, work: Callable[[Table], None]) -> None:
        if self._error:
            return
        try:
            if self._table is None:
                self._table = self._open()
                self._table.mark()
            work(self._table)
        except OSError as error:
            self._error = error


@contextmanager
def sample_file(folder: Path, force: bool = False) -> Iterator[SampleTable]:
    """What writes samples.csv into the folder of a trial, which it makes.

    Raises:
        ValueError, OSError: at the end, as `dcdrw.files.table_file`.

    """
    with ExitStack() as stack:

        def open_table() -> Table:
            folder.mkdir(parents=True, exist_ok=True)
            return stack.enter_context(table_file(folder / SAMPLES, SAMPLES_HEADER, force))

        table = SampleTable(open_table, SAMPLES_HEADER)
        yield table
        table.finish()


def _joint_states(
    recording: Recording, topic: str, rig: Path | None, namespace: str
) -> tuple[str, Iterable[JointBatch]]:
    """The topic's name, and what it holds.

    Where only poses of the wheels or sensors on legs were recorded, what tag_tracker or leg_tracker makes of them.
    """
    derived = derived_joints(recording, topic, rig, namespace)
    if derived:
        return derived
    found = joint_topic(recording, topic, namespace)
    batches = _shown(recording.joints(found), recording.count(found))
    return found.name, with_runs(batches, recorded_runs(recording, found.name))


def _shown(batches: Iterator[JointBatch], total: int) -> Iterator[JointBatch]:
    with Bar('reading', 'messages') as bar:
        bar.begin(total)
        for batch in batches:
            yield batch
            bar.more(batch.messages)


def describe(agreements: dict[str, Agreement]) -> dict[str, dict[str, int]]:
    """The agreement of each topic, as numbers for a program."""
    return {topic: agreement._asdict() for topic, agreement in agreements.items()}


def result(trial: Analysis, more: Mapping[str, object]) -> dict[str, object]:
    """What summary.json holds."""
    return {**more, **summarize(trial)._asdict()}


def write_results(
    trial: Analysis,
    folder: Path,
    more: Mapping[str, object],
    force: bool = False,
    formats: Sequence[str] = ('png',),
) -> None:
    """Write summary.json, footfalls.csv and, where there is something to draw, the picture of a trial.

    Raises:
        ValueError: there is no picture, for want of matplotlib; all else is written.
        OSError: the disk is full, say.

    """
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / 'summary.json', to_json(result(trial, more)), force)
    write_csv(folder / 'footfalls.csv', Footfall._fields, trial.footfalls, force)
    if trial.ran:
        for path in figure_files(folder, ['trial'], formats):
            with write_whole(path, force) as unfinished:
                draw_trial(trial, sentence(trial), unfinished)

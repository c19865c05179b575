"""What follows from joint states: the same estimator and monitor as the nodes', as fast as they go. Knows no ROS."""

import gc
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from statistics import median_low
from typing import Any, NamedTuple

import numpy as np

from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.recordings.lone_wheels import LoneWheels
from dcdrw.suite.parameter_file import TrialParams
from dcdrw.trials.acts import Acts
from dcdrw.trials.course import Course, Gap
from dcdrw.trials.motion import MotionTable, Sink
from dcdrw.trials.strike_check import Contradiction, StrikeCheck
from dcdrw_msgs_py.diagnosis import PairState
from dcdrw_msgs_py.in_step import strikes_in_step
from dcdrw_msgs_py.rig import FRONT
from dcdrw_msgs_py.rolling import phi_pitch
from dcdrw_msgs_py.samples import SECOND, CouplerSample, Footfall, JointSample, PhaseSample, Turn
from dcdrw_msgs_py.text_file import one_line
from dcdrw_msgs_py.values import Floats
from dcdrw_msgs_py.words import counted
from dcdrw_tracker.gait.cadence import CadenceStatus
from dcdrw_tracker.gait.pair_state import judge
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseStatus
from dcdrw_tracker.gait.rest import moves
from dcdrw_tracker.gait.sync import SyncMonitor, SyncStatus

LEARNED = 100
"""Samples after which the estimator knows their cadence."""


class Resumption(NamedTuple):
    """Where judgement had to begin anew."""

    before_ns: int
    """Stamp of the last sample before it."""
    stamp_ns: int
    """Stamp of the first sample after it."""
    row: int
    """Row of the motion that this sample is."""
    restarted: bool
    """The source began anew."""


class Analysis(NamedTuple):
    """A trial, from its joint states alone."""

    params: TrialParams
    motion: MotionTable
    """The rows from the last sample before the wheels move on; of many, those that a picture shows (`Thinned`)."""
    samples: int
    """Number of rows of the whole motion."""
    start_ns: int
    """Stamp of its first row."""
    seconds: float
    """How long it was, by the stamps [s]."""
    gaps: int
    """How often samples are missing in it for long enough to be seen."""
    longest_gaps: tuple[Gap, ...]
    """The longest of these, the longest first."""
    footfalls: tuple[Footfall, ...]
    resumed: Resumption | None
    """Where judgement last had to begin anew: what came before is not judged."""
    judged_footfalls: tuple[Footfall, ...]
    """Footfalls within the part that is judged."""
    unseen: frozenset[Footfall]
    """Footfalls between two samples with others missing in between: their times are guesses."""
    status: SyncStatus
    """Status of a monitor that saw the motion."""
    estimator: PhaseStatus
    """Status of an estimator that saw everything, also what came before the motion."""
    cadence: CadenceStatus
    """Gaps in the joint states from the first of the motion on: samples that never came, or were not recorded."""
    joint_states: int
    """Messages, from the first of `motion` on; those that were refused included."""
    unreadable: str
    """Why the last one that could not be read could not be; empty where all could."""
    contradictions: tuple[Contradiction, ...] = ()
    """What the strikes say against zeros and spokes; not looked for where other parameters seem wrong."""
    wheels_apart: float = 0.0
    """By how much later the rear wheel's own messages were recorded than the front wheel's, by their stamps [s]."""
    pace: float = math.nan
    """How many times as fast time passed by the stamps as by the recording; NaN where that is not known."""
    damage: tuple[str, ...] = ()
    """What of the recording was left out, for it is damaged."""
    notes: tuple[str, ...] = ()
    """What else is not as it should be with the recording."""
    acts: Acts = ()
    """What the synchronizer did, where one was recorded."""

    @property
    def strays(self) -> int:
        """Lone wild samples that are passed over, by the estimator or by the monitor."""
        return self.estimator.strays + self.status.strays

    @property
    def pitch(self) -> float:
        """The angle φ of a whole step, α1 + α2 [rad]."""
        return phi_pitch(self.params.sync.front, self.params.sync.rear)

    def strike_errors(self) -> Iterator[tuple[Footfall, float, bool]]:
        """Strikes of the front wheel in the part that is judged, the error there [%], and whether each was seen."""
        falls = [fall for fall in self.judged_footfalls if fall.wheel == FRONT]
        errors = self.status.history
        for fall, error in zip(falls[-len(errors) :] if errors else [], errors[-len(falls) :], strict=False):
            yield fall, error, fall not in self.unseen

    @property
    def judged(self) -> MotionTable:
        """The part of the motion that is judged."""
        return self.motion.rows(self.motion.row >= self.resumed.row) if self.resumed else self.motion

    @property
    def state(self) -> PairState:
        """What the pair did in the end. Wheels that are held after they have walked take nothing back."""
        held = self.status.held and not self.judged_footfalls
        return judge(self.status._replace(held=held), fresh=self.samples > 1)

    @property
    def ran(self) -> bool:
        """Whether the wheels were let go: else there is nothing to judge, nor to draw."""
        return self.state not in (PairState.NO_DATA, PairState.HELD)

    @property
    def why_not_judged(self) -> str:
        """Why there is no verdict on a trial that ran; empty where there is one.

        It takes as many strikes as make a pair synchronized that is in step throughout. What a wheel was seen to do
        amiss in fewer is a verdict.
        """
        steps, hold = self.status.steps, self.params.sync.hold_steps
        if self.state is not PairState.CONVERGING or strikes_in_step(0, steps) >= hold:
            return ''
        return f'{counted(steps, "step")} of the {hold} that a verdict takes'

    @property
    def why_not_run(self) -> str:
        """What was there in the place of a trial; empty where it ran."""
        if self.state is PairState.HELD:
            return 'the wheels were held all the time'
        if self.state is not PairState.NO_DATA:
            return ''
        if self.unreadable:
            return f'no joint state could be read: {self.unreadable}'
        if self.samples:
            return 'a single joint state was of use'
        return 'no joint state was of use' if self.joint_states else 'there are no joint states'


def analyze(
    batches: Iterable[JointBatch], params: TrialParams, sinks: Sequence[Sink] = (), rolls: bool = True
) -> Analysis:
    """Run estimator and monitor over the joint states of a trial.

    The monitor starts afresh when the wheels are let go: with the last sample before a wheel moves. Memory stays the
    same however long the trial is, but for a footfall now and then.

    Args:
        batches: the joint states.
        params: of the nodes.
        sinks: each is given every row of the motion.
        rolls: whether the wheels roll by themselves, so that their strikes can contradict their zeros and spokes.

    """
    trial = _Trial(params, sinks, rolls)
    with _no_collections():
        for batch in batches:
            trial.take(batch)
    return trial.result()


@contextmanager
def _no_collections() -> Iterator[None]:
    """Nothing here refers to itself, so looking for such garbage only costs: a tenth of the time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


class _Trial:
    def __init__(self, params: TrialParams, sinks: Sequence[Sink], rolls: bool) -> None:
        self._params = params
        self._lone = LoneWheels(params.phase)
        self._estimator = PhaseEstimator(params.phase)
        self._monitor = SyncMonitor(params.sync)
        self._strikes = StrikeCheck()
        self._course = Course([*sinks, self._strikes] if rolls else sinks)
        self._moving = False
        self._is_held = True
        self._received = 0
        self._restarts = self._first_footfall = 0
        self._resumed: Resumption | None = None
        self._before = self._estimator.status().cadence
        self._last: PhaseSample | None = None
        self._unreadable = ''
        self._paces: list[float] = []

    def take(self, batch: JointBatch) -> None:
        """Feed one batch through both cores; wheels in messages of their own are joined first."""
        self._estimator.note_unstamped(batch.unstamped)
        if not math.isnan(batch.pace):
            self._paces.append(batch.pace)
        if self._lone.belongs(batch):
            joined = self._lone.take(batch)
            if joined:
                self._take(joined)
            return
        self._take(batch)

    def _take(self, batch: JointBatch) -> None:
        joints = self._params.phase
        error = batch.error or _missing(batch.names, (joints.front_joint, joints.rear_joint))
        if error:
            if batch.error or {joints.front_joint, joints.rear_joint} & set(batch.names):
                self._estimator.refuse('unreadable', batch.messages)
                self._received += batch.messages
            else:
                self._estimator.note_foreign(batch.messages)
            self._unreadable = error
            return
        front, rear = batch.names.index(joints.front_joint), batch.names.index(joints.rear_joint)
        columns = (
            batch.stamp_ns,
            batch.log_ns if len(batch.log_ns) else np.zeros_like(batch.stamp_ns),
            batch.run if len(batch.run) else np.zeros_like(batch.stamp_ns),
            *(table[:, wheel] for wheel in (front, rear) for table in (batch.position, batch.velocity)),
        )
        rows, phases, errors, verdicts, clock_ns = self._follow([column.tolist() for column in columns])
        if not rows:
            return
        taken, (front_scale, rear_scale) = np.array(rows), joints.scales
        _, front_turns, rear_turns, phis, differences, restarts, *_ = zip(*phases, strict=True)
        if joints.coupler_joint in batch.names:
            coupler = batch.names.index(joints.coupler_joint)
            known = [table[taken, coupler] for table in (batch.position, batch.velocity, batch.effort)]
        else:
            known = [np.full(len(taken), math.nan)] * 3
        self._course.add(
            [
                batch.stamp_ns[taken] - np.array(clock_ns),
                batch.position[taken, front] * front_scale - joints.front_zero,
                batch.position[taken, rear] * rear_scale - joints.rear_zero,
                *known,
                *(column for turns in (front_turns, rear_turns, phis) for column in _columns(turns)),
                np.array(differences, np.int64),
                np.array(restarts, np.int64),
                np.array(errors, float),
                np.array(verdicts, bool),
            ]
        )

    def _follow(
        self, columns: list[list[Any]]
    ) -> tuple[list[int], list[PhaseSample], list[float], list[bool], list[int]]:
        """Rows that were accepted, and what came of them: phase, error, verdict, and by how much the clock was set."""
        taken: list[int] = []
        phases: list[PhaseSample] = []
        errors: list[float] = []
        verdicts: list[bool] = []
        clocks: list[int] = []
        update, coupler = self._estimator.update, CouplerSample()
        for row, (stamp_ns, log_ns, run, psi1, omega1, psi2, omega2) in enumerate(zip(*columns, strict=True)):
            joints = JointSample(stamp_ns, Turn(psi1, omega1), Turn(psi2, omega2), coupler, run)
            made = update(joints, arrival_ns=log_ns)
            if made is None:
                continue
            phase, footfalls, clock_ns, held = made
            if clock_ns:
                footfalls = tuple(fall._replace(stamp_ns=fall.stamp_ns - clock_ns) for fall in footfalls)
            places = [(row, phase)]
            if held:  # those of an earlier batch are not told
                rows = {stamp: place for place, stamp in enumerate(columns[0][:row])}
                places = [(rows[one.stamp_ns], one) for one in held if one.stamp_ns in rows] + places
            for place, one in places:
                if clock_ns:
                    one = one._replace(stamp_ns=one.stamp_ns - clock_ns)
                if not self._moving and self._goes(one):
                    self._let_go(place, len(taken))
                sync = self._monitor.update(one)
                if self._is_held:
                    self._is_held = self._monitor.held
                    if self._is_held and not moves(one):  # a hand moved them a little, and holds them still
                        self._moving = False
                if self._monitor.restarts != self._restarts:
                    self._begin_anew(one, len(taken))
                self._last = one
                taken.append(place)
                phases.append(one)
                errors.append(sync.error_percent if sync else math.nan)
                verdicts.append(bool(sync and sync.synchronized))
                clocks.append(clock_ns)
            if footfalls:
                self._course.footfalls.extend(footfalls)
        self._received += len(columns[0])
        return taken, phases, errors, verdicts, clocks

    def _goes(self, phase: PhaseSample) -> bool:
        """Whether the wheels are let go: by their speeds, or while these are not known, by how far they turned."""
        return moves(phase) or (math.isnan(phase.front.rate) and not self._is_held)

    def _let_go(self, row: int, taken: int) -> None:
        self._moving = True
        self._monitor = SyncMonitor(self._params.sync)
        self._restarts = self._first_footfall = 0
        self._resumed = None
        rows = self._course.rows + taken
        if rows > LEARNED:
            self._before = self._estimator.status().cadence
        self._received = -row
        if self._last:
            self._monitor.update(self._last)
            self._received += 1
        self._course.begin(max(rows - 1, 0))

    def _begin_anew(self, phase: PhaseSample, taken: int) -> None:
        """The monitor has begun anew: what came before is judged no more."""
        self._restarts = self._monitor.restarts
        assert self._last
        row, restarted = self._course.rows + taken - self._course.origin, phase.restarts != self._last.restarts
        self._resumed = Resumption(self._last.stamp_ns, phase.stamp_ns, row, restarted)
        self._first_footfall = len(self._course.footfalls)

    def _cadence(self) -> CadenceStatus:
        """The estimator's gaps since the wheels were let go."""
        now, before = self._estimator.status().cadence, self._before
        gaps, lost = (max(count, 0) for count in (now.gaps - before.gaps, now.lost - before.lost))
        return CadenceStatus(now.rate, gaps, lost, self._course.longest_ns * 1e-9 if gaps else 0.0)

    def result(self) -> Analysis:
        """All that there is."""
        rest = self._lone.rest()
        if rest:
            self._take(rest)
        if self._lone.unpaired:
            self._estimator.refuse('unpaired', self._lone.unpaired)
        if self._lone.missing and not self._course.rows:
            self._unreadable = self._lone.missing
        course = self._course
        motion = course.motion
        estimator = self._estimator.status()
        return Analysis(
            params=self._params,
            motion=motion,
            samples=course.samples,
            start_ns=course.start_ns,
            seconds=(course.end_ns - course.start_ns) / SECOND,
            gaps=course.gaps,
            longest_gaps=tuple(course.longest_gaps),
            footfalls=tuple(course.footfalls),
            resumed=self._resumed,
            judged_footfalls=tuple(course.footfalls[self._first_footfall :]),
            unseen=frozenset(course.unseen),
            status=self._monitor.status(),
            estimator=estimator,
            contradictions=() if estimator.hints else self._strikes.contradictions(self._params.phase),
            cadence=self._cadence(),
            joint_states=self._received,
            unreadable=self._unreadable,
            wheels_apart=self._lone.offset,
            pace=median_low(self._paces) if self._paces else math.nan,
        )


def _columns(turns: Sequence[Turn]) -> Floats:
    """Angles and rates: np.array would take six times as long over tuples."""
    columns: Floats = np.fromiter(chain.from_iterable(turns), np.float64, 2 * len(turns)).reshape(-1, 2).T
    return columns


def _missing(names: Sequence[str], wheels: Sequence[str]) -> str:
    for name in wheels:
        if names.count(name) != 1:
            what = (
                'stands twice in the message'
                if name in names
                else (f'is missing; the message names {", ".join(map(one_line, names)) or "none"}')
            )
            return f'joint {name} {what}'
    return ''

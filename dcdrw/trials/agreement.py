"""Whether what the nodes published in a recording is what its joint states give here: to the last bit."""

from collections.abc import Iterator
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from dcdrw.recordings.bag_file import Stream
from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.recordings.recording import BATCH, Recording
from dcdrw.trials.motion import Integers, MotionTable
from dcdrw_msgs_py.topics import (
    FRONT_STANCE,
    PHASE_STATE,
    PHI_JOINT,
    REAR_STANCE,
    RESTARTS,
    STEP_DIFFERENCE_JOINT,
    SYNC_ERROR,
    SYNC_ERROR_PERCENT,
)
from dcdrw_msgs_py.values import Floats

_COLUMNS = ('theta1', 'omega1', 'theta2', 'omega2', 'phi', 'phi_rate')
_JOINTS = (FRONT_STANCE, REAR_STANCE, PHI_JOINT, STEP_DIFFERENCE_JOINT)
_AHEAD = 65_536
"""Errors that are read ahead of the motion at most: so many may have none there that is equal."""
_NEAR = 16_384
"""Among so many of them those are looked for first that belong to the next part of the motion."""


class Agreement(NamedTuple):
    """How many messages of one topic agree with what is computed here."""

    recorded: int
    """Messages."""
    equal: int
    """Messages whose every bit the analysis gives, too."""


class Comparison:
    """Holds the motion of a trial against what its nodes published in the same namespace, topic by topic: a `Sink`.

    Both are read side by side, so that memory does not grow with their length.
    """

    def __init__(self, recording: Recording, pitch: float, namespace: str = '') -> None:
        self._topics: dict[str, _Phases | _Errors] = {}
        phases = Stream(f'{namespace}/{PHASE_STATE.name}', PHASE_STATE.type)
        if phases in recording.topics:
            self._topics[PHASE_STATE.name] = _Phases(_recorded_phases(recording, phases))
        for topic, scale in ((SYNC_ERROR, pitch), (SYNC_ERROR_PERCENT, 0.0)):
            errors = Stream(f'{namespace}/{topic.name}', topic.type)
            if errors in recording.topics:
                self._topics[topic.name] = _Errors(_recorded_errors(recording, errors), scale)

    def take(self, motion: MotionTable) -> None:
        """Take the next rows."""
        for topic in self._topics.values():
            topic.take(motion)

    def begin(self) -> None:
        """The nodes publish also while the wheels are held."""

    def agreements(self) -> dict[str, Agreement]:
        """How far the topics that were recorded agree, once all rows have been taken."""
        found = {name: topic.end() for name, topic in self._topics.items()}
        return {name: agreement for name, agreement in found.items() if agreement.recorded}


class _Rows(NamedTuple):
    """Phase samples of one run of the source, in rising order of stamps."""

    run: int
    """Runs before it."""
    stamp_ns: Integers
    numbers: Floats
    step_difference: Integers

    def rows(self, part: Any) -> '_Rows':
        return _Rows(self.run, self.stamp_ns[part], self.numbers[part], self.step_difference[part])


class _Runs:
    """Cuts phase samples where the source began anew, and counts its runs."""

    def __init__(self) -> None:
        self._run = -1
        self._restarts: int | None = None

    def cut(self, restarts: Integers, stamp_ns: Integers, numbers: Floats, differences: Integers) -> Iterator[_Rows]:
        begins = np.flatnonzero(np.diff(restarts, prepend=restarts[:1] - 1))
        for begin, end in zip(begins, [*begins[1:], len(restarts)], strict=True):
            if restarts[begin] != self._restarts:
                self._run, self._restarts = self._run + 1, int(restarts[begin])
            yield _Rows(self._run, stamp_ns[begin:end], numbers[begin:end], differences[begin:end])


class _Phases:
    """Compares `phase_state`, from the first joint state that was recorded to the last."""

    def __init__(self, told: Iterator[_Rows]) -> None:
        self._told = told
        self._next = next(told, None)
        self._runs = _Runs()
        self._run, self._begun = 0, False
        self._recorded = self._equal = 0
        self._offset: tuple[int, int] | None = None
        """The run, and by how much n differs in it: n counts from wherever each began."""

    def take(self, motion: MotionTable) -> None:
        numbers = np.column_stack([getattr(motion, column) for column in _COLUMNS])
        for given in self._runs.cut(motion.restarts, motion.stamp_ns, numbers, motion.step_difference):
            self._run = given.run
            if not self._begun:
                self._begun = True
                self._skip_before(int(given.stamp_ns[0]))
            self._compare(given)

    def end(self) -> Agreement:
        after, further = 0, not self._begun
        while told := self._next:
            after, further = after + len(told.stamp_ns), further or told.run > self._run
            self._next = next(self._told, None)
        return Agreement(self._recorded + (after if further else 0), self._equal)

    def _skip_before(self, stamp_ns: int) -> None:
        while self._next and self._next.run == 0:
            rest = self._next.rows(self._next.stamp_ns >= stamp_ns)
            if len(rest.stamp_ns):
                self._next = rest
                return
            self._next = next(self._told, None)

    def _compare(self, given: _Rows) -> None:
        while (told := self._next) and told.run <= given.run:
            count = len(told.stamp_ns)
            if told.run == given.run:
                count = int(np.searchsorted(told.stamp_ns, given.stamp_ns[-1], 'right'))
                self._equal += self._count_equal(told.rows(slice(count)), given)
            self._recorded += count
            if count < len(told.stamp_ns):
                self._next = told.rows(slice(count, None))
                return
            self._next = next(self._told, None)

    def _count_equal(self, told: _Rows, given: _Rows) -> int:
        place = np.minimum(np.searchsorted(given.stamp_ns, told.stamp_ns), len(given.stamp_ns) - 1)
        same = (given.stamp_ns[place] == told.stamp_ns) & (
            given.numbers[place].view(np.int64) == np.ascontiguousarray(told.numbers).view(np.int64)
        ).all(axis=1)
        offsets = (told.step_difference - given.step_difference[place])[same]
        if not len(offsets):
            return 0
        if self._offset is None or self._offset[0] != given.run:
            self._offset = given.run, int(offsets[0])
        return int((offsets == self._offset[1]).sum())


class _Errors:
    """Compares `sync_error` or its percentage, which bear no stamps: they come in the order of the samples."""

    def __init__(self, told: Iterator[Integers], scale: float) -> None:
        self._told, self._scale = told, scale
        self._waiting = np.empty(0, np.int64)
        self._last = np.empty(0, np.int64)
        self._recorded = self._equal = 0

    def take(self, motion: MotionTable) -> None:
        errors = motion.error_percent / 100.0 * self._scale if self._scale else motion.error_percent
        values = np.ascontiguousarray(errors).view(np.int64)
        while len(self._waiting) < _AHEAD and (more := next(self._told, None)) is not None:
            self._waiting = np.concatenate([self._waiting, more])
        given, self._last = np.concatenate([self._last, values]), values
        for ahead in (_NEAR, None):
            found = np.isin(self._waiting[:ahead], given)
            if found.any():
                passed = int(np.flatnonzero(found)[-1]) + 1
                self._recorded, self._equal = self._recorded + passed, self._equal + int(found.sum())
                self._waiting = self._waiting[passed:]
                return

    def end(self) -> Agreement:
        return Agreement(self._recorded + len(self._waiting) + sum(map(len, self._told)), self._equal)


def _recorded_phases(recording: Recording, topic: Stream) -> Iterator[_Rows]:
    """The recorded `phase_state`."""
    runs = _Runs()
    for batch in recording.joints(topic):
        if batch.error or not set(_JOINTS) <= set(batch.names):
            continue
        places = [batch.names.index(joint) for joint in _JOINTS]
        numbers = np.stack([batch.position[:, places[:3]], batch.velocity[:, places[:3]]], axis=2)
        differences = batch.position[:, places[3]].astype(np.int64)
        yield from runs.cut(_restarts(batch), batch.stamp_ns, numbers.reshape(batch.messages, 6), differences)


def _recorded_errors(recording: Recording, topic: Stream) -> Iterator[Integers]:
    """The bits of the recorded errors."""
    values = (message.data[4:12] for message in recording.messages([topic]) if len(message.data) >= 12)
    while part := b''.join(islice(values, BATCH)):
        yield np.frombuffer(part, '<i8')


def _restarts(batch: JointBatch) -> Integers:
    """How often the source had started anew."""
    if RESTARTS in batch.names:
        return batch.position[:, batch.names.index(RESTARTS)].astype(np.int64)
    return np.zeros(batch.messages, np.int64)

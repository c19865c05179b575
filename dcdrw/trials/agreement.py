"""Whether what the nodes published in a recording is what its joint states give here: to the last bit."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.recordings.recording import Recording
from dcdrw.trials.analysis import Analysis, Floats, Integers
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

_COLUMNS = ('theta1', 'omega1', 'theta2', 'omega2', 'phi', 'phi_rate')
_JOINTS = (FRONT_STANCE, REAR_STANCE, PHI_JOINT, STEP_DIFFERENCE_JOINT)


class Agreement(NamedTuple):
    """How many messages of one topic agree with what is computed here."""

    recorded: int
    """Messages."""
    equal: int
    """Those whose every bit the analysis gives, too."""


def compare(recording: Recording, analysis: Analysis, namespace: str = '') -> dict[str, Agreement]:
    """Hold the analysis of a recording against what its nodes published in the same namespace, topic by topic."""
    found = {}
    name = f'{namespace}/{PHASE_STATE.name}'
    if recording.types.get(name) == PHASE_STATE.type:
        found[PHASE_STATE.name] = _compare_phases(recording, name, analysis)
    percent = np.concatenate([analysis.held.error_percent, analysis.motion.error_percent])
    for topic, values in ((SYNC_ERROR, percent / 100.0 * analysis.pitch), (SYNC_ERROR_PERCENT, percent)):
        name = f'{namespace}/{topic.name}'
        if recording.types.get(name) == topic.type:
            told = np.frombuffer(b''.join(message.data[4:12] for message in recording.messages([name])), '<i8')
            found[topic.name] = Agreement(len(told), int(np.isin(told, values.view(np.int64)).sum()))
    return {topic: agreement for topic, agreement in found.items() if agreement.recorded}


class _Phases(NamedTuple):
    """Phase samples of one run of the source, in rising order of stamps."""

    stamp_ns: Integers
    numbers: Floats
    step_difference: Integers

    def rows(self, part: Any) -> '_Phases':
        return _Phases(self.stamp_ns[part], self.numbers[part], self.step_difference[part])


def _compare_phases(recording: Recording, name: str, analysis: Analysis) -> Agreement:
    told = list(_runs(*_read(recording, name)))
    both = [np.concatenate(columns) for columns in zip(analysis.held, analysis.motion, strict=True)]
    motion = type(analysis.motion)(*both)
    numbers = np.column_stack([getattr(motion, column) for column in _COLUMNS])
    given = list(_runs(motion.restarts, _Phases(motion.stamp_ns, numbers, motion.step_difference)))
    if told and given:  # what came before the first joint state that was recorded, or after the last, tells nothing
        told[0] = told[0].rows(told[0].stamp_ns >= given[0].stamp_ns[0])
        if len(told) == len(given):
            told[-1] = told[-1].rows(told[-1].stamp_ns <= given[-1].stamp_ns[-1])
    equal = sum(_count_equal(one, other) for one, other in zip(told, given, strict=False))
    return Agreement(sum(len(run.stamp_ns) for run in told), equal)


def _read(recording: Recording, name: str) -> tuple[Integers, _Phases]:
    """The recorded `phase_state`: the run of each sample, and the samples."""
    runs: list[Integers] = []
    parts: list[_Phases] = []
    for batch in recording.joints(name):
        if batch.error or not set(_JOINTS) <= set(batch.names):
            continue
        places = [batch.names.index(joint) for joint in _JOINTS]
        numbers = np.stack([batch.position[:, places[:3]], batch.velocity[:, places[:3]]], axis=2)
        runs.append(_restarts(batch))
        parts.append(
            _Phases(batch.stamp_ns, numbers.reshape(batch.messages, 6), batch.position[:, places[3]].astype(np.int64))
        )
    if not parts:
        return np.empty(0, np.int64), _Phases(np.empty(0, np.int64), np.empty((0, 6)), np.empty(0, np.int64))
    return np.concatenate(runs), _Phases(*map(np.concatenate, zip(*parts, strict=True)))


def _restarts(batch: JointBatch) -> Integers:
    """How often the source had started anew."""
    if RESTARTS in batch.names:
        return batch.position[:, batch.names.index(RESTARTS)].astype(np.int64)
    return np.zeros(batch.messages, np.int64)


def _runs(numbers: NDArray[np.int64], phases: _Phases) -> Iterator[_Phases]:
    """Cut where the number of the run changes."""
    cuts = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist(), len(numbers)]
    for begin, end in pairwise(cuts):
        if end > begin:
            yield phases.rows(slice(begin, end))


def _count_equal(told: _Phases, given: _Phases) -> int:
    """Samples that are told and given alike; n counts from wherever each began."""
    place = np.minimum(np.searchsorted(given.stamp_ns, told.stamp_ns), len(given.stamp_ns) - 1)
    same = (given.stamp_ns[place] == told.stamp_ns) & (
        given.numbers[place].view(np.int64) == np.ascontiguousarray(told.numbers).view(np.int64)
    ).all(axis=1)
    if not same.any():
        return 0
    offset = (told.step_difference - given.step_difference[place])[same]
    return int((offset == offset[0]).sum())

"""What the synchronizer did in a recorded trial, and when, by the stamps of the joint states. Knows no ROS."""

from collections.abc import Iterable, Iterator
from itertools import groupby, pairwise
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from dcdrw.recordings.bag_file import Stream
from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.recordings.recording import Recording
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.topics import SYNCHRONIZER_STATE

EVERY = 64
"""Of so many messages one is remembered: a source that lags more and more is followed."""
Acts = tuple[tuple[int, str], ...]
"""Stamps, and what the synchronizer did from then on."""


class Stretch(NamedTuple):
    """A time in which the synchronizer did one thing."""

    state: str
    begin: float
    """Since the trial's start [s]."""
    end: float
    """Likewise."""


def stretches(acts: Acts, start_ns: int, seconds: float) -> list[Stretch]:
    """What it did one after the other, of a trial that starts at a stamp and takes so many seconds."""
    told = [(max((stamp_ns - start_ns) / SECOND, 0.0), state) for stamp_ns, state in acts]
    pairs = pairwise([*told, (seconds, '')])
    return [Stretch(state, begin, min(end, seconds)) for (begin, state), (end, _) in pairs if begin < min(end, seconds)]


class Clock:
    """Turns times of recording into stamps of the joint states: a state of the synchronizer has none of its own."""

    def __init__(self) -> None:
        self._log_ns: list[int] = []
        self._stamp_ns: list[int] = []

    @property
    def runs(self) -> bool:
        """Whether both times are known."""
        return bool(self._log_ns)

    def watch(self, batches: Iterable[JointBatch]) -> Iterator[JointBatch]:
        """The same batches, of each of which every so many messages are remembered."""
        for batch in batches:
            if len(batch.log_ns) == len(batch.stamp_ns):
                self._log_ns += batch.log_ns[::EVERY].tolist()
                self._stamp_ns += batch.stamp_ns[::EVERY].tolist()
            yield batch

    def stamps(self, log_ns: list[int]) -> list[int]:
        """Stamps that belong to times of recording [ns]: the nearest message tells the difference."""
        known = np.array(self._log_ns)
        nearest = [int(np.abs(known - each).argmin()) for each in log_ns]
        return [each + self._stamp_ns[i] - self._log_ns[i] for each, i in zip(log_ns, nearest, strict=True)]


def recorded_acts(recording: Recording, namespace: str, clock: Clock) -> Acts:
    """What the synchronizer of a namespace did; nothing where none was recorded. The joint states must be read."""
    topic = Stream(f'{namespace}/{SYNCHRONIZER_STATE.name}', SYNCHRONIZER_STATE.type)
    if topic not in recording.topics or not clock.runs:
        return ()
    every = ((log_ns, str(message.data)) for _, log_ns, message in recording.decoded([topic]))
    said = [next(told) for _, told in groupby(every, key=itemgetter(1))]  # the same is told again and again
    return tuple(zip(clock.stamps([log_ns for log_ns, _ in said]), (state for _, state in said), strict=True))

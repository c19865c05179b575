"""Recordings in which each wheel has messages of its own: joined into joint states of both."""

import numpy as np

from dcdrw.recordings.joint_batch import JointBatch
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import SECOND, JointSample, LoneWheel, Turn
from dcdrw_msgs_py.text_file import one_line
from dcdrw_tracker.gait.pairing import WheelPairs
from dcdrw_tracker.gait.phase import PhaseParams

ENOUGH = 4096
"""Joint states that are handed on at once."""


class LoneWheels:
    """Takes batches that name one of the wheels only; hands on batches of both."""

    def __init__(self, joints: PhaseParams) -> None:
        self._names = {joints.front_joint: FRONT, joints.rear_joint: REAR}
        self._pairs = WheelPairs()
        self._joined: list[JointSample] = []
        self._log_ns: list[int] = []
        self.missing = ''
        """Which wheel the last message lacked, and what it names; or that the stamps of both never meet."""
        self._latest_ns: dict[str, int] = {}
        self._delays = dict.fromkeys(self._names, (0, 0.0))
        """Number of each wheel's messages, and their mean time from stamp to recording [s]."""

    @property
    def unpaired(self) -> int:
        """Messages of a wheel to which none of the other one belongs."""
        return self._pairs.unpaired

    @property
    def offset(self) -> float:
        """By how much later than the front wheel's the rear wheel's messages are recorded, by their stamps [s]."""
        (front_count, front), (rear_count, rear) = self._delays.values()
        return rear - front if front_count and rear_count else 0.0

    def belongs(self, batch: JointBatch) -> bool:
        """Whether a batch has just one of the wheels."""
        return not batch.error and sum(batch.names.count(name) for name in self._names) == 1

    def take(self, batch: JointBatch) -> JointBatch | None:
        """Take a batch; returns the joint states that are complete, once there are enough."""
        name = next(name for name in self._names if name in batch.names)
        other = next(name for name in self._names if name not in batch.names)
        self.missing = f'joint {other} is missing; the message names {", ".join(map(one_line, batch.names))}'
        if other in self._latest_ns and batch.messages:
            apart = abs(int(batch.stamp_ns[-1]) - self._latest_ns[other]) / SECOND
            self.missing = f'the stamps of {name} and {other} lie {apart:.3g} s apart: do their clocks agree?'
        column = batch.names.index(name)
        rows = zip(batch.stamp_ns.tolist(), batch.position[:, column], batch.velocity[:, column], strict=True)
        times = batch.log_ns.tolist() or [0] * batch.messages
        self._latest_ns[name] = int(batch.stamp_ns[-1])
        if len(batch.log_ns):
            count, mean = self._delays[name]
            count += batch.messages
            mean += float(((batch.log_ns - batch.stamp_ns) / SECOND - mean).sum()) / count
            self._delays[name] = count, mean
        for (stamp_ns, angle, rate), log_ns in zip(rows, times, strict=True):
            joined = self._pairs.take(LoneWheel(stamp_ns, self._names[name], Turn(float(angle), float(rate))))
            self._joined += joined
            self._log_ns += [log_ns] * len(joined)
        return self.rest() if len(self._joined) >= ENOUGH else None

    def rest(self) -> JointBatch | None:
        """The joint states that are left."""
        samples, log_ns = self._joined, self._log_ns
        if not samples:
            return None
        self._joined, self._log_ns = [], []
        turns = np.array([(*sample.front, *sample.rear) for sample in samples])
        return JointBatch(
            '',
            tuple(self._names),
            np.array([sample.stamp_ns for sample in samples], np.int64),
            turns[:, ::2],
            turns[:, 1::2],
            np.full((len(samples), 2), np.nan),
            log_ns=np.array(log_ns, np.int64),
        )

"""When a camera's frames are due, and what the joints are then: the pace of `virtual_camera`, without ROS and clock."""

import math
from typing import Annotated, NamedTuple

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.samples import SECOND, CouplerSample, JointSample, Turn

LONGEST_GAP = SECOND
"""After a gap longer than this, frames fall due anew from there on [ns]."""


class ShutterParams(NamedTuple):
    """How frames are taken and sent."""

    frame_rate: Annotated[float, Quantity('frames per second', 'Hz', above=0.0, high=1000.0)] = 60.0
    encoding: Annotated[str, Quantity('mono8, or bgr8, which is three times as much to send')] = 'mono8'
    frame_id: Annotated[str, Quantity('frame of image_raw and camera_info')] = 'camera'

    def check_encoding(self) -> None:
        """Refuse what is not drawn.

        Raises:
            ValueError: an unknown encoding.

        """
        if self.encoding not in ('mono8', 'bgr8'):
            raise ValueError(f'encoding must be mono8 or bgr8, got {self.encoding!r}')


class Shutter:
    """Takes joint samples; frames fall due at a constant rate from the first one on, by the samples' own stamps.

    One frame at most waits to be drawn, the newest. Those that it displaces, and those that fell due between two
    samples, are counted as dropped.
    """

    def __init__(self, frame_rate: float) -> None:
        self.frame_rate = frame_rate
        self.taken = 0
        """Frames that were drawn."""
        self.dropped = 0
        """Frames that were not."""
        self._last: JointSample | None = None
        self._due: JointSample | None = None
        self._epoch_ns = self._number = 0

    def take(self, joints: JointSample) -> bool:
        """Take the next sample; returns whether it is the first of its source, or of one that started anew."""
        last, self._last = self._last, joints
        begins = last is None or joints.run != last.run or joints.stamp_ns < last.stamp_ns
        if last is None or begins or joints.stamp_ns - last.stamp_ns > LONGEST_GAP:
            self.dropped += self._due is not None
            self._epoch_ns, self._number, self._due = joints.stamp_ns, 0, joints
            return begins
        number = math.floor((joints.stamp_ns - self._epoch_ns) * 1e-9 * self.frame_rate)
        if number > self._number:
            self.dropped += number - self._number - (self._due is None)
            stamp_ns = self._epoch_ns + round(number / self.frame_rate * SECOND)
            self._number, self._due = number, between(last, joints, min(stamp_ns, joints.stamp_ns))
        return False

    def release(self) -> JointSample | None:
        """The joints of the frame that is due, once; None where none is."""
        due, self._due = self._due, None
        self.taken += due is not None
        return due


def between(earlier: JointSample, later: JointSample, stamp_ns: int) -> JointSample:
    """The joints at a time from one sample to another, interpolated; a speed that is not told, from the rotation."""
    span_ns = later.stamp_ns - earlier.stamp_ns
    part = (stamp_ns - earlier.stamp_ns) / span_ns

    def mix(a: float, b: float) -> float:
        return a + part * (b - a)

    def turn(a: Turn, b: Turn) -> Turn:
        rate = mix(a.rate, b.rate)
        return Turn(mix(a.angle, b.angle), rate if math.isfinite(rate) else (b.angle - a.angle) / span_ns * SECOND)

    return JointSample(
        stamp_ns,
        turn(earlier.front, later.front),
        turn(earlier.rear, later.rear),
        CouplerSample(*map(mix, earlier.coupler, later.coupler)),
        later.run,
    )

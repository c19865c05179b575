"""Wheels at rest: whether somebody holds them. A wheel that is left alone rolls, rocks, or stands on two spokes."""

import math
from typing import NamedTuple

from dcdrw_msgs_py.samples import PhaseSample

SLOW = 0.1
"""A wheel that turns slower may be at rest, seen through the noise of a camera [rad/s]."""
STILL = math.radians(1.0)
"""A wheel at rest stays within this of an angle; one that stands is within this of two spokes [rad]."""
REST_NS = 1_000_000_000
"""Wheels that were still for so long are at rest [ns]: less than a wheel takes to turn round near its apex."""


def moves(phase: PhaseSample) -> bool:
    """Whether a wheel is known to move, by its speed."""
    return abs(phase.front.rate) > SLOW or abs(phase.rear.rate) > SLOW


class _Place(NamedTuple):
    stamp_ns: int
    front: float
    rear: float


class Rest:
    """Follows the phase; tells whether the wheels are held.

    They are held until they first move, and again where both come to rest while one of them stands elsewhere than on
    two spokes: there it cannot stay by itself.

    Args:
        phase: the first sample.
        front_alpha: half the angle between the front wheel's spokes [rad].
        rear_alpha: of the rear wheel.

    """

    def __init__(self, phase: PhaseSample, front_alpha: float, rear_alpha: float) -> None:
        self._front_stands, self._rear_stands = front_alpha - STILL, rear_alpha - STILL
        self._still = _place(phase)
        self.held = not moves(phase)
        """Whether the wheels are held."""

    def update(self, phase: PhaseSample) -> bool:
        """Take the next sample; whether the wheels are let go with it."""
        still, front, rear = self._still, phase.front.angle, phase.rear.angle
        if -STILL <= front - still.front <= STILL and -STILL <= rear - still.rear <= STILL:
            if not self.held and phase.stamp_ns - still.stamp_ns >= REST_NS:
                self.held = abs(front) < self._front_stands or abs(rear) < self._rear_stands
            return False
        released, self.held = self.held, False
        self._still = _place(phase)
        return released


def _place(phase: PhaseSample) -> _Place:
    return _Place(phase.stamp_ns, phase.front.angle, phase.rear.angle)

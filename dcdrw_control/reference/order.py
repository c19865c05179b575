"""Footfalls of the four feet: in which order they come, and when the robot's should have come."""

import math
from collections import deque
from enum import IntEnum
from typing import NamedTuple

from dcdrw_control.reference.plan import LEADS_BY
from dcdrw_msgs_py.samples import SECOND

REMEMBERED = 4
"""Footfalls that are judged: those of a stride."""
KEPT = 100
"""Footfalls of which the timing is told."""
SAME = 0.3
"""Seconds within which a footfall that is planned and one that is seen are the same."""


class Foot(IntEnum):
    """The feet by rows."""

    FRONT_LEFT = 1
    FRONT_RIGHT = 2
    REAR_LEFT = 3
    REAR_RIGHT = 4

    @property
    def rear(self) -> bool:
        """Whether it is the robot's."""
        return self > Foot.FRONT_RIGHT

    @property
    def leg(self) -> str:
        """Its leg's name, as in leg_phases."""
        return self.name.lower()


FOLLOWS = {
    Foot.FRONT_LEFT: Foot.REAR_RIGHT,
    Foot.REAR_RIGHT: Foot.FRONT_RIGHT,
    Foot.FRONT_RIGHT: Foot.REAR_LEFT,
    Foot.REAR_LEFT: Foot.FRONT_LEFT,
}
"""The order 1-4-2-3."""
FRONT_FEET = Foot.FRONT_LEFT, Foot.FRONT_RIGHT
REAR_FEET = Foot.REAR_LEFT, Foot.REAR_RIGHT


class Fall(NamedTuple):
    """One footfall."""

    foot: Foot
    stamp_ns: int


class Crossings:
    """Finds the footfalls of one foot: when its phase passes a whole stride."""

    def __init__(self, foot: Foot) -> None:
        self._foot = foot
        self._last: tuple[int, float] | None = None

    def update(self, stamp_ns: int, strides: float) -> Fall | None:
        """Take the next phase; the footfall since the last one. What falls back, or leaps a stride, tells of none."""
        last, self._last = self._last, (stamp_ns, strides)
        if last is None or stamp_ns <= last[0]:
            return None
        before_ns, before = last
        whole = math.floor(strides)
        if not before < whole <= strides or strides - before > 1.0:
            return None
        return Fall(self._foot, before_ns + round((whole - before) / (strides - before) * (stamp_ns - before_ns)))


class OrderStatus(NamedTuple):
    """How the feet have fallen."""

    falls: int
    """Footfalls that were judged."""
    wrong: int
    """Of these, those out of order."""
    lately: tuple[bool, ...]
    """Whether each of the last four was right."""
    lead_error: float
    """Root mean square of how far the robot's footfalls are from a quarter stride ahead [s]; NaN where unknown."""
    late: float
    """By how much those seen come after those planned, on average [s]; NaN where none was seen."""

    @property
    def twice(self) -> bool:
        """Whether two of the last, one after the other, were wrong."""
        return (False, False) in zip(self.lately, self.lately[1:], strict=False)


class FootfallOrder:
    """Judges the footfalls of person and robot, as they are seen; the robot's as planned where it has no sensors."""

    def __init__(self) -> None:
        self.falls = self.wrong = 0
        self._late: deque[float] = deque(maxlen=KEPT)
        self._errors: deque[float] = deque(maxlen=KEPT)
        self.begin()

    def begin(self) -> None:
        """Begin anew with the next footfall."""
        self._last: Foot | None = None
        self._lately: deque[bool] = deque(maxlen=REMEMBERED)
        self._planned: deque[Fall] = deque(maxlen=KEPT)
        self._robots: dict[Foot, int] = {}
        self._person: dict[Foot, int] = {}

    def plan(self, fall: Fall) -> None:
        """Take a planned footfall of the robot."""
        self._planned.append(fall)

    def see(self, fall: Fall) -> float | None:
        """Take a footfall that happened, in the order of time.

        Returns:
            for one of the person's, by how much later than a quarter of this stride ahead of it the robot's came on the
            same side [s]; None where that is unknown.

        """
        foot = fall.foot
        if self._last is not None:
            right = FOLLOWS[self._last] is foot
            self.falls, self.wrong = self.falls + 1, self.wrong + (not right)
            self._lately.append(right)
        self._last = foot
        if foot.rear:
            self._robots[foot] = fall.stamp_ns
            late = [(fall.stamp_ns - one.stamp_ns) / SECOND for one in self._planned if one.foot is foot]
            if late and abs(closest := min(late, key=abs)) < SAME:
                self._late.append(closest)
            return None
        before, self._person[foot] = self._person.get(foot), fall.stamp_ns
        came = self._robots.get(REAR_FEET[FRONT_FEET.index(foot)])
        if before is None or came is None or not before < came <= fall.stamp_ns:
            return None
        due = before + (1.0 - LEADS_BY) * (fall.stamp_ns - before)
        self._errors.append((came - due) / SECOND)
        return self._errors[-1]

    def status(self) -> OrderStatus:
        """A snapshot."""
        errors, late = self._errors, self._late
        return OrderStatus(
            self.falls,
            self.wrong,
            tuple(self._lately),
            math.sqrt(sum(error**2 for error in errors) / len(errors)) if errors else math.nan,
            sum(late) / len(late) if late else math.nan,
        )

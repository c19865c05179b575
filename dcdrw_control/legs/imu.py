"""Heel strikes from an inertial sensor on a foot or a shank, however it is mounted."""

import math
from collections import deque

from dcdrw_control.legs.either_way import BACKLOG_NS, EitherWay
from dcdrw_control.legs.events import SHORTEST_STANCE, STRIKE, Event
from dcdrw_control.legs.mounting import Direction, SagittalAxis, Vector
from dcdrw_msgs_py.samples import SECOND

IMPACT_NS = 60_000_000
"""After a strike, where its impact is looked for: the shock is seen some 10 to 40 ms after the rate turned round."""
MARGIN_NS = 10_000_000
"""The impact begins no earlier before the crossing."""
SMOOTH_NS = 100_000_000
"""Before a strike, the part of the swing that it is held against."""
SAME = math.cos(math.radians(45.0))
"""Cosine of the angle from which on an axis is another one: nearer to the one beside it."""
UNKNOWN: Vector = (math.nan, math.nan, math.nan)


class ImuDetector:
    """Angular rate and acceleration in, lifts and strikes out; nothing before the mounting is known."""

    def __init__(self) -> None:
        self._axis = SagittalAxis()
        self._direction = Direction()
        self._either = EitherWay()
        self._jumps: deque[tuple[int, float]] = deque()
        self._unjudged: deque[tuple[int, int]] = deque()
        self._learnt = UNKNOWN
        """The axis of which the direction is known."""
        self._recent: deque[tuple[int, Vector]] = deque()
        """Rates of as long as events are told late."""
        self._told_ns = -math.inf
        """The last event that was told."""
        self.reset()

    @property
    def mounted(self) -> bool:
        """Whether the mounting is known."""
        return self._direction.sign != 0

    def reset(self) -> None:
        """Go on after samples are missing; the mounting stays known."""
        self._stamp_ns: int | None = None
        self._acceleration = UNKNOWN
        self._jumps.clear()
        self._unjudged.clear()
        self._recent.clear()
        self._either.reset()

    def update(self, stamp_ns: int, rate: Vector, acceleration: Vector) -> list[Event]:
        """Take the next sample.

        Args:
            stamp_ns: when it was taken.
            rate: angular rate in the sensor's frame [rad/s].
            acceleration: in the sensor's frame; its unit does not matter.

        """
        last_ns, self._stamp_ns = self._stamp_ns, stamp_ns
        jump = math.dist(acceleration, self._acceleration)
        self._acceleration = acceleration
        if last_ns is None:
            return []
        self._jumps.append((stamp_ns, jump))
        self._axis.update(rate, (stamp_ns - last_ns) / SECOND)
        for sign, events in self._either.update(stamp_ns, self._axis.part(rate)).items():
            self._unjudged.extend((event.stamp_ns, sign) for event in events if event.kind == STRIKE)
        self._recent.append((stamp_ns, rate))
        while stamp_ns - self._recent[0][0] > BACKLOG_NS:
            self._recent.popleft()
        was_mounted = self.mounted
        self._judge(stamp_ns)
        if not was_mounted and self.mounted:
            self._look_back()
        elif was_mounted and abs(self._axis.part(self._learnt)) < SAME:
            self._direction = Direction()  # the sensor has slipped, or the first steps were not those of a walk
            self._unjudged.clear()
        events = [event for event in self._either.tell(self._direction.sign) if event.stamp_ns > self._told_ns]
        self._told_ns = max((event.stamp_ns for event in events), default=self._told_ns)
        return events

    def _look_back(self) -> None:
        """The mounting is known now, so look for the last events anew: until then, the axis was another one."""
        self._learnt = self._axis.axis
        self._told_ns += SHORTEST_STANCE * SECOND  # about another axis, the same event has another time
        self._either = EitherWay()
        for stamp_ns, rate in self._recent:
            self._either.update(stamp_ns, self._axis.part(rate))

    def _judge(self, now_ns: int) -> None:
        """Look at the strikes, of either sign, whose impact, if any, has come by now."""
        while self._unjudged and now_ns - self._unjudged[0][0] >= IMPACT_NS:
            stamp_ns, sign = self._unjudged.popleft()
            edge = stamp_ns - MARGIN_NS
            before = [jump for when, jump in self._jumps if edge - SMOOTH_NS <= when < edge]
            after = [jump for when, jump in self._jumps if edge <= when <= stamp_ns + IMPACT_NS]
            if before and after:
                self._direction.learn(sign, max(before), max(after))
                self._axis.forget()
        while self._jumps and now_ns - self._jumps[0][0] > SECOND:
            self._jumps.popleft()

"""Heel strikes from an inertial sensor on a foot or a shank, however it is mounted."""

import math
from collections import deque

from dcdrw_control.legs.either_way import EitherWay
from dcdrw_control.legs.events import STRIKE, Event
from dcdrw_control.legs.mounting import Direction, SagittalAxis, Vector
from dcdrw_msgs_py.samples import SECOND

IMPACT_NS = 60_000_000
"""After a strike, where its impact is looked for: the shock is seen some 10 to 40 ms after the rate turned round."""
MARGIN_NS = 10_000_000
"""The impact begins no earlier before the crossing."""
SMOOTH_NS = 100_000_000
"""Before a strike, the part of the swing that it is held against."""
UNKNOWN: Vector = (math.nan, math.nan, math.nan)


class ImuDetector:
    """Angular rate and acceleration in, lifts and strikes out; nothing before the mounting is known."""

    def __init__(self) -> None:
        self._axis = SagittalAxis()
        self._direction = Direction()
        self._either = EitherWay()
        self._jumps: deque[tuple[int, float]] = deque()
        self._unjudged: deque[tuple[int, int]] = deque()
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
        turning = self._axis.update(rate, (stamp_ns - last_ns) / SECOND)
        for sign, events in self._either.update(stamp_ns, turning).items():
            self._unjudged.extend((event.stamp_ns, sign) for event in events if event.kind == STRIKE)
        self._judge(stamp_ns)
        return self._either.tell(self._direction.sign)

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

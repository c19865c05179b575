"""Heel strikes from the angle of a hip, or of a thigh, whichever way round it is counted."""

import math
from collections import deque

from dcdrw_control.legs.either_way import EitherWay
from dcdrw_control.legs.events import STRIKE, Event
from dcdrw_msgs_py.samples import SECOND

SLOPE_NS = 40_000_000
"""Time over which the rate is taken that the source does not give: its middle is that of the rate."""
CLEAR = 1.15
"""How many times longer the legs swing back than forward, to be certain: in people it is about 1.5."""
ENOUGH = 2
"""Swings each way after which a hip that swings evenly is taken to count flexion positive."""


class HipDetector:
    """Hip angle in, lifts and strikes out: a thigh swings forward from the greatest extension to the greatest flexion.

    Flexion is the faster of the two, for the swing takes less time than the stance. The greatest flexion stands for
    the heel strike, as exoskeletons use it; the heel itself strikes up to 15 % of a stride later.
    """

    def __init__(self) -> None:
        self._either = EitherWay()
        self._durations: dict[int, list[float]] = {+1: [], -1: []}
        self._past: deque[tuple[int, float]] = deque()
        self.sign = 0
        """+1 where flexion is positive, −1 where it is negative, 0 while that is not known."""

    @property
    def mounted(self) -> bool:
        """Whether it is known which way round the angle counts."""
        return self.sign != 0

    def reset(self) -> None:
        """Go on after samples are missing; the sign stays known."""
        self._past.clear()
        self._either.reset()

    def update(self, stamp_ns: int, angle: float, rate: float = math.nan) -> list[Event]:
        """Take the next sample: angle [rad], and its rate [rad/s] where the source gives it."""
        if math.isnan(rate):
            past = self._past
            past.append((stamp_ns, angle))
            while len(past) > 2 and stamp_ns - past[1][0] >= SLOPE_NS:
                past.popleft()
            first_ns, first = past[0]
            if first_ns == stamp_ns:
                return []
            rate = (angle - first) / ((stamp_ns - first_ns) / SECOND)
            stamp_ns = (first_ns + stamp_ns) // 2
        for sign, events in self._either.update(stamp_ns, rate).items():
            if any(event.kind == STRIKE for event in events):
                self._durations[sign] = [*self._durations[sign][-3:], self._either.detectors[sign].last.seconds]
                self._judge()
        return self._either.tell(self.sign)

    def _judge(self) -> None:
        forward, backward = self._durations[+1], self._durations[-1]
        if not (forward and backward):
            return
        ratio = (sum(backward) / len(backward)) / (sum(forward) / len(forward))
        if abs(math.log(ratio)) > math.log(CLEAR):
            self.sign = 1 if ratio > 1.0 else -1
        elif not self.sign and min(len(forward), len(backward)) >= ENOUGH:
            self.sign = 1

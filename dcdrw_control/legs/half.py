"""One half of the quadruped, the person's or the robot's: its two legs as the spokes of a wheel."""

import math

from dcdrw_control.legs.phase import LegSample
from dcdrw_msgs_py.samples import SECOND, Turn

FASTEST = 15.0
"""A wheel turns no faster than this, for those that follow it to believe it: an early strike is caught up with within
some 10 ms [rad/s]."""
Side = int
LEFT, RIGHT = 0, 1


class Half:
    """Two legs, whose heel strikes are those of a rimless wheel: ψ = α + 2αj at the j-th, counted from 0.

    Between two strikes ψ goes as the leg does that is to strike next. A leg that strikes twice running, for the other
    stands, turns the wheel by a step each time.
    """

    def __init__(self, alpha: float) -> None:
        self._alpha = alpha
        self.steps = 0
        """Heel strikes so far, of both legs."""
        self._seen = [0, 0]
        self._next: Side = LEFT
        self._ahead = math.nan
        self._last_ns = 0
        self._psi = -math.inf

    def update(self, stamp_ns: int, legs: tuple[LegSample | None, LegSample | None]) -> Turn | None:
        """The wheel's rotation ψ and its rate from both legs, at one time; None while either leg is unknown.

        Args:
            stamp_ns: the time.
            legs: left and right; None where its phase is unknown.

        """
        for side, leg in enumerate(legs):
            if leg and leg.strikes > self._seen[side]:
                self.steps += leg.strikes - self._seen[side]
                self._seen[side] = leg.strikes
                self._next = 1 - side
                other = legs[self._next]
                self._ahead = other.remaining if other else math.nan
        leg = legs[self._next]
        if None in legs or leg is None:
            self._ahead = math.nan  # how far it has come since is unknown: with the next strike it is known again
        if leg is None or math.isnan(self._ahead):
            return None
        pitch = 2.0 * self._alpha
        goal = psi = self._alpha + pitch * (self.steps - leg.remaining / self._ahead)
        if math.isfinite(self._psi) and stamp_ns >= self._last_ns:  # else the source has started anew
            psi = min(max(goal, self._psi), self._psi + FASTEST * (stamp_ns - self._last_ns) / SECOND)
        rate = pitch * leg.rate / self._ahead if goal >= self._psi else 0.0
        self._last_ns, self._psi = stamp_ns, psi
        return Turn(psi, rate)

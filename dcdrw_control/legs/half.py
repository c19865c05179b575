"""One half of the quadruped, the person's or the robot's: its two legs as the spokes of a wheel."""

import math

from dcdrw_control.legs.phase import LegSample
from dcdrw_msgs_py.samples import Turn

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
        self._progress = 0.0

    def update(self, legs: tuple[LegSample | None, LegSample | None]) -> Turn | None:
        """The wheel's rotation ψ and its rate from both legs, at one time; None while either leg is unknown.

        Args:
            legs: left and right; None where its phase is unknown.

        """
        for side, leg in enumerate(legs):
            if leg and leg.strikes > self._seen[side]:
                self.steps += leg.strikes - self._seen[side]
                self._seen[side] = leg.strikes
                self._next = 1 - side
                other = legs[self._next]
                self._ahead = other.remaining if other else math.nan
                self._progress = 0.0
        leg = legs[self._next]
        if None in legs or leg is None:
            self._ahead = math.nan  # how far it has come since is unknown: with the next strike it is known again
        if leg is None or math.isnan(self._ahead):
            return None
        progress = 1.0 - leg.remaining / self._ahead
        rate = leg.rate / self._ahead if progress >= self._progress else 0.0
        self._progress = max(progress, self._progress)
        pitch = 2.0 * self._alpha
        return Turn(self._alpha + pitch * (self.steps - 1 + self._progress), pitch * rate)

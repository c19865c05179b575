"""One wheel's rotation: made continuous, cut into steps, and its speed (contract §1). Knows nothing of messages."""

import math
from collections import deque
from typing import NamedTuple

PACE_MEMORY = 1.0
"""Time over which the mean speed is taken [s]."""
SLOPE_WINDOW_NS = 50_000_000
"""Time over which a speed is taken that the source does not give."""


class Tolerance(NamedTuple):
    """How far a sample may be from the truth."""

    hysteresis: float
    """A strike counts back only when the rotation recedes by more than this [rad]."""
    max_speed: float
    """The fastest that the wheel can turn [rad/s]."""


class Strike(NamedTuple):
    """A spoke has come down."""

    stamp_ns: int
    """Interpolated between the samples on either side."""
    steps: int
    """n_i after the strike."""


class Rotation:
    """Follows one wheel from sample to sample.

    A strike counts at the first sample at or past the boundary between two spokes, so without lag, and counts
    back only beyond the hysteresis: noise never counts twice. A backward strike is the same, mirrored. A wheel
    that starts less than half the hysteresis before a boundary has just struck, as in the standard start of a trial
    (ψ = −α) with noise.
    """

    def __init__(self, alpha: float, stamp_ns: int, angle: float, rate: float, tolerance: Tolerance) -> None:
        self.alpha = alpha
        self.pitch = 2.0 * alpha
        self.psi = angle
        """ψ, continuous [rad]."""
        self.rate = rate
        """ψ̇ [rad/s]; NaN where it is not known yet."""
        self.pace = 0.0 if math.isnan(rate) else rate
        """Mean speed of the last second [rad/s]."""
        self.speed = abs(self.pace)
        """The fastest that the wheel has turned of late [rad/s]."""
        self._highest = math.nextafter(alpha, 0.0)
        self._stamp_ns = stamp_ns
        self._raw = angle
        self._turns = 0
        self._wraps: bool | None = False if abs(angle) > math.tau + self.pitch else None
        self._past = deque([(stamp_ns, angle)])
        self._cell = self._first_cell = math.floor((angle + alpha + 0.5 * tolerance.hysteresis) / self.pitch)
        self.steps = 0
        """n_i, since the start."""
        self._low, self._high = self._boundaries()
        self._backward_at = self._low
        if angle < self._low + tolerance.hysteresis:
            self._backward_at -= tolerance.hysteresis
        self._forward_at = self._high

    @property
    def theta(self) -> float:
        """θ_i, consistent with n_i, in [−α, α) [rad]."""
        theta = self.psi - self._cell * self.pitch
        if -self.alpha <= theta < self.alpha:
            return theta
        return -self.alpha if theta < 0.0 else self._highest

    def may_step(self, dt: float) -> bool:
        """Whether the wheel may take a whole step in this time [s]."""
        return self.speed * dt >= self.pitch

    def continued(self, angle: float, dt: float, tolerance: Tolerance) -> float | None:
        """The rotation ψ that a raw angle means, dt seconds on; None where no wheel gets there.

        A wheel turns at most at `max_speed`, over a longer time at most at twice its pace and a step more, and
        rocks back by a step at most. An angle out of this reach has wrapped, unless the source is known not to
        wrap, or was silent for so long that it may as well have started anew. Over a silence, a source that is
        known to wrap is taken to have kept its pace. So an unbounded rotation stays what it is, through any gap.
        """
        moved = angle - self._raw
        slack = 2.0 * tolerance.hysteresis
        if not self._wraps and -slack <= moved <= slack:  # in reach of any wheel: the rule, at a fast rate
            return angle + math.tau * self._turns
        fastest = tolerance.max_speed * dt
        along = min(fastest, 2.0 * self.speed * dt + self.pitch) + slack
        against = min(fastest, self.pitch) + slack
        low, high = (-against, along) if self.pace >= 0.0 else (-along, against)
        turns = self._turns
        if self._wraps or (self._wraps is None and not low <= moved <= high and not self.may_step(dt)):
            wraps = round((moved - self.pace * dt) / math.tau)
            turns, moved = turns - wraps, moved - math.tau * wraps
        return angle + math.tau * turns if low <= moved <= high else None

    def advance(self, stamp_ns: int, angle: float, psi: float, rate: float, tolerance: Tolerance) -> list[Strike]:
        """Move on to a rotation ψ that `continued` has found; return the strikes on the way there."""
        elapsed_ns = stamp_ns - self._stamp_ns
        dt = elapsed_ns * 1e-9
        moved = psi - self.psi
        if abs(angle - self._raw - moved) > math.pi:
            self._wraps = True
        elif abs(angle) > math.tau + self.pitch:
            self._wraps = False
        strikes = self._strikes(elapsed_ns, psi, tolerance.hysteresis)
        self.rate = self._slope(stamp_ns, psi, moved / dt, strikes) if math.isnan(rate) else rate
        self.pace += (moved - self.pace * dt) / (dt if dt > PACE_MEMORY else PACE_MEMORY)
        self.speed = max(abs(self.pace), abs(self.rate))  # the pace where the rate is NaN
        self.psi, self._raw, self._stamp_ns = psi, angle, stamp_ns
        self._turns = round((psi - angle) / math.tau) if psi != angle else 0
        return strikes

    def _strikes(self, elapsed_ns: int, psi: float, hysteresis: float) -> list[Strike]:
        strikes: list[Strike] = []
        while not self._backward_at <= psi < self._forward_at:
            forward = psi >= self._forward_at
            crossed = self._high if forward else self._low
            self._cell += 1 if forward else -1
            self.steps = self._cell - self._first_cell
            share = min(max((crossed - self.psi) / (psi - self.psi), 0.0), 1.0)
            strikes.append(Strike(self._stamp_ns + round(share * elapsed_ns), self.steps))
            self._low, self._high = self._boundaries()
            self._backward_at = self._low - hysteresis if forward else self._low
            self._forward_at = self._high if forward else self._high + hysteresis
        if psi >= self._low + hysteresis:
            self._backward_at = self._low
        if psi <= self._high - hysteresis:
            self._forward_at = self._high
        return strikes

    def _boundaries(self) -> tuple[float, float]:
        low = self._cell * self.pitch - self.alpha
        return low, low + self.pitch

    def _slope(self, stamp_ns: int, psi: float, last_slope: float, strikes: list[Strike]) -> float:
        """The mean speed of a short window that reaches back to the last strike at most: a strike changes it."""
        past = self._past
        if strikes:
            past.clear()
        elif past:
            while len(past) > 1 and stamp_ns - past[0][0] > SLOPE_WINDOW_NS:
                past.popleft()
            last_slope = (psi - past[0][1]) / ((stamp_ns - past[0][0]) * 1e-9)
        past.append((stamp_ns, psi))
        return last_slope

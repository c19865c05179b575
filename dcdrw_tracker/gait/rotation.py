"""One wheel's rotation: made continuous, cut into steps, and its speed (contract §1). Knows nothing of messages."""

import math
from collections import deque
from typing import NamedTuple

from dcdrw_msgs_py.rolling import stance
from dcdrw_tracker.gait.resolution import common_divisor

PACE_MEMORY = 1.0
"""Time over which the mean speed is taken [s]."""
SLOPE_WINDOW_NS = 50_000_000
"""Time over which a speed is taken that the source does not give."""
LEAST_SLOPE_NS = 4_000_000
"""Over a shorter time a speed is none: samples of a burst are stamped as they arrive, one right after the other."""
QUICKEST = 20.0
"""No wheel gathers speed faster: twice what gravity gives one that falls [rad/s²]."""
LEAST_COUNT = 1e-6
"""A finer encoder is none: rotations that are no multiples of a count [rad]."""
LEAST_PACE = 0.05
"""A wheel that is slower does not tell whether the speeds that its source gives are right [rad/s]."""
LEARNING = 500
"""Samples of a moving wheel from which the count is learned."""
PROOF = 4
"""So many moves on must be multiples of a count before it tells how far a counter reaches."""
LEAST_WIDTH = 1e-3
"""Less is rounding, and no counter that rolls over [rad]."""
WILD = 7.0
"""So many times as far off as usual is a rotation that is wild."""
FINEST = 0.1
"""Nor is one wild that is less off than this share of the hysteresis."""
FEWEST_USUAL, MOST_USUAL = 3, 50
"""Samples from which it is told how far off rotations usually are: how much the hysteresis counts, and how many do."""
FEWEST_BITS = 8
"""No counter of an encoder rolls over after fewer counts than two to this power."""


class Tolerance(NamedTuple):
    """How far a sample may be from the truth."""

    hysteresis: float
    """A strike counts back only when the rotation recedes by more than this [rad]."""
    max_speed: float
    """The fastest that the wheel can turn [rad/s]."""
    rollover: float = math.nan
    """Jump of the rotation where the source's counter rolls over [rad]; NaN where that is not known."""


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

    def __init__(
        self, alpha: float, stamp_ns: int, angle: float, rate: float, tolerance: Tolerance, zero: float = 0.0
    ) -> None:
        self.alpha = alpha
        self.pitch = 2.0 * alpha
        self._raw = self._first = angle
        # A counter that counts up from 0 has rolled back over it where it stands in its upper half.
        width = tolerance.rollover
        self._offset = -zero - (0.0 if math.isnan(width) else width * round(angle / width))
        """What the source lost as it wrapped or its counter rolled over, less its zero: ψ minus the raw angle [rad]."""
        self.psi = angle = angle + self._offset
        """ψ, continuous [rad]."""
        self.rate = rate
        """ψ̇ [rad/s]; NaN where it is not known yet."""
        self.pace = 0.0 if math.isnan(rate) else rate
        """Mean speed of the last second [rad/s]."""
        self._told = self.pace
        """What the mean speed would be by the speeds that the source gives [rad/s]."""
        self._doubted = 0.0
        """For how long these two have contradicted one another [s]."""
        self.disbelieved = 0
        """Samples whose speed does not go with the rotations, and is not used."""
        self.speed = abs(self.pace)
        """The fastest that the wheel has turned of late [rad/s]."""
        self._highest = math.nextafter(alpha, 0.0)
        self._stamp_ns = stamp_ns
        self._unlearned = LEARNING
        self._count = math.inf
        """Angle of one count of the source's encoder; infinite before the wheel has turned, 0 where there is none."""
        self._proof = 0
        """Moves since that count was found."""
        self._width = math.nan
        """By how much the source's counter was seen to roll over [rad]; NaN where it was not yet."""
        self._usual = tolerance.hysteresis
        """How far rotations are off, in the mean, from where the speed takes the wheel [rad]."""
        self._of = FEWEST_USUAL
        self.rollovers = 0
        """How often the source's counter has rolled over."""
        self.is_zero_known = True
        """False where the counter may have rolled over before the start, so that it is not known where ψ is 0."""
        self._wraps: bool | None = False if abs(self._raw) > math.tau + self.pitch else None
        self._past = deque([(stamp_ns, angle)])
        self._since_strike = 1
        self._cell = self._first_cell = int(stance(alpha, angle + 0.5 * tolerance.hysteresis)[0])
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

    @property
    def wraps(self) -> bool:
        """Whether the source is known to give rotations within one turn."""
        return bool(self._wraps)

    @property
    def may_wrap(self) -> bool:
        """Whether the source may give rotations within one turn, for all that is known."""
        return self._wraps is not False

    def is_at(self, angle: float, dt: float, tolerance: Tolerance) -> bool:
        """Whether a raw angle is where the pace takes the wheel within dt seconds, half of that more or less."""
        moved = angle - self._raw
        if self._wraps:
            moved = math.remainder(moved, math.tau)
        along = self.pace * dt
        return abs(moved - along) <= 2.0 * tolerance.hysteresis + abs(along)

    def may_step(self, dt: float) -> bool:
        """Whether the wheel may take a whole step in this time [s]."""
        return self.speed * dt >= self.pitch

    def continued(self, angle: float, dt: float, tolerance: Tolerance) -> float | None:
        """The rotation ψ that a raw angle means, dt seconds on; None where no wheel gets there.

        A wheel turns at most at `max_speed`, over a longer time at most at twice its pace and as far as it gathers
        speed, from a quarter of a step to a whole one, and rocks back by as much. An angle out of this reach has
        wrapped, unless the source is known not to wrap, or was silent for so long that it may as well have started
        anew. Over a silence, a source that is known to wrap is taken to have kept its pace. So an unbounded rotation
        stays what it is, through any gap.
        """
        moved = angle - self._raw
        slack = 2.0 * tolerance.hysteresis
        if not self._wraps and -slack <= moved <= slack:  # in reach of any wheel: the rule, at a fast rate
            return angle + self._offset
        fastest = tolerance.max_speed * dt + slack
        more = min(max(0.5 * self.alpha, slack) + 0.5 * QUICKEST * dt * dt, self.pitch + slack)
        along = min(fastest, 2.0 * self.speed * dt + more)
        against = min(fastest, more)
        low, high = (-against, along) if self.pace >= 0.0 else (-along, against)
        lost = 0.0
        whole = -math.tau * round((moved - self.pace * dt) / math.tau)
        if self._wraps:
            lost = whole
        elif not low <= moved <= high and not self.may_step(dt):
            lost = self._rolled_over(angle, dt, tolerance)
            is_exact = not math.isnan(tolerance.rollover) or 0.0 < self._count < math.inf
            if not lost and self._wraps is None and not is_exact:
                lost = whole
        return angle + (self._offset + lost) if low <= moved + lost <= high else None

    def is_wild(self, psi: float, dt: float, tolerance: Tolerance) -> bool:
        """Whether a rotation is far off, dt seconds on: by more than a change of speed, noise or counts explain."""
        moved = psi - self.psi
        off = abs(moved - self.rate * dt)
        usual, of = self._usual, self._of
        if of < MOST_USUAL:
            self._of = of + 1
        if off <= FINEST * tolerance.hysteresis:  # the rule, at a fast rate
            self._usual = usual + (off - usual) / of
            return False
        if math.isnan(off):
            return False
        # Just after a strike the rate is that of two noisy samples.
        off = min(off, abs(moved - self.pace * dt))
        bound = self._off_at_most(dt, tolerance)
        self._usual = usual + (min(off, 4.0 * usual) - usual) / of
        return off > bound

    def are_in_line(self, psi: float, dt: float, later_psi: float, later_dt: float, tolerance: Tolerance) -> bool:
        """Whether two wild rotations go with each other: the wheel jumped and goes on, or has another speed."""
        moved, between = later_psi - psi, later_dt - dt
        off = min(abs(moved - self.rate * between), abs(moved - (psi - self.psi) / dt * between))
        return off <= self._off_at_most(between, tolerance)

    def _off_at_most(self, dt: float, tolerance: Tolerance) -> float:
        """How far noise, the counts of an encoder, and a change of speed, also by a strike, carry a rotation [rad]."""
        count = self._count if self._count < math.inf else 0.0
        changed = 0.5 * abs(self.rate) * dt + 0.5 * QUICKEST * dt * dt
        return max(WILD * self._usual, FINEST * tolerance.hysteresis, 2.0 * count) + changed

    def _rolled_over(self, angle: float, dt: float, tolerance: Tolerance) -> float:
        """What a counter has lost that rolled over: whole turns, 2ᵏ counts, or all from one end to the other; or 0.

        A counter that rolls over jumps against the motion, and goes on where the motion takes it; one whose width is
        known may jump back again.
        """
        moved, along = angle - self._raw, self.pace * dt
        jump = moved - along
        slack = 2.0 * tolerance.hysteresis + 0.5 * abs(along)
        known = self._width if math.isnan(tolerance.rollover) else tolerance.rollover
        if math.isnan(known) and jump * along >= 0.0:
            return 0.0
        for width in self._widths(abs(jump)) if math.isnan(known) else (known,):
            if width and abs(abs(jump) - width) <= slack:
                return math.copysign(width, -jump)
        from_end_to_end = math.isnan(known) and abs(jump) > math.tau and abs(angle + self._raw) <= slack
        return -jump if from_end_to_end else 0.0

    def _widths(self, jump: float) -> tuple[float, float]:
        """The whole turns and the counter that may have jumped so far; 0 where there is none."""
        return math.tau * round(jump / math.tau), self._counter(jump)

    def _counter(self, jump: float) -> float:
        """How far a counter of 2ᵏ counts reaches that may have jumped so far [rad]; 0 where there is none."""
        counts = jump / self._count if self._count and self._proof >= PROOF else 0.0
        bits = round(math.log2(counts)) if counts >= 1.0 else 0
        return self._count * 2.0**bits if bits >= FEWEST_BITS else 0.0

    def advance(
        self, stamp_ns: int, angle: float, psi: float, rate: float, tolerance: Tolerance, burst: int = 1
    ) -> list[Strike]:
        """Move on to a rotation ψ that `continued` has found; return the strikes on the way there.

        Where the source gives no rate, it is the slope over a time in which whole bursts arrived.
        """
        elapsed_ns = stamp_ns - self._stamp_ns
        dt = elapsed_ns * 1e-9
        moved = psi - self.psi
        turned = angle - self._raw
        lost = moved - turned
        if abs(lost) > LEAST_WIDTH:
            within = max(abs(angle), abs(self._raw)) <= math.tau + self.pitch
            self._wraps = within and abs(math.remainder(lost, math.tau)) < 1e-6
            if not self._wraps:
                self.rollovers += 1
                fits = (width for width in self._widths(abs(lost)) if abs(abs(lost) - width) < 1e-6)
                self._width = next(fits, math.nan)
                steps = lost / self.pitch
                if math.isnan(tolerance.rollover) and abs(steps - round(steps)) > 1e-3:
                    self.is_zero_known &= abs(self._first) <= 0.5 * abs(lost)
            turns = round((psi - angle) / math.tau)
            whole = abs(psi - angle - turns * math.tau) < 1e-6
            self._offset = math.tau * turns if whole else psi - angle
        elif abs(angle) > math.tau + self.pitch:
            self._wraps = False
        if turned and self._unlearned:
            self._unlearned -= 1
            count = common_divisor(self._count, abs(turned), LEAST_COUNT)
            self._proof = self._proof + 1 if math.isclose(count, self._count, rel_tol=0.01) else 0
            self._count = count
        strikes = self._strikes(elapsed_ns, psi, tolerance.hysteresis)
        memory = dt if dt > PACE_MEMORY else PACE_MEMORY
        self.pace += (moved - self.pace * dt) / memory
        slope = self._slope(stamp_ns, psi, bool(strikes), burst)
        if math.isnan(rate):
            rate = slope
        else:
            self._told += (rate - self._told) * dt / memory
            agrees = abs(self._told - self.pace) <= 0.5 * max(abs(self.pace), LEAST_PACE)
            # A wheel that is let go within a gap has not turned as far as its speed tells: that passes within a second.
            self._doubted = 0.0 if agrees else self._doubted + min(dt, 0.1 * PACE_MEMORY)
            is_empty = rate == 0.0 and abs(slope) > LEAST_PACE
            if is_empty or self._doubted > PACE_MEMORY:  # in other units, say
                self.disbelieved += 1
                rate = slope
        self.rate = rate
        self.speed = abs(self.pace) if math.isnan(self.rate) else max(abs(self.pace), abs(self.rate))
        self.psi, self._raw, self._stamp_ns = psi, angle, stamp_ns
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

    def _slope(self, stamp_ns: int, psi: float, struck: bool, burst: int) -> float:
        """The mean speed of a short window, as soon as may be after the last strike, which changes it."""
        past = self._past
        while len(past) > burst and stamp_ns - past[0][0] > SLOPE_WINDOW_NS:
            past.popleft()
        count = len(past)
        since = 0 if struck else min(self._since_strike, count)
        self._since_strike = since + 1
        slope = math.nan
        for back in (since, count):
            back -= back % burst
            if back:
                then_ns, then = past[count - back]
                if stamp_ns - then_ns >= LEAST_SLOPE_NS:
                    slope = (psi - then) / ((stamp_ns - then_ns) * 1e-9)
                    break
        past.append((stamp_ns, psi))
        return slope

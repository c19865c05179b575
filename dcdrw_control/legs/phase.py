"""The phase of one leg: 0 at heel strike, 1 at the next, from its lifts and strikes."""

import math
from typing import NamedTuple

from dcdrw_control.legs.events import SHORTEST_STANCE, SHORTEST_SWING, STRIKE, Event
from dcdrw_msgs_py.samples import SECOND

STANCE_SHARE = 0.62
"""Share of a stride that the foot stands, before a stance was seen: 60 to 62 % at any usual speed (Perry 1992)."""
VARIABILITY = 0.02
"""Standard deviation of stance and of swing from stride to stride, share of a stride: of both together, it is 2 to 3 %
in healthy walking (Hausdorff 1995)."""
STANDING = 1.3
"""A stance that lasts longer than this many usual ones is standing still: the phase rests until the foot lifts."""
MISSED = 0.15
"""A strike that is overdue by more than this share of a stride was missed; it is far beyond all variability."""
SURE = 3
"""Swings seen before one can be overdue: the first steps of a walk are shorter than the others."""
BOUNCE = 0.3
"""Share of the usual stance before which no foot lifts again: its strike has doubled."""
MEMORY = 0.4
"""Weight of the last stride in the usual durations: a new cadence is followed within three strides."""
SUDDEN = 1.5
"""A duration counts as at most this many times longer or shorter than usual."""
PAUSE = 2.5
"""A stance that was this many times longer than usual tells nothing of those to come."""


class LegSample(NamedTuple):
    """Where a leg is in its gait cycle."""

    strides: float
    """Strides since its first heel strike: whole at each heel strike, and never falling."""
    rate: float
    """Strides per second, as the stride under way is foretold; 0 while the leg rests."""
    strikes: int
    """Heel strikes so far."""

    @property
    def remaining(self) -> float:
        """What is left of the stride under way, in (0, 1]."""
        return self.strikes - self.strides


class LegPhase:
    """Foretells when the stride under way will end: the stance seen, or usual, and the usual swing.

    With the time t since the heel strike and the time r that remains, the phase is t / (t + r). An event that comes
    early moves the phase on at once; one that is overdue lets it slow down, so that it reaches 1 at the next heel
    strike and not before. A foot that stands on is standing still, and its phase rests.
    """

    def __init__(self) -> None:
        self.strikes = 0
        """Heel strikes, with the missed ones."""
        self.missed = 0
        self.doubled = 0
        self._stance = _Usual()
        self._swing = _Usual()
        self.lose()

    def lose(self) -> None:
        """The sensor was silent: the phase is unknown until the next strike."""
        self._strike_ns: int | None = None
        self._lift_ns: int | None = None
        self._assumed: tuple[int | None, int | None] | None = None
        self._bounce: _Bounce | None = None
        self._before = -math.inf

    @property
    def _usual_swing(self) -> float:
        return self._swing.seconds

    @property
    def _usual_stance(self) -> float:
        return self._stance.seconds if self._stance.seen else self._swing.seconds * STANCE_SHARE / (1.0 - STANCE_SHARE)

    @property
    def period(self) -> float:
        """The usual stride [s]; NaN before one was seen."""
        return self._usual_stance + self._usual_swing

    @property
    def known(self) -> bool:
        """Whether the phase is known."""
        return self._strike_ns is not None and not math.isnan(self.period)

    def take(self, event: Event) -> bool:
        """Take an event, in the order of time; whether it counts as a heel strike."""
        return self._strike(event.stamp_ns) if event.kind == STRIKE else self._lift(event.stamp_ns)

    def _lift(self, stamp_ns: int) -> bool:
        if self._bounce and self._since(self._bounce.touch_ns, stamp_ns) < SHORTEST_STANCE:
            self._lift_ns = self._bounce.lift_ns  # it has been in the air all the time
        elif self._lift_ns is None and not self._since(self._strike_ns, stamp_ns) < BOUNCE * self._usual_stance:
            self._lift_ns = stamp_ns
        self._bounce = None
        return False

    def _strike(self, stamp_ns: int) -> bool:
        since = self._since(self._strike_ns, stamp_ns)
        if self._assumed and since < BOUNCE * self.period:  # late, after all, and not missed
            self._strike_ns, self._lift_ns = self._assumed
            self.strikes, self.missed = self.strikes - 1, self.missed - 1
        bounced = self._since(self._lift_ns, stamp_ns) < SHORTEST_SWING
        unlifted = self._strike_ns is not None and self._lift_ns is None and self._assumed is None
        if bounced or unlifted:
            self._bounce = _Bounce(self._lift_ns, stamp_ns) if self._lift_ns is not None else None
            self._lift_ns = None
            self.doubled += 1
            return False
        self._learn(stamp_ns)
        self._strike_ns, self._lift_ns, self._assumed = stamp_ns, None, None
        self.strikes += 1
        return True

    def _learn(self, stamp_ns: int) -> None:
        """The stance and swing that end now make the usual ones."""
        swing = self._since(self._lift_ns, stamp_ns)
        if math.isnan(swing):
            return
        self._swing.learn(swing)
        stance = self._since(self._strike_ns, stamp_ns) - swing
        if stance < PAUSE * self._usual_stance:
            self._stance.learn(stance)

    def at(self, stamp_ns: int) -> LegSample | None:
        """The phase at a time no earlier than the last event's; None while it is not known."""
        if self._strike_ns is None or not self.known:
            return None
        self._assume(stamp_ns)
        deviation = VARIABILITY * self.period
        since = self._since(self._strike_ns, stamp_ns)
        limit = STANDING * self._usual_stance
        if self._lift_ns is None:
            passed = min(since, limit)
            due = self._usual_stance - passed
            after = self._usual_swing
        else:
            swing = self._since(self._lift_ns, stamp_ns)
            passed = min(since - swing, limit) + swing
            due = self._usual_swing - swing
            after = 0.0
        total = passed + _remaining(due, deviation) + after
        phase = self.strikes - 1 + passed / total
        if phase <= self._before:
            return LegSample(self._before, 0.0, self.strikes)
        self._before = phase
        return LegSample(phase, _unfinished(due, deviation) / total, self.strikes)

    def _assume(self, stamp_ns: int) -> None:
        """Go on without a strike that was missed, once."""
        if self._lift_ns is None or self._assumed is not None or self._swing.seen < SURE:
            return
        due_ns = self._lift_ns + round(self._usual_swing * SECOND)
        if self._since(due_ns, stamp_ns) > MISSED * self.period:
            self._assumed = self._strike_ns, self._lift_ns
            self._strike_ns, self._lift_ns = due_ns, None
            self.strikes += 1
            self.missed += 1

    @staticmethod
    def _since(start_ns: int | None, stamp_ns: int) -> float:
        return math.nan if start_ns is None else (stamp_ns - start_ns) / SECOND


class _Bounce(NamedTuple):
    """A short touch of the ground."""

    lift_ns: int
    touch_ns: int


class _Usual:
    """What a duration usually is: the mean of the first ones, then a fading one."""

    def __init__(self) -> None:
        self.seconds = math.nan
        self.seen = 0

    def learn(self, seconds: float) -> None:
        self.seen += 1
        if self.seen == 1:
            self.seconds = seconds
        else:
            ratio = min(max(seconds / self.seconds, 1.0 / SUDDEN), SUDDEN)
            self.seconds *= ratio ** max(MEMORY, 1.0 / self.seen)


def _remaining(due: float, deviation: float) -> float:
    """Time that remains of a duration which has not ended, where it usually ends in `due` [s].

    The mean of a normal distribution about `due`, cut off at zero: `due` itself while that is long, and less and less,
    but never none, when the end is overdue.
    """
    z = max(due / deviation, -8.0)
    return deviation * (z + math.sqrt(2.0 / math.pi) * math.exp(-0.5 * z * z) / math.erfc(-z / math.sqrt(2.0)))


def _unfinished(due: float, deviation: float) -> float:
    """Share of the usual pace at which it goes on: 1, and from the usual end on soon 0."""
    return 0.5 * math.erfc(-(due / deviation + 2.0) / math.sqrt(2.0))

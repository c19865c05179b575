"""Heel strikes from a foot's contact, and from its vertical force."""

import math

from dcdrw_control.legs.events import LIFT, STRIKE, Event, crossing_ns

LOADED = 0.05
"""Share of the usual peak force from which a foot counts as standing: 20 to 50 N of a person's 1 kN are customary."""
UNLOADED = 0.03
"""Share below which it counts as lifted."""
LEAST_LOAD = 20.0
"""A force below this loads no foot: it is within the noise of plates and insoles [N]."""
LARGEST_OFFSET = 0.1
"""What a sensor shows without load is at most this share of the peak; a foot that always shows more is standing."""
MEMORY = 0.2
"""Weight of the last stance in the usual peak, and of the last swing in the offset."""


class ContactDetector:
    """Turns contacts of a foot with the ground into lifts and strikes: every change is one, bounces too."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Go on after samples are missing."""
        self._touches: bool | None = None

    def update(self, stamp_ns: int, touches: bool) -> list[Event]:
        """Take the next sample: when it was taken, or the change in it came about, and whether the foot touches."""
        last, self._touches = self._touches, touches
        if last is None or last is touches:
            return []
        return [Event(STRIKE if touches else LIFT, stamp_ns)]


class ForceDetector:
    """Turns a foot's vertical force into lifts and strikes, whatever its sign, its offset and the person's weight."""

    def __init__(self) -> None:
        self._contact = ContactDetector()
        self._peaks = _Level()
        self._offsets = _Level()
        self.reset()

    def reset(self) -> None:
        """Go on after samples are missing; the usual forces stay known."""
        self._contact.reset()
        self._stamp_ns: int | None = None
        self._load = math.nan
        self._touches: bool | None = None
        self._highest = 0.0
        self._unloaded, self._count = 0.0, 0

    def update(self, stamp_ns: int, force: float) -> list[Event]:
        """Take the next sample [ns, N]; the events that it makes certain."""
        load, (last_ns, last) = abs(force), (self._stamp_ns, self._load)
        self._stamp_ns, self._load = stamp_ns, load
        self._highest = max(self._highest, load)
        level = self._level(load)
        touches = load > level
        changed = touches is not self._touches
        self._touches = touches
        if not touches:
            self._unloaded, self._count = self._unloaded + load, self._count + 1
        if not changed or last_ns is None:
            return self._contact.update(stamp_ns, touches)
        if touches:
            self._offsets.learn(self._unloaded / self._count)
            self._unloaded, self._count = 0.0, 0
        elif self._highest > 0.5 * self._peaks.usual(self._highest):  # else it was not a stance
            self._peaks.learn(self._highest)
            self._highest = load
        return self._contact.update(crossing_ns(last_ns, last, stamp_ns, load, level), touches)

    def _level(self, load: float) -> float:
        """The force that tells whether the foot stands [N]."""
        peak = max(self._peaks.usual(self._highest), self._highest)
        offset = self._offsets.usual(self._unloaded / self._count if self._count else load)
        offset = min(offset, LARGEST_OFFSET * peak)
        return offset + (UNLOADED if self._touches else LOADED) * max(peak - offset, LEAST_LOAD / LOADED)


class _Level:
    """What a level usually is."""

    def __init__(self) -> None:
        self._value = math.nan

    def usual(self, now: float) -> float:
        """The usual level; before one was learned, that of now."""
        return now if math.isnan(self._value) else self._value

    def learn(self, value: float) -> None:
        """Take the level of one stance or swing."""
        self._value = self.usual(value) + MEMORY * (value - self.usual(value))

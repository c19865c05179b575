"""Swings of a leg, from the sagittal angular rate of its foot, shank or thigh."""

from typing import NamedTuple

from dcdrw_control.legs.events import LIFT, SHORTEST_SWING, STRIKE, Event, crossing_ns
from dcdrw_msgs_py.samples import SECOND

FIRST_SWING = 0.8
"""Angle that a swing is taken to turn by before one was seen [rad]: foot, shank and thigh turn by 40 to 70 degrees."""
FIRST_PEAK = 4.0
"""Peak rate, likewise [rad/s]: 200 to 400 degrees per second are usual."""
SMALLEST_SWING = 0.2
"""Share of the usual angle from which a turn counts as a swing: the shortest steps, of a turn on the spot, are longer;
the slap of the foot after heel strike turns by less. After a push-off of as much, a swing counts from its start."""
FULL_SWING = 0.6
"""Share of the usual angle from which a swing ends as soon as the rate turns round; a shorter one may just dip."""
QUIET = 0.1
"""Share of the usual peak rate within which a rate is noise, or sway of a foot that stands."""
LANDED = 0.06
"""A rate that stays quiet for so long ends a swing, though it never turned round: the foot came down flat [s]."""
MEMORY = 0.2
"""Weight of the last swing in the usual one."""


class Swing(NamedTuple):
    """One swing that has ended."""

    angle: float
    """Angle by which the segment has turned forward [rad]."""
    peak: float
    """Largest rate [rad/s]."""
    seconds: float


class SwingDetector:
    """Finds lift and strike where the rate of a segment, positive in swing, crosses zero.

    In swing a foot turns toe up and a shank or thigh forward; both start when the rate turns positive (toe off) and
    end when it turns negative (heel strike): Sabatini et al. 2005 for the foot, Aminian et al. 2002 for the shank.
    A strike counts once the rate has left the noise on the other side, so that a dip within a swing does not end it.
    """

    def __init__(self) -> None:
        self.usual_angle = FIRST_SWING
        self.usual_peak = FIRST_PEAK
        self.last = Swing(0.0, 0.0, 0.0)
        """The last swing that ended in a strike."""
        self._seen = 0
        self.reset()

    def reset(self) -> None:
        """Forget the swing that goes on: samples are missing."""
        self._stamp_ns: int | None = None
        self._rate = 0.0
        self._push_off = 0.0
        self._rest()

    def _rest(self) -> None:
        self._lift_ns: int | None = None
        self._told = self._pushed_off = False
        self._angle = self._peak = 0.0
        self._landing_ns: int | None = None

    def update(self, stamp_ns: int, rate: float) -> list[Event]:
        """Take the next sample [ns, rad/s]; the events that it makes certain."""
        last_ns, last = self._stamp_ns, self._rate
        self._stamp_ns, self._rate = stamp_ns, rate
        if last_ns is None:
            return []
        noise = QUIET * self.usual_peak
        if last <= 0.0 < rate and (self._lift_ns is None or self._peak <= noise):
            self._rest()
            self._lift_ns = crossing_ns(last_ns, last, stamp_ns, rate)
            self._pushed_off = self._push_off >= SMALLEST_SWING * self.usual_angle
        turned = 0.5 * (last + rate) * (stamp_ns - last_ns) / SECOND
        self._push_off = self._push_off - turned if rate <= 0.0 else 0.0
        if self._lift_ns is None:
            return []
        if rate > 0.0:
            self._angle += max(turned, 0.0)
            self._peak = max(self._peak, rate)
        if rate > noise:
            self._landing_ns = None
        elif self._landing_ns is None or (rate <= 0.0 < last):
            level = 0.0 if rate <= 0.0 else noise
            self._landing_ns = crossing_ns(last_ns, last, stamp_ns, rate, level) if last > level else stamp_ns
        return self._events(stamp_ns, rate, noise)

    def _events(self, stamp_ns: int, rate: float, noise: float) -> list[Event]:
        lift_ns, events = self._lift_ns, []
        swings = self._angle >= SMALLEST_SWING * self.usual_angle or self._pushed_off
        if swings and self._peak > noise and not self._told and lift_ns is not None:
            self._told = True
            events.append(Event(LIFT, lift_ns))
        landing_ns = self._landing_ns
        if landing_ns is None or lift_ns is None:
            return events
        full = rate <= 0.0 and self._angle >= FULL_SWING * self.usual_angle
        if full or rate < -noise or (stamp_ns - landing_ns) / SECOND > LANDED:
            seconds = (landing_ns - lift_ns) / SECOND
            if self._angle >= SMALLEST_SWING * self.usual_angle and seconds >= SHORTEST_SWING:
                events.append(Event(STRIKE, landing_ns))
                self._learn(Swing(self._angle, self._peak, seconds))
            self._rest()
        return events

    def _learn(self, swing: Swing) -> None:
        self.last = swing
        self._seen += 1
        weight = max(MEMORY, 1.0 / self._seen)
        self.usual_angle += weight * (swing.angle - self.usual_angle)
        self.usual_peak += weight * (swing.peak - self.usual_peak)

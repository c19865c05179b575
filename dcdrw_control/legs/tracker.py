"""The leg tracker: from readings of the sensors to the phase of each leg, and to the halves as wheels.

Plain data in, plain data out: time arrives in the readings, and what is refused or missing is counted.
"""

import math
from typing import Any, Literal, NamedTuple, get_args

from dcdrw_control.legs.contact import ContactDetector, ForceDetector
from dcdrw_control.legs.events import Event
from dcdrw_control.legs.half import Half
from dcdrw_control.legs.hip import HipDetector
from dcdrw_control.legs.imu import ImuDetector
from dcdrw_control.legs.params import Kind, LegParams
from dcdrw_control.legs.phase import LegPhase
from dcdrw_control.legs.samples import KIND_OF, LEGS, Leg, LegReading, LegUpdate, Reading
from dcdrw_msgs_py.samples import SECOND, Turn
from dcdrw_msgs_py.topics import FRONT_WHEEL, REAR_WHEEL

Refusal = Literal['unreadable', 'not finite', 'repeated', 'reversed', 'future', 'another sensor']
"""Why a reading is refused: its message makes no sense, a value is not a number, its stamp stands still, goes back or
lies ahead of the clock, or another kind of sensor tells of the same leg."""
RESTART = 1.0
"""Stamps that go back by more are those of a source that starts anew, as a recording that is played again [s]."""

_Detector = ImuDetector | ContactDetector | ForceDetector | HipDetector
_DETECTORS: dict[Kind, type[_Detector]] = {
    'imu': ImuDetector,
    'contact': ContactDetector,
    'wrench': ForceDetector,
    'hip': HipDetector,
}


class HeelStrike(NamedTuple):
    """One heel strike of a leg."""

    leg: Leg
    stamp_ns: int
    known_ns: int
    """The stamp of the newest reading when it was certain."""


class LegStatus(NamedTuple):
    """A snapshot of one leg."""

    sensor: Kind | None
    """The sensor that was heard last; None where none ever was."""
    silent: bool
    """Whether it is not heard now."""
    mounted: bool
    """Whether the sensor's mounting is known."""
    known: bool
    """Whether its phase is known."""
    strikes: int
    """Number of heel strikes, with the missed ones."""
    missed: int
    """Strikes that were overdue and counted without having been seen."""
    doubled: int
    """Strikes that were taken for a bounce, and not counted."""
    gaps: int
    """How often its sensor was silent."""
    period: float
    """The usual stride [s]; NaN before one was seen."""

    @property
    def heard(self) -> bool:
        """Whether a sensor was ever heard of it."""
        return self.sensor is not None


class LegTrackerStatus(NamedTuple):
    """A snapshot of the tracker, for diagnostics."""

    stamp_ns: int
    """Stamp of the newest reading; 0 before the first."""
    legs: dict[Leg, LegStatus]
    refused: dict[Refusal, int]


class LegTracker:
    """Follows the legs of both halves, each by the kind of sensor that is heard of it first.

    It goes on to the time of which every sensor has told that is not silent.
    """

    def __init__(self, params: LegParams) -> None:
        self.params = params
        self._tracks = {leg: _Track() for leg in LEGS}
        self._halves: dict[str, tuple[Half, Leg, Leg]] = {
            FRONT_WHEEL: (Half(params.front.alpha), LEGS[0], LEGS[1]),
            REAR_WHEEL: (Half(params.rear.alpha), LEGS[2], LEGS[3]),
        }
        self._refused: dict[Refusal, int] = dict.fromkeys(get_args(Refusal), 0)
        self._newest_ns = 0
        self._published_ns: int | None = None
        self._struck = False
        self.strikes: list[HeelStrike] = []
        """Those that the last reading brought."""
        self.refusal: Refusal | None = None
        """Why the last reading was refused; None where it was not."""

    def configure(self, params: LegParams) -> None:
        """Take changed parameters."""
        self.params = params

    def refuse(self, why: Refusal) -> None:
        """Count a reading that is of no use; callers report what they cannot even convert (`unreadable`)."""
        self._refused[why] += 1

    def update(self, reading: LegReading, now_ns: int = 0) -> LegUpdate | None:
        """Take the next reading; None where it is refused, or nothing is due to be published.

        Args:
            reading: of any sensor; those of one sensor in the order of time.
            now_ns: the node's clock; 0 where it is unknown.

        """
        self.strikes = []
        stamp_ns, leg, _ = reading
        track = self._tracks[leg]
        self.refusal = self._refusal(reading, track, now_ns)
        if self.refusal:
            self.refuse(self.refusal)
            return None
        if track.stamp_ns is not None and stamp_ns < track.stamp_ns:
            self._restart()
        elif track.stamp_ns is not None and stamp_ns - track.stamp_ns > self._silence_ns:
            track.lose()
        track.take(reading, self.params.hip_lead)
        self._newest_ns = max(self._newest_ns, stamp_ns)
        heard = [one.stamp_ns for one in self._tracks.values() if one.stamp_ns is not None and self._is_heard(one)]
        due_ns = min(heard)  # what a sensor has yet to tell of is not guessed
        for each, one in self._tracks.items():
            self.strikes += [HeelStrike(each, struck_ns, self._newest_ns) for struck_ns in one.strikes(due_ns)]
        self._struck |= bool(self.strikes)
        since_ns = math.inf if self._published_ns is None else due_ns - self._published_ns
        if since_ns < (1 if self._struck else 0.99 * SECOND / self.params.rate):
            return None
        self._published_ns, self._struck = due_ns, False
        return self._at(due_ns)

    def _restart(self) -> None:
        """Follow a source that starts anew; what was learned stays."""
        for track in self._tracks.values():
            track.lose()
            track.stamp_ns = None
        self._newest_ns, self._published_ns = 0, None

    def status(self) -> LegTrackerStatus:
        """A snapshot."""
        legs = {leg: track.status(self._is_heard(track)) for leg, track in self._tracks.items()}
        return LegTrackerStatus(self._newest_ns, legs, self._refused.copy())

    @property
    def _silence_ns(self) -> float:
        return self.params.silence * SECOND

    def _is_heard(self, track: '_Track') -> bool:
        return track.stamp_ns is not None and self._newest_ns - track.stamp_ns <= self._silence_ns

    def _refusal(self, reading: LegReading, track: '_Track', now_ns: int) -> Refusal | None:
        stamp_ns, _, values = reading
        if not _finite(values):
            return 'not finite'
        if now_ns and stamp_ns - now_ns > self.params.max_future * SECOND:
            return 'future'
        if track.stamp_ns is None:
            return None
        if KIND_OF[type(values)] != track.kind and abs(stamp_ns - track.stamp_ns) <= self._silence_ns:
            return 'another sensor'
        if track.stamp_ns - RESTART * SECOND <= stamp_ns <= track.stamp_ns:
            return 'repeated' if stamp_ns == track.stamp_ns else 'reversed'
        return None

    def _at(self, stamp_ns: int) -> LegUpdate:
        samples = {
            leg: track.phase.at(stamp_ns) if self._is_heard(track) else None for leg, track in self._tracks.items()
        }
        turns = {
            leg: Turn(math.tau * sample.strides, math.tau * sample.rate) for leg, sample in samples.items() if sample
        }
        wheels = {
            joint: half.update(stamp_ns, (samples[left], samples[right]))
            for joint, (half, left, right) in self._halves.items()
        }
        return LegUpdate(stamp_ns, turns, {joint: turn for joint, turn in wheels.items() if turn})


class _Track:
    """One leg: the sensor that tells of it, and its phase."""

    def __init__(self) -> None:
        self.kind: Kind | None = None
        self.stamp_ns: int | None = None
        self.phase = LegPhase()
        self._detector: Any = None
        self._events: list[Event] = []
        self._gaps = 0

    def lose(self) -> None:
        """Its sensor was silent: what it did meanwhile is unknown."""
        self._gap()
        if self._detector:
            self._detector.reset()

    def _gap(self) -> None:
        self._gaps += 1
        self.phase.lose()
        self._events = []

    @property
    def _mounted(self) -> bool:
        return getattr(self._detector, 'mounted', True)

    def take(self, reading: LegReading, hip_lead: float) -> None:
        """Take the next reading."""
        stamp_ns, _, values = reading
        kind = KIND_OF[type(values)]
        if kind != self.kind:
            self.kind, self._detector = kind, _DETECTORS[kind]()
        self.stamp_ns = stamp_ns
        was_mounted = self._mounted
        events = self._detector.update(stamp_ns, *values)
        if was_mounted and not self._mounted:
            self._gap()
        if kind == 'hip' and hip_lead and self.phase.known:
            late_ns = round(hip_lead * self.phase.period * SECOND)
            events = [event._replace(stamp_ns=event.stamp_ns + late_ns) for event in events]
        self._events += events

    def strikes(self, until_ns: int) -> list[int]:
        """Go on to a time; the heel strikes on the way there."""
        past = [event for event in self._events if event.stamp_ns <= until_ns]
        self._events = self._events[len(past) :]
        return [event.stamp_ns for event in past if self.phase.take(event)]

    def status(self, heard: bool) -> LegStatus:
        """A snapshot."""
        phase = self.phase
        return LegStatus(
            self.kind,
            self.kind is not None and not heard,
            self._mounted,
            heard and phase.known,
            phase.strikes,
            phase.missed,
            phase.doubled,
            self._gaps,
            phase.period,
        )


def _finite(values: Reading) -> bool:
    """Whether all values are numbers; a hip's rate may be unknown."""
    flat = [part for value in values[:2] for part in (value if isinstance(value, tuple) else (value,))]
    if KIND_OF[type(values)] == 'hip':
        return math.isfinite(flat[0]) and not math.isinf(flat[1])
    return all(map(math.isfinite, flat))

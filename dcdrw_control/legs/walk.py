"""What the leg tracker makes of readings that are at hand, as fast as it goes."""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from dcdrw_control.legs.params import LegParams
from dcdrw_control.legs.samples import Leg, LegReading, LegUpdate
from dcdrw_control.legs.tracker import HeelStrike, LegTracker, LegTrackerStatus
from dcdrw_msgs_py.values import Floats


class Walk(NamedTuple):
    """A walk, as its sensors told it."""

    strikes: list[HeelStrike]
    updates: list[LegUpdate]
    """What the node would have published."""
    status: LegTrackerStatus

    def strikes_of(self, leg: Leg) -> list[HeelStrike]:
        """The heel strikes of a leg that were seen."""
        return [strike for strike in self.strikes if strike.leg == leg]

    def strike_seconds(self, leg: Leg) -> Floats:
        """When the heel of a leg struck [s]."""
        return np.array([strike.stamp_ns for strike in self.strikes_of(leg)], float) / 1e9

    def phase(self, leg: Leg) -> tuple[Floats, Floats]:
        """Times [s] at which the phase of a leg is known, and the phase [strides]."""
        rows = [(u.stamp_ns / 1e9, u.legs[leg].angle / math.tau) for u in self.updates if leg in u.legs]
        seconds, strides = np.array(rows, float).reshape(-1, 2).T
        return seconds, strides


def leg_updates(readings: Iterable[LegReading], params: LegParams | None = None) -> Iterator[LegUpdate]:
    """What the leg tracker publishes of readings in the order of time, one after the other."""
    return filter(None, map(LegTracker(params or LegParams()).update, readings))


def follow(readings: Iterable[LegReading], params: LegParams | None = None) -> Walk:
    """Run the leg tracker over readings in the order of time."""
    tracker = LegTracker(params or LegParams())
    strikes: list[HeelStrike] = []
    updates: list[LegUpdate] = []
    for reading in readings:
        update = tracker.update(reading)
        strikes += tracker.strikes
        if update:
            updates.append(update)
    return Walk(strikes, updates, tracker.status())

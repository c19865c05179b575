"""Cadence: the period of a stream, learned from its stamps, and the gaps in it."""

import math
from typing import NamedTuple

LOOKS = (2, 5, 15)
"""After so many intervals their median becomes the period; after the last, anew."""
GAP = 1.5
"""An interval longer than this many periods is a gap."""


class CadenceStatus(NamedTuple):
    """What a stream's stamps tell."""

    rate: float
    """Samples per second [Hz]; NaN before the second sample."""
    gaps: int
    lost: int
    """Samples that are missing, judged by the period."""
    longest: float
    """The longest gap [s]; 0 where there was none."""


class Cadence:
    """Learns the period of a stream and counts its gaps; the samples' stamps are its only clock."""

    def __init__(self) -> None:
        self.gaps = 0
        self.lost = 0
        self._last_ns: int | None = None
        self._longest_ns = 0
        self._period_ns = 0
        self._intervals: list[int] = []

    def tick(self, stamp_ns: int) -> None:
        """Take the next stamp; one that does not move on is ignored."""
        last_ns = self._last_ns
        if last_ns is None:
            self._last_ns = stamp_ns
            return
        interval = stamp_ns - last_ns
        if interval <= 0:
            return
        self._last_ns = stamp_ns
        period = self._period_ns
        if period and interval > GAP * period:
            self.gaps += 1
            self.lost += round(interval / period) - 1
            self._longest_ns = max(self._longest_ns, interval)
        self._intervals.append(interval)
        if len(self._intervals) in LOOKS:
            self._period_ns = sorted(self._intervals)[(len(self._intervals) - 1) // 2]
            if len(self._intervals) == LOOKS[-1]:
                self._intervals.clear()

    def jump(self, stamp_ns: int) -> None:
        """Go on from another stamp, without a gap: the source has started anew."""
        self._last_ns = stamp_ns

    def status(self) -> CadenceStatus:
        """A snapshot."""
        rate = 1e9 / self._period_ns if self._period_ns else math.nan
        return CadenceStatus(rate, self.gaps, self.lost, self._longest_ns * 1e-9)

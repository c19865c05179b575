"""Cadence: the period of a stream, learned from its stamps, and the gaps in it."""

import math
from itertools import accumulate, pairwise
from statistics import median_low
from typing import NamedTuple

LEARNING_COUNTS = (2, 5, 15, 60)
"""Numbers of intervals after which the period is learned; after the last, it is learned anew."""
GAP = 1.5
"""An interval longer than this many periods is a gap."""
TOGETHER = 0.25
"""Samples of one burst are closer than this share of the time from burst to burst."""
BURSTS = 3
"""So many bursts must look alike before they are taken for bursts."""


class CadenceStatus(NamedTuple):
    """What a stream's stamps tell."""

    rate: float
    """Samples per second [Hz]; NaN before the third sample."""
    gaps: int
    lost: int
    """Samples that are missing, judged by the period."""
    longest: float
    """The longest gap [s]; 0 where there was none."""


class _Beat(NamedTuple):
    """How a stream beats: one sample per period, or a burst of several."""

    period_ns: float
    """Period from burst to burst."""
    size: float = 1.0
    """Mean number of samples in a burst."""
    together_ns: int = 0
    """The longest interval within a burst."""
    fixed: bool = False
    """All bursts are of one size, so that one with fewer samples has lost some."""


class Cadence:
    """Learns the period of a stream and counts its gaps; the samples' stamps are its only clock.

    A source that reads its sensor in bursts, and stamps the samples as they arrive, is told from one that loses
    samples: its intervals are of two kinds, far apart, and its bursts come evenly.
    """

    def __init__(self) -> None:
        self._gaps = self._lost = self._longest_ns = 0
        self._last_ns: int | None = None
        self._beat: _Beat | None = None
        self.period_ns = 0
        """Mean time from sample to sample; 0 while unknown."""
        self.burst = 1
        """Samples that arrive together: 1 where they come one by one."""
        self._intervals: list[int] = []
        self._counts: tuple[int, ...] = LEARNING_COUNTS

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
        intervals = self._intervals
        intervals.append(interval)
        if len(intervals) in self._counts:
            self._beat = beat = _learned(intervals)
            self.period_ns, self.burst = round(beat.period_ns / beat.size), round(beat.size)
            if len(intervals) == LEARNING_COUNTS[-1]:
                self._settle()
                self._counts = LEARNING_COUNTS[-1:]

    def jump(self, stamp_ns: int) -> None:
        """Go on from another stamp, without a gap: the source has started anew."""
        self._settle()
        self._intervals.clear()
        self._last_ns = stamp_ns

    def status(self) -> CadenceStatus:
        """A snapshot."""
        gaps, lost, longest_ns, _ = self._judged()
        rate = 1e9 * self._beat.size / self._beat.period_ns if self._beat else math.nan
        return CadenceStatus(rate, self._gaps + gaps, self._lost + lost, max(self._longest_ns, longest_ns) * 1e-9)

    def _settle(self) -> None:
        """Count the gaps so far for good, and keep the intervals of a burst that may not be complete."""
        gaps, lost, longest_ns, rest = self._judged()
        self._gaps += gaps
        self._lost += lost
        self._longest_ns = max(self._longest_ns, longest_ns)
        self._intervals = rest

    def _judged(self) -> tuple[int, int, int, list[int]]:
        """Gaps, lost samples and the longest gap [ns] among the intervals, and those of the last burst."""
        beat, intervals = self._beat, self._intervals
        if beat is None:
            return 0, 0, 0, intervals
        gaps = lost = longest_ns = 0
        period, inside, size = beat.period_ns, 0, 1
        first = 0
        for place, interval in enumerate(intervals):
            if interval <= beat.together_ns:
                inside += interval
                size += 1
                continue
            between = inside + interval
            if between > GAP * period:
                gaps += 1
                lost += max(round(between * beat.size / period - max(size, beat.size)), 1)
                longest_ns = max(longest_ns, interval)
            if beat.fixed and place > size and size < beat.size:  # not the first, which may have begun before
                gaps += between <= GAP * period
                lost += round(beat.size) - size
                longest_ns = max(longest_ns, interval)
            inside, size, first = 0, 1, place + 1
        return gaps, lost, longest_ns, intervals[first:]


def _learned(intervals: list[int]) -> _Beat:
    """The beat of these intervals."""
    ordered = sorted(intervals)
    one_by_one = _Beat(median_low(ordered))
    # The widest step between neighbouring lengths parts the intervals within bursts from those between them.
    ratios = [later / earlier for earlier, later in pairwise(ordered)]
    widest = max(range(len(ratios)), key=ratios.__getitem__, default=0)
    if not ratios or ratios[widest] * TOGETHER < 1.0:
        return one_by_one
    together = ordered[widest]
    ends = [place for place, interval in enumerate(intervals) if interval > together]
    sums = list(accumulate(intervals, initial=0))
    sizes = [later - earlier for earlier, later in pairwise(ends)]
    if len(sizes) < BURSTS - 1:
        return one_by_one
    periods = [sums[later + 1] - sums[earlier + 1] for earlier, later in pairwise(ends)]
    usual = median_low(periods)
    even = [place for place, one in enumerate(periods) if abs(one - usual) < 0.5 * usual]
    size, period = (sum(counts[place] for place in even) / len(even) for counts in (sizes, periods))
    alike = sum(0.5 * size <= one <= 2.0 * size for one in sizes)
    if size < 1.5 or min(len(even), alike) < 0.7 * len(sizes):
        return one_by_one
    most = median_low(sizes)
    fixed = len(sizes) >= 8 and sizes.count(most) >= 0.9 * len(sizes)
    return _Beat(period, most if fixed else size, together, fixed)

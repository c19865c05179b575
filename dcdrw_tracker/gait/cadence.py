"""Cadence: the period of a stream, learned from its stamps, and the gaps in it."""

import math
from bisect import bisect_right
from itertools import accumulate, pairwise
from statistics import linear_regression, median_low
from typing import NamedTuple

LEARNING_COUNTS = (2, 5, 15, 60, 240, 960)
"""Numbers of intervals after which the period is learned; after the last, it is learned anew."""
SURE, SURE_NS = 60, 50_000_000
"""So many intervals that are alike, over so long, tell a source that sends one by one from the inside of a burst."""
GAP = 1.5
"""An interval longer than this many periods is a gap."""
TOGETHER = 0.25
"""Samples of one burst are closer than this share of the time from burst to burst."""
BURSTS = 3
"""So many bursts must look alike before they are taken for bursts."""
CHANGED = 20
"""So many long or short intervals in a row, all alike, are another cadence."""
MANY_LONG = 12
"""So many intervals that seem to be gaps tell of a source that is uneven, where they make up for one another."""
COMMON = 0.95
"""The share of the intervals of an uneven source that tells its longest and its shortest."""
HASTE = 0.5
"""Samples that come within so many periods of one another after a pause had waited: they make up for it."""
NEAR = 0.25
"""So near whole periods, by the share of one, intervals lie between which samples were lost."""


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
    alone: bool = False
    """The source surely sends one by one."""
    apart_ns: float = 0.0
    """The longest time from burst to burst, where they are of various sizes, or from sample to uneven sample."""

    @property
    def gap_ns(self) -> float:
        """A longer time from burst to burst is a gap."""
        return GAP * max(self.period_ns, self.apart_ns)

    @property
    def sample_ns(self) -> float:
        """Mean time from sample to sample."""
        return self.period_ns / self.size


class Cadence:
    """Learns the period of a stream and counts its gaps; the samples' stamps are its only clock.

    A source that reads its sensor in bursts, and stamps the samples as they arrive, is told from one that loses
    samples: its intervals are of two kinds, far apart, and its bursts come evenly. Likewise one whose intervals are
    uneven: they make up for one another, or are no whole periods. One that changes its rate keeps to the new one.
    """

    def __init__(self) -> None:
        self._gaps = self._lost = self._longest_ns = 0
        self._last_ns: int | None = None
        self._before_ns = 0
        """From the burst before the last one to that; 0 where that is not known."""
        self._beat: _Beat | None = None
        self.period_ns = 0
        """Mean time from sample to sample; 0 while unknown."""
        self.burst = 1
        """Samples that arrive together: 1 where they come one by one."""
        self._intervals: list[int] = []
        self._pause_ns = self._waited = 0
        """From the sample before a pause to the last one, and how many came at once after it, while some may wait."""
        self._counts: tuple[int, ...] = LEARNING_COUNTS
        self._others = 0
        """How many intervals in a row, all alike, have been far longer or shorter than the period."""

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
        beat = self._beat
        if self._pause_ns:
            if beat and interval < HASTE * beat.period_ns:
                self._pause_ns += interval
                self._waited += 1
                if self._pause_ns <= (1 + self._waited) * beat.period_ns:
                    self._go_on()
                return
            self._go_on()
            beat = self._beat
        if beat and beat.size == 1.0 and interval > beat.gap_ns:
            self._pause_ns = interval
        else:
            self._take(interval)

    def _go_on(self) -> None:
        """Take a pause and what had waited for its end: those samples had been taken evenly."""
        if not self._pause_ns:
            return
        pause, waited, even = self._sampled_pause(), self._waited, self.period_ns
        self._pause_ns = self._waited = 0
        self._take(pause)
        for _ in range(waited):
            self._take(even)

    def _sampled_pause(self) -> int:
        """The pause as it was for the source [ns], which sampled evenly what had waited."""
        return max(self._pause_ns - self._waited * self.period_ns, self.period_ns)

    def _take(self, interval: int) -> None:
        intervals, beat = self._intervals, self._beat
        intervals.append(interval)
        if beat and beat.size == 1.0:
            if beat.period_ns <= GAP * interval and interval <= beat.gap_ns:
                self._others = 0
            else:
                self._others = self._others + 1 if self._others and _alike(interval, intervals[-2]) else 1
                if self._others == CHANGED:
                    self._change()
        else:
            self._others = 0
        if len(intervals) in self._counts:
            self._learn(self._beat)
            if len(intervals) == LEARNING_COUNTS[-1]:
                self._settle(self._others)
                self._counts = LEARNING_COUNTS[-1:]

    def jump(self, stamp_ns: int) -> None:
        """Go on from another stamp, without a gap: the source has started anew."""
        self._go_on()
        self._settle()
        self._intervals.clear()
        self._last_ns, self._before_ns, self._others = stamp_ns, 0, 0

    def seconds(self, elapsed: float) -> float:
        """The time in which the source turned on from one sample to the next [s], by that between their stamps.

        Within bursts, which are stamped as they arrive, it is the mean one.
        """
        beat = self._beat
        if beat is None or self.burst == 1 or self.is_gap(elapsed):
            return elapsed
        return beat.sample_ns * 1e-9

    def is_gap(self, elapsed: float) -> bool:
        """Whether so much time [s] between two samples is more than the source takes from one to the next."""
        beat = self._beat
        return beat is not None and elapsed * 1e9 > beat.gap_ns

    def status(self) -> CadenceStatus:
        """A snapshot."""
        pause = [self._sampled_pause()] if self._pause_ns else []
        gaps, lost, longest_ns, *_ = self._judged(self._intervals + pause)
        rate = 1e9 * self._beat.size / self._beat.period_ns if self._beat else math.nan
        return CadenceStatus(rate, self._gaps + gaps, self._lost + lost, max(self._longest_ns, longest_ns) * 1e-9)

    def _learn(self, known: _Beat | None) -> None:
        self._beat = beat = _learned(self._intervals, known)
        self.period_ns, self.burst = round(beat.sample_ns), round(beat.size)

    def _change(self) -> None:
        """Go on at the cadence of the last intervals."""
        self._settle(CHANGED)
        self._counts, self._others = LEARNING_COUNTS, 0
        self._learn(None)

    def _settle(self, others: int = 0) -> None:
        """Count the gaps so far for good, and keep the intervals of a burst that may not be complete.

        The last ones may be of another cadence: so many are kept, too.
        """
        kept = self._intervals[len(self._intervals) - others :]
        del self._intervals[len(self._intervals) - others :]
        gaps, lost, longest_ns, rest, self._before_ns = self._judged(self._intervals)
        self._gaps += gaps
        self._lost += lost
        self._longest_ns = max(self._longest_ns, longest_ns)
        self._intervals = rest + kept

    def _judged(self, intervals: list[int]) -> tuple[int, int, int, list[int], int]:
        """Gaps, lost samples, the longest gap [ns], the intervals of the last burst, and the time before it [ns]."""
        beat = self._beat
        if beat is None:
            return 0, 0, 0, intervals, 0
        gaps = lost = longest_ns = 0
        period, gap_ns, inside, size, before = beat.period_ns, beat.gap_ns, 0, 1, self._before_ns
        various = beat.size > 1.0 and not beat.fixed
        first = 0
        for place, interval in enumerate(intervals):
            if interval <= beat.together_ns:
                inside += interval
                size += 1
                continue
            between = inside + interval
            if various:  # a burst has what was sampled since the one before
                if before > (GAP * size + 1.0) * beat.sample_ns:
                    gaps += 1
                    lost += max(round(before / beat.sample_ns) - size, 1)
                    longest_ns = max(longest_ns, before)
            else:
                if between > gap_ns:
                    gaps += 1
                    lost += max(round(between * beat.size / period - max(size, beat.size)), 1)
                    longest_ns = max(longest_ns, interval)
                if beat.fixed and place > size and size < beat.size:  # not the first, which may have begun before
                    gaps += between <= gap_ns
                    lost += round(beat.size) - size
                    longest_ns = max(longest_ns, interval)
            before, inside, size, first = between, 0, 1, place + 1
        return gaps, lost, longest_ns, intervals[first:], before


def _learned(intervals: list[int], known: _Beat | None) -> _Beat:
    """The beat of these intervals; that which was known where they come in bursts that tell none.

    A source that surely sent one by one, as far apart as samples still are, sends no bursts: it loses samples.
    """
    ordered = sorted(intervals)
    one_by_one = _Beat(median_low(ordered))
    # The widest step between neighbouring lengths parts the intervals within bursts from those between them.
    ratios = [later / earlier for earlier, later in pairwise(ordered)]
    widest = max(range(len(ratios)), key=ratios.__getitem__, default=0)
    if not ratios or ratios[widest] * TOGETHER < 1.0:
        return (_rough(intervals, ordered) or one_by_one)._replace(
            alone=len(intervals) >= SURE and sum(intervals) >= SURE_NS
        )
    together = ordered[widest]
    if known and known.alone and together > 0.5 * known.period_ns:
        return known
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
    regular = size >= 1.5 and min(len(even), alike) >= 0.7 * len(sizes)
    most = median_low(sizes)
    if regular and len(sizes) >= 8 and sizes.count(most) >= 0.9 * len(sizes):
        return _Beat(period, most, together, fixed=True)
    if beat := _uneven(sizes, periods, together):
        return beat
    if regular:
        return _Beat(period, size, together)
    return known if known and known.size > 1.0 else _rough(intervals, ordered) or one_by_one


def _rough(intervals: list[int], ordered: list[int]) -> _Beat | None:
    """The beat of a source that sends one by one, but at uneven intervals; None where those that are long are gaps.

    Gaps last whole periods, and nothing makes up for them later.
    """
    count, period = len(ordered), median_low(ordered)
    short = bisect_right(ordered, GAP * period)
    long = ordered[short:]
    if count < SURE:
        return None
    usual = sum(ordered[:short]) / short
    shortest, longest = ordered[round((1.0 - COMMON) * count)], ordered[round(COMMON * count) - 1]
    common = [interval for interval in intervals if interval <= GAP * longest]
    mean = sum(common) / len(common)
    beat = _Beat(mean, apart_ns=longest)
    whole = sum(abs(interval / usual - round(interval / usual)) <= NEAR for interval in long)
    if not long or whole < 0.75 * len(long):
        return beat
    times = list(accumulate(common))
    slope, offset = linear_regression(range(len(times)), times)
    strays = [time - slope * place - offset for place, time in enumerate(times)]
    made_up = len(long) >= MANY_LONG and max(strays) - min(strays) <= GAP * max(longest - shortest, period)
    return beat if made_up else None


def _alike(one: int, other: int) -> bool:
    """Whether neither interval is far longer than the other."""
    return one < GAP * other and other < GAP * one


def _uneven(sizes: list[int], periods: list[int], together_ns: int) -> _Beat | None:
    """The beat of bursts that come as it happens, each with what was sampled since the one before."""
    shares = [period / size for period, size in zip(periods, sizes[1:], strict=False)]
    if len(shares) < BURSTS or sum(sizes) < 1.2 * len(sizes):
        return None
    usual = median_low(shares)
    near = [place for place, share in enumerate(shares) if abs(share - usual) <= 0.5 * usual]
    if len(near) < 0.7 * len(shares):
        return None
    sample_ns = sum(periods[place] for place in near) / sum(sizes[place + 1] for place in near)
    size = sum(sizes) / len(sizes)
    return _Beat(sample_ns * size, size, together_ns, apart_ns=max(periods[place] for place in near))

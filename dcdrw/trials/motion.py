"""The motion of a trial as columns, and as much of it as a picture shows, however long the trial was."""

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.values import Floats
from dcdrw_tracker.gait.cadence import GAP

SHORTEST_GAP_NS = 20_000_000
"""Over less, nothing happens that a curve would hide [ns]."""
USUAL = 0.9
"""So large a share of the intervals between samples is no longer than the usual one: also where they come in bursts."""
ENOUGH = 100
"""Intervals that tell the usual one."""
MOST_ROWS = 32_768
"""Up to so many rows are kept as they are."""
FIRST_BIN = 32
"""Rows of a bin when not all are kept any more; a bin keeps at most twelve."""
AT_ONCE = 8192
"""Rows that are thinned at once."""

Integers = NDArray[np.int64]


class MotionTable(NamedTuple):
    """Columns of one length: a row for each joint state that the estimator took, and what it made of it."""

    stamp_ns: Integers
    """Stamps by the source's clock as it was at first: a clock that was set later is set back."""
    rotation1: Floats
    """ψ1 as it was measured, in rad."""
    rotation2: Floats
    coupler_length: Floats
    """D [m]; NaN, as Ḋ and F, where the source does not tell it."""
    coupler_rate: Floats
    """Ḋ [m/s]."""
    coupler_force: Floats
    """F [N]."""
    theta1: Floats
    """[rad]"""
    omega1: Floats
    """[rad/s]"""
    theta2: Floats
    omega2: Floats
    phi: Floats
    """[rad]"""
    phi_rate: Floats
    """[rad/s]"""
    step_difference: Integers
    restarts: Integers
    """How often the source had started anew."""
    error_percent: Floats
    """100 (p − 0.5) [% of a step]; NaN where the monitor refused the sample."""
    synchronized: NDArray[np.bool_]
    """The monitor's verdict."""
    row: Integers
    """Its number in the whole motion, of which not every row need be here."""
    piece: Integers
    """Rises by one where samples are missing for long enough to be seen, or the source began anew."""

    def rows(self, part: Any) -> 'MotionTable':
        """These rows of every column."""
        return MotionTable(*(column[part] for column in self))

    @classmethod
    def joined(cls, parts: list['MotionTable']) -> 'MotionTable':
        """Parts in the order of time; of none, an empty one."""
        if not parts:
            return cls(*(np.empty(0, kind) for kind in _KINDS))
        return parts[0] if len(parts) == 1 else cls(*map(np.concatenate, zip(*parts, strict=True)))

    @property
    def seconds(self) -> Floats:
        """Time since the first row [s]."""
        return np.asarray((self.stamp_ns - self.stamp_ns[:1]) / SECOND)

    @property
    def gaps(self) -> Integers:
        """Rows with which another piece begins."""
        return np.flatnonzero(np.diff(self.piece)) + 1


_KINDS = (np.int64, *[np.float64] * 11, np.int64, np.int64, np.float64, np.bool_, np.int64, np.int64)


class Sink(Protocol):
    """Takes the motion of a trial as it becomes known, of which an analysis keeps only a part."""

    def take(self, motion: MotionTable) -> None:
        """Take the next rows."""

    def begin(self) -> None:
        """The wheels are let go with the next row: what came before was not yet the trial."""


class Whole:
    """Keeps every row of a motion: a `Sink`."""

    def __init__(self) -> None:
        self._parts: list[MotionTable] = []

    def take(self, motion: MotionTable) -> None:
        """Take the next rows."""
        self._parts.append(motion)

    def begin(self) -> None:
        """Forget what came before."""
        self._parts.clear()

    @property
    def motion(self) -> MotionTable:
        """All that was taken."""
        return MotionTable.joined(self._parts)


class Gaps:
    """Finds where samples are missing, from one part of a motion to the next."""

    def __init__(self) -> None:
        self._usual_ns = 0.0
        self._last: tuple[int, int] | None = None

    def before(self, stamp_ns: Integers, restarts: Integers) -> NDArray[np.bool_]:
        """Before which rows samples are missing, or the source began anew."""
        first, at = self._last is None, self._last or (stamp_ns[0], restarts[0])
        intervals = np.diff(stamp_ns, prepend=at[0])
        anew = np.diff(restarts, prepend=at[1]) != 0
        self._last = int(stamp_ns[-1]), int(restarts[-1])
        if len(intervals) > ENOUGH or (len(intervals) > 1 and not self._usual_ns):
            self._usual_ns = float(np.quantile(intervals[1:], USUAL))
        cut = (intervals > max(GAP * self._usual_ns, SHORTEST_GAP_NS)) | (intervals <= 0) | anew
        cut[0] &= not first
        return np.asarray(cut)


class Thinned:
    """Keeps all rows of a motion, or where these are too many, of each bin of neighbours those that a picture shows.

    These are the first and the last, those with the least and the greatest θ1, θ2, φ and F, and those around its
    longest gap: no peak is lost, and no curve runs across a gap.
    """

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Forget what came before."""
        self._bin = 0
        self._kept = MotionTable.joined([])
        self._fresh: list[MotionTable] = []
        self._waiting = 0

    def take(self, motion: MotionTable) -> None:
        """Take the next rows."""
        self._fresh.append(motion)
        self._waiting += len(motion.stamp_ns)
        if self._waiting >= AT_ONCE:
            self._settle()

    @property
    def motion(self) -> MotionTable:
        """What was kept."""
        self._settle()
        return self._kept

    def _settle(self) -> None:
        if not self._fresh:
            return
        fresh = MotionTable.joined(self._fresh)
        self._fresh, self._waiting = [], 0
        self._kept = MotionTable.joined([self._kept, _thin(fresh, self._bin) if self._bin else fresh])
        while len(self._kept.row) > MOST_ROWS:
            self._bin = 2 * self._bin or FIRST_BIN
            self._kept = _thin(self._kept, self._bin)


def thinned(motion: MotionTable, most: int) -> MotionTable:
    """At most so many rows of a motion: of each bin of neighbours those that `Thinned` keeps."""
    size = FIRST_BIN
    while len(motion.row) > most:
        motion, size = _thin(motion, size), 2 * size
    return motion


def _thin(motion: MotionTable, size: int) -> MotionTable:
    """The rows to keep of bins of a size."""
    bins = motion.row // size
    begins = np.flatnonzero(np.diff(bins, prepend=-1))
    ends = np.append(begins[1:], len(bins)) - 1
    gap_ns = np.where(np.diff(motion.piece, prepend=motion.piece[0]), np.diff(motion.stamp_ns, prepend=0), 0)
    gap_ns[gap_ns < 0] = np.iinfo(np.int64).max  # the stamps went back
    longest = np.lexsort((gap_ns, bins))[ends]
    kept = [begins, ends, longest, np.maximum(longest - 1, 0)]
    for column in (motion.theta1, motion.theta2, motion.phi, motion.coupler_force):
        order = np.lexsort((np.nan_to_num(column), bins))
        kept += [order[begins], order[ends]]
    return motion.rows(np.unique(np.concatenate(kept)))

"""The course of a trial as it becomes known, row by row: handed on in parts, and counted."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw.trials.motion import Gaps, Integers, MotionTable, Sink, Thinned
from dcdrw_msgs_py.samples import SECOND, Footfall

AT_ONCE = 4096
"""Rows that are handed on together."""
GAPS_KEPT = 12
"""Gaps that are told: the longest."""


class Gap(NamedTuple):
    """A time without samples; the longer one is the greater."""

    seconds: float
    """How long [s]."""
    begin_ns: int
    """Stamp of the last sample before it."""


class Course:
    """Takes rows and footfalls; hands the motion on to sinks, and keeps what a picture needs of it."""

    def __init__(self, sinks: Sequence[Sink]) -> None:
        self._kept = Thinned()
        self._sinks = (*sinks, self._kept)
        self._waiting: list[list[Any]] = []
        self._find_gaps = Gaps()
        self._piece = self._last_ns = 0
        self._begun: int | None = None
        self._handed_on = 0
        self.origin = 0
        """Row with which the trial begins."""
        self.rows = 0
        """Rows so far, also those from before the wheels were let go."""
        self._forget()

    def _forget(self) -> None:
        self.samples = 0
        """Rows of the trial that were handed on."""
        self.start_ns = self.end_ns = 0
        """Stamps of the first and the last of them."""
        self.longest_ns = 0
        """The longest time from one to the next."""
        self.gaps = 0
        """How often samples are missing for long enough to be seen."""
        self.longest_gaps: list[Gap] = []
        self.footfalls: list[Footfall] = []
        self.unseen: set[Footfall] = set()
        """Footfalls between two samples with others missing in between."""
        self._examined = self._examined_before = 0

    def add(self, columns: list[Any]) -> None:
        """Take rows: the columns of a `MotionTable` but for the last."""
        self._waiting.append(columns)
        self.rows += len(columns[0])
        if self.rows - self._handed_on > AT_ONCE:
            self._hand_on(self.rows - 1)  # the last may yet be the first of the trial

    def begin(self, row: int) -> None:
        """The wheels are let go with this row, the last that was added or a later one."""
        self._begun = self.origin = row
        self._forget()

    @property
    def motion(self) -> MotionTable:
        """What is kept of the motion, once all rows were added."""
        if self._waiting:
            self._hand_on(self.rows)
        return self._kept.motion

    def _hand_on(self, until: int) -> None:
        columns = [np.concatenate(parts) for parts in zip(*self._waiting, strict=True)]
        count = until - self._handed_on
        self._waiting = [[column[count:] for column in columns]] if until < self.rows else []
        stamp_ns, restarts = columns[0][:count], columns[_RESTARTS][:count]
        cuts = self._find_gaps.before(stamp_ns, restarts)
        before_ns = np.concatenate([[self._last_ns], stamp_ns[:-1]])
        self._last_ns = int(stamp_ns[-1])
        rows = np.arange(self._handed_on, until) - self.origin
        motion = MotionTable._make([*(column[:count] for column in columns), rows, self._piece + np.cumsum(cuts)])
        self._piece = int(motion.piece[-1])
        begun = 0
        if self._begun is not None and self._begun < until:
            begun, self._begun = self._begun - self._handed_on, None
            self._pass_on(motion.rows(slice(begun)))
            for sink in self._sinks:
                sink.begin()
            cuts[begun] = False
        self._handed_on = until
        self._count(motion.stamp_ns[begun:], before_ns[begun:], cuts[begun:])
        self._pass_on(motion.rows(slice(begun, None)))

    def _pass_on(self, motion: MotionTable) -> None:
        for sink in self._sinks if len(motion.stamp_ns) else ():
            sink.take(motion)

    def _count(self, stamp_ns: Integers, before_ns: Integers, cuts: NDArray[np.bool_]) -> None:
        if not self.samples:
            self.start_ns = before_ns[0] = int(stamp_ns[0])
        self.samples += len(stamp_ns)
        self.end_ns = int(stamp_ns[-1])
        self.longest_ns = max(self.longest_ns, int((stamp_ns - before_ns).max()))
        self.gaps += int(cuts.sum())
        ends = np.flatnonzero(cuts & (stamp_ns > before_ns))
        found = [Gap((int(stamp_ns[row]) - int(before_ns[row])) / SECOND, int(before_ns[row])) for row in ends]
        self.longest_gaps = sorted((*self.longest_gaps, *found), reverse=True)[:GAPS_KEPT]
        # A footfall before the last row that was added may lie before the first that is handed on next.
        falls = self.footfalls[self._examined_before :]
        struck_ns = np.array([fall.stamp_ns for fall in falls], np.int64)
        within = (before_ns[cuts][:, None] < struck_ns) & (struck_ns < stamp_ns[cuts][:, None])
        self.unseen.update(falls[number] for number in np.flatnonzero(within.any(axis=0)))
        self._examined_before, self._examined = self._examined, len(self.footfalls)


_RESTARTS = MotionTable._fields.index('restarts')

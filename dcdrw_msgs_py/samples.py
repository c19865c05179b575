"""Samples: what passes between the cores, as plain data. Time arrives in the sample; no core has a clock."""

import math
from bisect import bisect_right
from typing import NamedTuple

NAN = math.nan
SECOND = 1_000_000_000
"""[ns]"""
RUN = 'run_'
"""A source announces a run on the topic `run` by this, with a number."""


class Runs:
    """The runs of a source, as it announces them: counts start afresh with each."""

    def __init__(self) -> None:
        self._starts: list[int] = []
        self._numbers: list[int] = []

    def announce(self, stamp_ns: int, name: str) -> None:
        """Take an announcement: the stamp of a run's first sample, and its name. One of another form is passed over."""
        other, _, number = name.partition(RUN)
        if other or not number.isdecimal():
            return
        while self._starts and self._starts[-1] >= stamp_ns:  # the source's time went back
            del self._starts[-1], self._numbers[-1]
        self._starts.append(stamp_ns)
        self._numbers.append(int(number))
        del self._starts[:-MOST_RUNS], self._numbers[:-MOST_RUNS]

    def of(self, stamp_ns: int) -> int:
        """The run of a sample with this stamp; 0 where the source told none."""
        place = bisect_right(self._starts, stamp_ns)
        return self._numbers[place - 1] if place else 0


MOST_RUNS = 1000
"""So many runs are kept."""


class Turn(NamedTuple):
    """An angle and its rate, both NaN where unknown."""

    angle: float = NAN
    """[rad]"""
    rate: float = NAN
    """[rad/s]"""


class CouplerSample(NamedTuple):
    """The coupler, where the source knows it."""

    length: float = NAN
    """D [m]."""
    rate: float = NAN
    """Ḋ [m/s]."""
    force: float = NAN
    """F [N], positive in tension."""


class JointSample(NamedTuple):
    """One `joint_states` message: the rotations ψ of both wheels at one instant."""

    stamp_ns: int
    front: Turn
    rear: Turn
    coupler: CouplerSample = CouplerSample()
    run: int = 0
    """Within a run the source vouches that ψ is unbounded and lost no turn, through any gap; a new run has a larger
    number. 0: the source does not say."""


class LoneWheel(NamedTuple):
    """A `joint_states` message that has one of the wheels only."""

    stamp_ns: int
    wheel: str
    """`front` or `rear`."""
    turn: Turn
    coupler: CouplerSample = CouplerSample()
    run: int = 0


class PoseSample(NamedTuple):
    """Where another tracker, as a motion capture system, sees one wheel: its hub and its body's frame, z up."""

    stamp_ns: int
    position: tuple[float, float, float]
    """[m]"""
    orientation: tuple[float, float, float, float]
    """Unit quaternion x, y, z, w."""


class PhaseSample(NamedTuple):
    """One `phase_state` message: stance angles, phase difference and step difference at one instant."""

    stamp_ns: int
    front: Turn
    """θ1 in [−α1, α1)."""
    rear: Turn
    """θ2 in [−α2, α2)."""
    phi: Turn
    """φ in [0, α1 + α2)."""
    step_difference: int
    """n = n1 − n2."""
    restarts: int = 0
    """How often the source has started anew; the counts of steps start afresh with it."""
    front_steps: int = 0
    """n1."""
    rear_steps: int = 0
    """n2."""
    sources: int = 1
    """How many nodes send the joint states of these wheels, where one should."""
    resolution: float = 0.0
    """How far coarse encoders leave the phase open, a count of each, in steps; 0 where rotations are told finely."""


class Footfall(NamedTuple):
    """One strike of a wheel."""

    wheel: str
    """`front` or `rear`."""
    stamp_ns: int
    """The strike's own time, interpolated between samples."""
    x: float
    """The new stance foot's place down the slope [m]."""
    steps: int = -1
    """n_i after the strike; -1 where it is not told."""


class SyncSample(NamedTuple):
    """The synchronization error at one instant."""

    stamp_ns: int
    error: float
    """e, wrapped to [−α, α) [rad]."""
    error_percent: float
    """100 (p − 0.5) [% of a step]."""
    synchronized: bool

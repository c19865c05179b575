"""Whether the wheels of a trial are braked where their zeros and spokes have it: a trial's own say on its rig file."""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from dcdrw.trials.motion import Integers, MotionTable
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.values import Floats
from dcdrw_tracker.gait.braking import Doubt, doubt
from dcdrw_tracker.gait.phase import PhaseParams

MOST_ROWS = 60_000
"""Of a run that are looked at: the first ones."""
LONGEST_PAUSE = 0.2
"""Over a longer one nothing is told [s]."""
BURSTS = 0.5
"""Samples come in bursts where most intervals are shorter than this part of the mean one."""
NEIGHBOURS = 5
"""The median of so many samples leaves out a wild one, and is that of the middle where a wheel rolls."""
TURNED_BACK = np.radians(2.0)
"""A wheel that recedes by more does not roll by itself any more [rad]."""


class Contradiction(NamedTuple):
    """A parameter that the strikes of a wheel contradict."""

    wheel: str
    parameter: str
    """Its name in rig files."""
    value: float
    """That goes with the strikes: a zero in rad, or a number of spokes."""
    thought: float
    """What the parameter is."""


class StrikeCheck:
    """Keeps the first part of a trial's last run, as a `Sink`, and holds its strikes against the parameters."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Forget what came before."""
        self._kept: list[tuple[Integers, Floats, Floats]] = []
        self._rows = self._restarts = 0

    def take(self, motion: MotionTable) -> None:
        """Take the next rows."""
        latest = int(motion.restarts[-1])
        if latest != self._restarts:
            self.begin()
            self._restarts = latest
            motion = motion.rows(motion.restarts == latest)
        if self._rows < MOST_ROWS:
            self._kept.append((motion.stamp_ns, motion.theta1, motion.theta2))
            self._rows += len(motion.stamp_ns)

    def contradictions(self, params: PhaseParams) -> tuple[Contradiction, ...]:
        """What the strikes say against these parameters, with which the motion came about."""
        if not self._kept:
            return ()
        stamp_ns, *thetas = (np.concatenate(columns) for columns in zip(*self._kept, strict=True))
        seconds = (stamp_ns - stamp_ns[0]) / SECOND
        wheels = ((FRONT, params.front, params.front_zero), (REAR, params.rear, params.rear_zero))
        found = []
        for theta, (wheel, shape, zero) in zip(thetas, wheels, strict=True):
            if told := doubt(*_rolling(seconds, theta, shape.alpha), shape.alpha):
                found.append(_contradiction(wheel, told, zero, shape.spokes))
        return tuple(found)


def _contradiction(wheel: str, told: Doubt, zero: float, spokes: float) -> Contradiction:
    if np.isnan(told.spokes):
        return Contradiction(wheel, f'{wheel}_zero', zero + told.zero, zero)
    return Contradiction(wheel, f'{wheel}.spokes', told.spokes, spokes)


def _rolling(seconds: Floats, theta: Floats, alpha: float) -> tuple[Floats, Floats]:
    """Time and rotation where a wheel rolls downhill for longest without a pause [s], [rad]."""
    ahead = np.diff(seconds, prepend=-1.0) > 0.0
    seconds, theta = seconds[ahead], theta[ahead]
    intervals = np.diff(seconds, append=np.inf)
    mean = float(intervals[:-1].mean()) if len(intervals) > 1 else 0.0
    if np.median(intervals) < BURSTS * mean:  # stamped as they arrive: the last of each burst has its own time
        seconds, theta = seconds[intervals > mean], theta[intervals > mean]
    psi = median_filter(np.unwrap(theta, period=2.0 * alpha), NEIGHBOURS, mode='nearest')
    highest = np.maximum.accumulate(psi)
    begins = np.flatnonzero((np.diff(seconds) > LONGEST_PAUSE) | (np.diff(highest - psi > TURNED_BACK) > 0)) + 1
    pieces = np.split(np.arange(len(psi)), begins)
    piece = max(pieces, key=len)
    return seconds[piece], np.maximum.accumulate(psi[piece])

"""The samples of a trial, as far as its wheels roll by themselves."""

import math
from typing import NamedTuple

import numpy as np

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.rolling import stance
from dcdrw_msgs_py.values import Floats
from dcdrw_msgs_py.words import counted

AT_REST = 1.0
"""A wheel that turns by less than STILL in so long is at rest [s]."""
STILL = math.radians(1.0)
FEWEST = 30
"""Samples that are needed to tell anything."""
AWAY = math.radians(1.0)
"""A trial is followed from a sample at which both wheels are so far from striking."""
RATE_ENOUGH = 100.0
"""Of faster trials neighbours are taken together [Hz]: strikes are still told from each other, and time and memory go
with the number of samples."""
NEAR = 0.15
"""The speed at the start is first taken from samples within this [s]."""


class Samples(NamedTuple):
    """A trial from one sample to another: T of them."""

    seconds: Floats
    """Since the first, shape (T,)."""
    rotations: Floats
    """ψ1 and ψ2 [rad], shape (T, 2); each from zero at the stance spoke of the first sample."""
    steps: int
    """n at the first sample."""
    begins: float
    """The first sample's time in the trial [s]."""

    def until(self, seconds: float) -> 'Samples':
        """The part that comes first."""
        count = max(int(np.searchsorted(self.seconds, seconds, side='right')), FEWEST)
        return self._replace(seconds=self.seconds[:count], rotations=self.rotations[:count])

    def first_state(self) -> Floats:
        """[θ1, ω1, θ2, ω2] about as they are at the first sample."""
        near = slice(0, max(int(np.searchsorted(self.seconds, NEAR)), 6))
        return np.ravel([np.polyfit(self.seconds[near], self.rotations[near, i], 1)[::-1] for i in range(2)])

    def noise(self) -> float:
        """Standard deviation of what differs from sample to sample, of one angle [rad].

        From third differences, which know nothing of a smooth motion; the median leaves out strikes and outliers.
        """
        differences = np.diff(self.rotations, n=3, axis=0)
        return float(np.median(np.abs(differences))) / (0.6745 * math.sqrt(20.0))


def free_rolling(rig: RigParams, seconds: Floats, rotations: Floats) -> Samples:
    """The part of a trial in which both wheels roll, from a sample at which none is about to strike.

    Args:
        rig: whose wheels they are.
        seconds: shape (N,), ascending.
        rotations: ψ1 and ψ2 [rad], shape (N, 2); NaN where a sample has none.

    Raises:
        ValueError: too little is left.

    """
    seen = np.isfinite(rotations).all(axis=1)
    seconds, rotations = _together(seconds[seen], rotations[seen])
    end = _first_rest(seconds, rotations)
    alphas = np.array([rig.front.alpha, rig.rear.alpha])
    of_wheels = [stance(alpha, psi) for alpha, psi in zip(alphas, rotations.T, strict=True)]
    spokes, thetas = (np.stack(columns, axis=1) for columns in zip(*of_wheels, strict=True))
    calm = np.flatnonzero((np.abs(thetas[:end]) < alphas - AWAY).all(axis=1))
    if not calm.size or end - calm[0] < FEWEST:
        raise ValueError(f'both wheels roll in {counted(max(end, 0), "sample")} only: nothing can be told of them')
    first = int(calm[0])
    ahead = spokes[:, 0] - spokes[:, 1] - (spokes[0, 0] - spokes[0, 1])
    behind = thetas[0, 0] / (2.0 * alphas[0]) < thetas[0, 1] / (2.0 * alphas[1])  # p in [0, 1): the front is to strike
    return Samples(
        seconds[first:end] - seconds[first],
        rotations[first:end] - 2.0 * alphas * spokes[first],
        int(ahead[first]) + int(behind),
        float(seconds[first]),
    )


def _together(seconds: Floats, rotations: Floats) -> tuple[Floats, Floats]:
    """Medians of so many neighbours that they come no oftener than RATE_ENOUGH, as far as no gap lies among them.

    A rotation grows, so that the median of an odd number is that of the middle, also where a strike lies between; what
    one sensor reads wrongly now and then it leaves out.
    """
    spacing = float(np.median(np.diff(seconds))) if len(seconds) > 1 else math.inf
    count = (round(1.0 / (spacing * RATE_ENOUGH)) - 1) // 2 * 2 + 1 if spacing > 0.0 else 1
    if count < 3:
        return seconds, rotations
    whole = len(seconds) // count * count
    times = seconds[:whole].reshape(-1, count)
    close = times[:, -1] - times[:, 0] < count * spacing
    return np.median(times, axis=1)[close], np.median(rotations[:whole].reshape(-1, count, 2), axis=1)[close]


def _first_rest(seconds: Floats, rotations: Floats) -> int:
    """How many samples come before a wheel is at rest."""
    later = np.searchsorted(seconds, seconds + AT_REST)
    whole = np.flatnonzero(later < len(seconds))
    ends = np.abs(rotations[later[whole] - 1] - rotations[whole])
    for index in whole[(ends < STILL).any(axis=1) & (later[whole] - whole > 2)]:
        if (np.ptp(rotations[index : later[index]], axis=0) < STILL).any():
            return int(index)
    return len(seconds)

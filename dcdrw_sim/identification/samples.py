"""The samples of a trial, as far as its wheels roll by themselves."""

import math
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter, minimum_filter1d

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.rolling import stance
from dcdrw_msgs_py.values import Floats, Mask
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
NEIGHBOURS, BY_NOISE = 7, 6.0
"""A sample further from the median of so many than a wheel turns meanwhile, and so many times the noise, is wild."""


class Samples(NamedTuple):
    """A trial from one sample to another: T of them."""

    seconds: Floats
    """Since the first, shape (T,)."""
    rotations: Floats
    """ψ1 and ψ2 [rad], shape (T, 2); each from zero at the stance spoke of the first sample."""
    plausible: Mask
    """Which of them are not wild, whatever the rig: the others tell nothing. Shape (T, 2)."""
    steps: int
    """n at the first sample."""
    begins: float
    """The first sample's time in the trial [s]."""

    def until(self, seconds: float) -> 'Samples':
        """The part that comes first."""
        count = max(int(np.searchsorted(self.seconds, seconds, side='right')), FEWEST)
        return self._replace(
            seconds=self.seconds[:count], rotations=self.rotations[:count], plausible=self.plausible[:count]
        )

    def first_state(self) -> Floats:
        """[θ1, ω1, θ2, ω2] about as they are at the first sample."""
        count, found = max(int(np.searchsorted(self.seconds, NEAR)), 6), []
        for plausible, psi in zip(self.plausible.T, self.rotations.T, strict=True):
            near = np.flatnonzero(plausible)[:count]
            found.append(np.polyfit(self.seconds[near], psi[near], 1)[::-1])
        return np.ravel(found)

    def noise(self) -> float:
        """Standard deviation of what differs from sample to sample, of one angle [rad].

        From third differences, which know nothing of a smooth motion; the median leaves out strikes and outliers.
        """
        differences = np.diff(np.where(self.plausible, self.rotations, np.nan), n=3, axis=0)
        differences = differences[np.isfinite(differences)]
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
    if len(seconds) < FEWEST:
        raise _too_few(len(seconds))
    level = median_filter(rotations, (NEIGHBOURS, 1), mode='reflect')
    plausible = _plausible(rotations, level)
    likely = np.where(plausible, rotations, level)
    end = _first_rest(seconds, likely)
    alphas = np.array([rig.front.alpha, rig.rear.alpha])
    of_wheels = [stance(alpha, psi) for alpha, psi in zip(alphas, likely.T, strict=True)]
    spokes, thetas = (np.stack(columns, axis=1) for columns in zip(*of_wheels, strict=True))
    calm = np.flatnonzero((plausible[:end] & (np.abs(thetas[:end]) < alphas - AWAY)).all(axis=1))
    if not calm.size or end - calm[0] < FEWEST:
        raise _too_few(end)
    first = int(calm[0])
    ahead = spokes[:, 0] - spokes[:, 1] - (spokes[0, 0] - spokes[0, 1])
    behind = thetas[0, 0] / (2.0 * alphas[0]) < thetas[0, 1] / (2.0 * alphas[1])  # p in [0, 1): the front is to strike
    return Samples(
        seconds[first:end] - seconds[first],
        rotations[first:end] - 2.0 * alphas * spokes[first],
        plausible[first:end],
        int(ahead[first]) + int(behind),
        float(seconds[first]),
    )


def _too_few(count: int) -> ValueError:
    return ValueError(f'both wheels roll in {counted(count, "sample")} only: nothing can be told of them')


def _plausible(rotations: Floats, level: Floats) -> Mask:
    """Which rotations lie where their neighbours do, whose median is the level; shapes (N, 2)."""
    away = np.abs(rotations - level)
    turned = maximum_filter1d(level, NEIGHBOURS, axis=0) - minimum_filter1d(level, NEIGHBOURS, axis=0)
    return np.asarray(away <= turned + BY_NOISE * np.median(away, axis=0) / 0.6745)


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

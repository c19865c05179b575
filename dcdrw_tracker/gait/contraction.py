"""Convergence per step, from the errors at successive strikes: its ratio has this one estimator."""

import math
from collections.abc import Sequence
from typing import NamedTuple

WINDOW = 24
"""Steps over which the ratio is taken."""
LEAST_STEPS = 5
"""Fewer errors tell no ratio."""
LARGEST_UNCERTAINTY = 0.05
"""A ratio with a larger standard error is not told."""


def contraction(errors: Sequence[float]) -> float:
    """The ratio ρ of the affine fit e[k+1] = ρ e[k] + c: the fixed point need not be at 0.

    Least squares with the error before, e[k−1], as instrument: exact without noise, and unlike the plain fit not
    pulled towards 0 by noise, which e[k−1] does not share with e[k].

    Args:
        errors: errors at successive strikes, oldest first, in any unit.

    Returns:
        ρ, or NaN where the errors are too few, or too small beside their noise, to tell it.

    """
    count = len(errors) - 2
    if count < LEAST_STEPS - 2:
        return math.nan
    before, now, after = _centred(errors[:-2]), _centred(errors[1:-1]), _centred(errors[2:])
    correlation = _dot(before, now)
    if correlation == 0.0:
        return math.nan
    ratio = _dot(before, after) / correlation
    rest = [y - ratio * x for x, y in zip(now, after, strict=True)]
    uncertainty = math.sqrt(_dot(rest, rest) / (count - 2) * _dot(before, before)) / abs(correlation)
    return ratio if uncertainty <= LARGEST_UNCERTAINTY else math.nan


def _centred(values: Sequence[float]) -> list[float]:
    middle = sum(values) / len(values)
    return [value - middle for value in values]


def _dot(one: Sequence[float], other: Sequence[float]) -> float:
    return sum(x * y for x, y in zip(one, other, strict=True))


class Decay(NamedTuple):
    """Where a geometric decay of known ratio tends: e[k] = limit + start · ratio^(k − first)."""

    limit: float = math.nan
    """The limit, in the unit of the errors; NaN, as `start`, where it tends nowhere."""
    start: float = math.nan
    """Distance from the limit at the first error that was looked at."""
    ratio: float = math.nan
    first: int = 0
    """Index of that error."""


def fit_decay(errors: Sequence[float], ratio: float) -> Decay:
    """The decay of a given ratio through the last WINDOW errors, by least squares.

    Args:
        errors: errors at successive strikes, oldest first [% of a step].
        ratio: as `contraction` tells it, of the same errors.

    """
    recent = errors[-WINDOW:]
    if not 0.0 < ratio < 1.0 or len(recent) < LEAST_STEPS:
        return Decay(ratio=ratio)
    powers = [ratio**step for step in range(len(recent))]
    basis = _centred(powers)
    start = _dot(basis, _centred(recent)) / _dot(basis, basis)
    limit = (sum(recent) - start * sum(powers)) / len(recent)
    if abs(limit) > 50.0:  # a straight line fits any errors with a limit far away, which no phase can have
        return Decay(ratio=ratio)
    return Decay(limit, start, ratio, len(errors) - len(recent))

"""How the error of a trial dies out from step to step: a limit, and what a step leaves of the distance to it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

LEAST_STEPS = 5
"""Fewer errors tell no decay."""
LARGEST_UNCERTAINTY = 0.05
"""A ratio with a larger standard error is not told."""
SMALLEST_CHANGE = 1e-6
"""Errors that differ by less tell no decay, either [% of a step]."""


class Decay(NamedTuple):
    """e[k] = limit + start · ratio^k; NaN where it cannot be told."""

    limit: float = math.nan
    """[% of a step]"""
    start: float = math.nan
    """Distance from the limit at the first strike [% of a step]."""
    ratio: float = math.nan

    def __call__(self, steps: NDArray[np.float64]) -> NDArray[np.float64]:
        """The error at each step, counted from the first strike on."""
        return np.asarray(self.limit + self.start * self.ratio**steps)


def fit_decay(errors: Sequence[float]) -> Decay:
    """Fit one geometric decay to the errors at successive strikes: least squares over all of them.

    Args:
        errors: of a trial, in percent of a step.

    """
    count = len(errors)
    from scipy.optimize import least_squares  # slow to import, and few commands need it

    steps, values = np.arange(count), np.array(errors, float)
    if count < LEAST_STEPS or np.ptp(values) < SMALLEST_CHANGE:
        return Decay()

    def misfit(ratio: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is left when limit and start, which enter linearly, are the best for this ratio."""
        basis = np.column_stack([np.ones(count), ratio[0] ** steps])
        return np.asarray(values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0])

    found = min((least_squares(misfit, [guess], bounds=(0.0, 1.0)) for guess in (0.5, 0.9)), key=lambda one: one.cost)
    ratio = float(found.x[0])
    slope = float(found.jac[:, 0] @ found.jac[:, 0])
    if slope == 0.0 or math.sqrt(2.0 * found.cost / (count - 3) / slope) > LARGEST_UNCERTAINTY or not 0.0 < ratio < 1.0:
        return Decay()
    limit, start = np.linalg.lstsq(np.column_stack([np.ones(count), ratio**steps]), values, rcond=None)[0]
    # A straight line fits any errors with a limit far away, which no phase can have.
    return Decay(float(limit), float(start), ratio) if abs(limit) <= 50.0 else Decay()

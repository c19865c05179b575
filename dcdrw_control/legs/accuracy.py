"""How well heel strikes and phase agree with the truth, as motion capture or a force plate tells it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dcdrw_msgs_py.values import Floats

CLOSE = 0.015
"""A heel strike that is found so near the true one is exact [s]: motion capture itself tells it to about 10 ms."""
SAME = 0.2
"""One that is found so near it is the same [s]: a fifth of a stride."""


class StrikeAccuracy(NamedTuple):
    """Heel strikes found against true ones."""

    found: int
    missed: int
    """True ones with none found near them."""
    false: int
    """Found between the first and the last true one, with no true one near."""
    close: float
    """Share of the true ones that were found within 15 ms."""
    mean: float
    """How late those found are, on average [s]."""
    deviation: float
    """Their standard deviation [s]."""


def judge_strikes(found: ArrayLike, truth: ArrayLike) -> StrikeAccuracy:
    """Hold heel strikes against the true ones, both in seconds and in the order of time."""
    found, truth = np.asarray(found, float), np.asarray(truth, float)
    within = found[(found > truth[0] - SAME) & (found < truth[-1] + SAME)]
    if not len(within):
        return StrikeAccuracy(0, len(truth), 0, 0.0, np.nan, np.nan)
    late = within[np.abs(within[:, None] - truth).argmin(axis=0)] - truth
    hits = np.abs(late) < SAME
    false = np.abs(within[:, None] - truth).min(axis=1) >= SAME
    doubled = len(within) - int(false.sum()) - int(hits.sum())
    return StrikeAccuracy(
        int(hits.sum()),
        int((~hits).sum()),
        int(false.sum()) + max(doubled, 0),
        float(np.mean(np.abs(late) <= CLOSE)),
        float(np.mean(late[hits])),
        float(np.std(late[hits])),
    )


def phase_error(seconds: ArrayLike, strides: ArrayLike, truth: ArrayLike) -> Floats:
    """Error of a phase against the true one, which goes evenly from heel strike to heel strike.

    Args:
        seconds: times of the phase, (N,).
        strides: the phase [strides], (N,); whole strides do not count.
        truth: true heel strikes [s], (M,).

    Returns:
        the error in strides, within ±0.5, (N,); NaN before the first and after the last true strike.

    """
    seconds, strides, truth = (np.asarray(values, float) for values in (seconds, strides, truth))
    true = np.interp(seconds, truth, np.arange(len(truth)), left=np.nan, right=np.nan)
    return np.asarray((strides - true + 0.5) % 1.0 - 0.5)

"""From where a pair comes into step: its basin of attraction over the phase and the speed at the start."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.start import starts
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.study.regimes import bisect, judge_starts
from dcdrw_sim.study.verdict import Judgement, Verdict

Floats = NDArray[np.float64]

SECONDS = 400.0
"""How long to simulate, in √(ℓ/g)."""
HALVINGS = 20


class Basin(NamedTuple):
    """What becomes of a pair from a grid of starts: P phases, Q speeds."""

    phases: Floats
    """In steps, shape (P,)."""
    speeds: Floats
    """Of both wheels, as parts of those of their uncoupled limit cycles, shape (Q,)."""
    verdicts: NDArray[np.int8]
    """`Verdict`, shape (P, Q)."""
    steps: Floats
    """Until |θ2| stays within the band; NaN where it does not settle. Shape (P, Q)."""


def basin(rig: RigParams, phases: ArrayLike, speeds: ArrayLike, seconds: float) -> Basin:
    """Judge a pair from every phase at every speed.

    Args:
        rig: the rig; derived defaults are filled in.
        phases: in steps, shape (P,), as `dcdrw_sim.model.start.starts`.
        speeds: of both wheels, as parts of those of their uncoupled limit cycles, shape (Q,).
        seconds: how long to simulate.

    Raises:
        ValueError: an impossible rig, or a slope on which its wheels do not roll by themselves.

    """
    across, up = np.meshgrid(np.asarray(phases, float), np.asarray(speeds, float), indexing='ij')
    found = judge_from(rig, across.ravel(), up.ravel(), seconds)
    return Basin(across[:, 0], up[0], found.verdict.reshape(across.shape), found.steps.reshape(across.shape))


def judge_from(rig: RigParams, phases: ArrayLike, speeds: ArrayLike, seconds: float) -> Judgement:
    """What becomes of a pair from each of N phases and speeds.

    Args:
        rig: as the other arguments, those of `basin`.
        phases: shape (N,).
        speeds: shape (N,).
        seconds: how long to simulate.

    Raises:
        ValueError: as `basin`.

    """
    states = starts(rig, phases, speeds)
    return judge_starts(spread(rig, len(states), {}), states, seconds)


def least_speeds(rig: RigParams, phases: ArrayLike, seconds: float) -> Floats:
    """The least part of the limit cycles' speeds from which a pair walks on, at each phase; shape (P,).

    By bisection between 0 and 1; NaN where it does not walk on from 1.

    Args:
        rig: as the other arguments, those of `basin`.
        phases: in steps, shape (P,).
        seconds: how long to simulate.

    Raises:
        ValueError: as `basin`.

    """
    across = np.asarray(phases, float)

    def walks(speeds: Floats) -> NDArray[np.bool_]:
        walking: NDArray[np.bool_] = judge_from(rig, across, speeds, seconds).verdict <= Verdict.ELSEWHERE
        return walking

    return bisect(walks, np.ones_like(across), np.zeros_like(across), HALVINGS)

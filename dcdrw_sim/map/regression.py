"""The paper's regression on section states, and beside it the exact multipliers and the steps that trials take.

The paper fits x[k+1] = A x[k] to the four raw states x = [θ1′, θ2, θ2′, D] of several trials: A = B P, with
P⁻¹ = Σ x[k] x[k]ᵀ and B = Σ x[k+1] x[k]ᵀ. Since θ1′, θ2′ and D do not vanish at the fixed point x*, A x* = x*: the
fit has an eigenvalue 1 whatever the coupler, and the largest one tells nothing (erratum 5). Fitted with an offset,
x[k+1] = A x[k] + c, the same data give the multipliers.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dcdrw_msgs_py.values import Floats
from dcdrw_sim.map.limit_cycles import search_fixed_point
from dcdrw_sim.map.return_map import Complexes, FixedPoint, NoReturnError, ReturnMap, spectrum
from dcdrw_sim.motion.ends import FORWARD
from dcdrw_sim.motion.ensemble import run_pairs, spread

RANK_TOLERANCE = 1e-10
"""Directions of the data below this fraction of the largest count as absent, and A is 0 along them."""
TRIAL_PHASES = tuple(j / 10 for j in range(1, 10))
"""Where the nine trials start, in steps."""
STEPS = 100
"""Steps of each trial; the paper's 200 √(ℓ/g) are about as many."""
BAND = math.radians(1.0)
"""Within this of its fixed point, θ2 has converged [rad]."""


class Regression(NamedTuple):
    """x[k+1] = A x[k] + c, fitted by least squares."""

    matrix: Floats
    """A, shape (n, n)."""
    offset: Floats
    """c, shape (n,); 0 in the paper's form."""
    rank: int
    """Directions that the data hold; where fewer than n, A is the smallest of those that fit."""
    singular_values: Floats
    """Singular values of the data, largest first: the roots of the eigenvalues of P⁻¹."""

    @property
    def eigenvalues(self) -> Complexes:
        """Eigenvalues of A, those of largest modulus first."""
        return spectrum(self.matrix)

    @property
    def condition(self) -> float:
        """Condition number of P⁻¹, whose inverse the paper takes; infinite where there is none."""
        least = self.singular_values[-1] if len(self.singular_values) else 0.0
        return float((self.singular_values[0] / least) ** 2) if least else math.inf


class MapTrial(NamedTuple):
    """A motion from the uncoupled limit cycles at a phase."""

    phase: float
    """Phase at the start, in steps."""
    states: Floats
    """States at each section, rows [θ1′, θ2, θ2′], shape (steps + 1, 3); empty where the motion ended before."""
    steps_to_cycle: int | None
    """Steps until θ2 at the section stays within BAND of the fixed point; None if it never does."""
    trouble: str
    """Why the motion did not go on, else empty."""


class Convergence(NamedTuple):
    """How fast a pair falls into step, by every measure."""

    fixed_point: FixedPoint
    """The fixed point, with the multipliers of the exact derivative."""
    raw: Regression | None
    """The paper's, on the trials' four states; None where no trial went through all its steps."""
    affine: Regression | None
    """The regression with an offset, on the three states that are independent; None as `raw`."""
    trials: tuple[MapTrial, ...]


def fit_raw(trajectories: Iterable[ArrayLike], tolerance: float = RANK_TOLERANCE) -> Regression:
    """The paper's A = B P on states as they are, without offset.

    Args:
        trajectories: states of each trial, shape (M, n), as `ReturnMap.raw` gives them; M may differ.
        tolerance: as RANK_TOLERANCE.

    Raises:
        ValueError: no trajectory of two states or more.

    """
    before, after = _pairs(trajectories)
    origin = np.zeros(before.shape[1])
    return _fit(before, after, origin, origin, tolerance)


def fit_affine(
    trajectories: Iterable[ArrayLike], about: ArrayLike | None = None, tolerance: float = RANK_TOLERANCE
) -> Regression:
    """The fit with an offset: A on deviations from the fixed point or, where that is not given, from the mean.

    Args:
        trajectories: states of each trial, shape (M, n), as `ReturnMap.iterate` gives them; M may differ.
        about: the fixed point, shape (n,), for the fit to go exactly through.
        tolerance: as RANK_TOLERANCE.

    Raises:
        ValueError: no trajectory of two states or more.

    """
    before, after = _pairs(trajectories)
    if about is None:
        return _fit(before, after, before.mean(axis=0), after.mean(axis=0), tolerance)
    fixed = np.asarray(about, float)
    return _fit(before, after, fixed, fixed, tolerance)


def _pairs(trajectories: Iterable[ArrayLike]) -> tuple[Floats, Floats]:
    """All x[k] and the x[k+1] that follow them, shape (N, n) each."""
    arrays = [np.asarray(states, float) for states in trajectories]
    arrays = [states for states in arrays if len(states) > 1]
    if not arrays:
        raise ValueError('a regression needs a trajectory of at least two section states')
    return np.concatenate([states[:-1] for states in arrays]), np.concatenate([states[1:] for states in arrays])


def _fit(before: Floats, after: Floats, center: Floats, image: Floats, tolerance: float) -> Regression:
    """Least squares of after − image = A (before − center)."""
    solution, _, rank, singular_values = np.linalg.lstsq(before - center, after - image, rcond=tolerance)
    matrix = solution.T
    return Regression(matrix, image - matrix @ center, int(rank), np.asarray(singular_values, float))


def steps_to_stay(values: ArrayLike, target: float, band: float = BAND) -> int | None:
    """Steps until values, one per step from 0 on, stay within a band about a target; None if they end outside."""
    inside = np.abs(np.asarray(values, float) - target) <= band
    steps = len(inside) - int(np.argmin(np.append(inside[::-1], False)))
    return steps if steps < len(inside) else None


def measure(
    return_map: ReturnMap,
    phases: Sequence[float] = TRIAL_PHASES,
    steps: int = STEPS,
    fixed_point: FixedPoint | None = None,
) -> Convergence:
    """Measure convergence by every means: derivative, regressions, and counting.

    The regressions take the trials that went through all their steps.

    Args:
        return_map: the map.
        phases: starts of the trials, as `ReturnMap.at_phase`.
        steps: of each trial.
        fixed_point: where it is known already; else it is searched from several phases.

    Raises:
        ValueError: no fixed point, or an impossible phase.

    """
    fixed_point = fixed_point or search_fixed_point(return_map)
    trials = tuple(_trials(return_map, phases, steps, fixed_point.state.theta2))
    whole = [trial.states for trial in trials if not trial.trouble]
    if not whole:
        return Convergence(fixed_point, None, None, trials)
    return Convergence(fixed_point, fit_raw(map(return_map.raw, whole)), fit_affine(whole), trials)


def _trials(return_map: ReturnMap, phases: Sequence[float], steps: int, target: float) -> Iterator[MapTrial]:
    """A trial from each phase: all side by side, and once more step by step where one ends before its time."""
    starts = np.array([[return_map.rig.front.alpha, *return_map.at_phase(phase)] for phase in phases])
    wheels = np.resize([1, 2], 2 * steps + 1)  # a section is the instant before a strike of the front wheel
    motions = run_pairs(spread(return_map.rig, len(phases), {}), starts, math.inf, len(wheels), strict=False)
    for phase, strikes in zip(phases, motions.strikes, strict=True):
        if (strikes['wheel'] == wheels).all() and (strikes['direction'] == FORWARD).all():
            yield _trial(phase, strikes['state'][::2, 1:], target)
        else:
            yield _try(return_map, phase, steps, target)


def _try(return_map: ReturnMap, phase: float, steps: int, target: float) -> MapTrial:
    start = return_map.at_phase(phase)
    try:
        return _trial(phase, return_map.iterate(start, steps), target)
    except NoReturnError as error:
        return MapTrial(phase, np.empty((0, 3)), None, str(error))


def _trial(phase: float, states: Floats, target: float) -> MapTrial:
    return MapTrial(phase, states, steps_to_stay(states[:, 1], target), '')

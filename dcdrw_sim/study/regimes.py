"""Where a pair walks, and where it stalls: limits of existence by continuation, of verdicts and basins by bisection.

A limit cycle is followed along its period, with one parameter of the rig left free: from quick gaits to slow ones,
until the parameter turns back. There the stable gait meets an unstable one and both vanish (a fold: a multiplier of
the return map is 1), and beyond there is no gait: a wheel fails to pass its apex. In the period nothing is singular
there, and the fold is an extremum of a smooth curve.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.map.limit_cycles import DIFFERENCE, find_limit_cycles, step_maps
from dcdrw_sim.map.return_map import spectrum
from dcdrw_sim.model.rigs import Rigs, rig_at, take
from dcdrw_sim.model.start import starts
from dcdrw_sim.motion.ensemble import run_pairs, spread
from dcdrw_sim.relatives.even_gait import even_gait_on, even_pair, even_stall_band, gentlest_even_gait, worst_damping
from dcdrw_sim.study.points import ROCKING, section_room
from dcdrw_sim.study.verdict import Judgement, Verdict, judge

Bools = NDArray[np.bool_]

BASIN_SECONDS = 400.0
"""How long to simulate to tell from where a pair comes into step, in √(ℓ/g)."""
BASIN_HALVINGS = 20
DAMPING_FACTOR = 2.0
"""The limit cycle is followed from this many times the closed form's damping, on either side of the stall band."""
FALLBACK_BAND = (0.1, 10.0)
"""Stall band of b̂ that is assumed where the closed form has none."""
SLOPE_FACTOR = 1.5
"""The limit cycle is followed from this many times the closed form's slope."""
STRIDE, SMALLEST_STRIDE = 0.03, 1e-5
"""Fraction by which the period grows from gait to gait: at first, and where Newton fails with longer ones."""
MOST_STRIDES = 200
HALVINGS = 20
"""Halvings of the stride in which the fold lies: the parameter is left with the square of that error."""
NEWTON_STEPS, EXACT = 8, 1e-9
"""Iterations to a gait of given period, and what may be left, in rad, √(g/ℓ) and √(ℓ/g)."""
PEAK_ROUNDS, PEAK_POINTS = 3, 9
"""Rounds of the search for a maximum, and points of each: a round narrows it to two of eight intervals."""


class Gaits(NamedTuple):
    """Limit cycles of N pairs, each with its own value of the free parameter; NaN where none is known."""

    values: Floats
    """Values of the parameter, shape (N,)."""
    periods: Floats
    """Durations of a step [s], shape (N,)."""
    states: Floats
    """[θ1′, θ2, θ2′] at the section, shape (N, 3)."""
    tangents: Floats
    """How [θ1′, θ2, θ2′, parameter] change with the period, shape (N, 4)."""
    derivatives: Floats
    """Derivatives of the return map, shape (N, 3, 3)."""

    @property
    def multipliers(self) -> Floats:
        """Largest modulus, shape (N,): 1 at a fold."""
        largest, known = np.full(len(self.values), math.nan), np.isfinite(self.values)
        largest[known] = abs(spectrum(self.derivatives[known])[:, 0])
        return largest


def folds(rigs: Rigs, name: str, values: ArrayLike) -> Gaits:
    """Follow the limit cycle of each of N pairs to slower gaits, to the fold where it ends; NaN where there is none.

    Args:
        rigs: as `spread` gives them, of equal wheels.
        name: the parameter that is free: k, b, D0 or slope.
        values: where to begin, shape (N,).

    """
    values = np.asarray(values, float)
    rigs = rigs.with_column(name, values)
    begin = find_limit_cycles(rigs, _guesses(rigs))
    here = _gaits(rigs, name, begin.periods, np.column_stack([begin.states, values]))
    rising, strides = here.tangents[:, 3] > 0.0, STRIDE * here.periods
    beyond = here._replace(values=np.full_like(values, math.nan))
    for _ in range(MOST_STRIDES):
        ahead = _along(rigs, name, here, strides)
        found, turned = np.isfinite(ahead.values), (ahead.tangents[:, 3] > 0.0) != rising
        beyond = _where(np.isnan(beyond.values) & found & turned, ahead, beyond)
        here = _where(np.isnan(beyond.values) & found, ahead, here)
        strides = np.where(found, strides, 0.5 * strides)
        if not (np.isnan(beyond.values) & (strides > SMALLEST_STRIDE * here.periods)).any():
            break
    known = np.isfinite(beyond.values)
    for _ in range(HALVINGS if known.any() else 0):
        middle = _along(rigs, name, here, 0.5 * (beyond.periods - here.periods))
        turned = (middle.tangents[:, 3] > 0.0) != rising
        here, beyond = _where(~turned, middle, here), _where(turned, middle, beyond)
    return _where(known, here, Gaits(*(np.full_like(part, math.nan) for part in here)))


def gentlest_slopes(rigs: Rigs) -> Gaits:
    """The slope [rad] above which each of N pairs has a stable limit cycle.

    Args:
        rigs: as `folds`; their slope has no meaning.

    """
    pairs = [even_pair(rig_at(rigs, i)) for i in range(len(rigs.k))]
    return folds(
        rigs,
        'slope',
        [SLOPE_FACTOR * gentlest_even_gait(pair.alpha, pair.k, pair.b, pair.kept).slope for pair in pairs],
    )


def stall_bands(rigs: Rigs) -> tuple[Gaits, Gaits]:
    """The dampings b [N·s/m] between which each of N pairs has no limit cycle on its slope: lower and upper ends.

    Both are NaN where there is no such band, because the slope is steep enough for any damper.

    Args:
        rigs: as `folds`; their damping has no meaning.

    """
    ends = np.empty((len(rigs.k), 2))
    for i, end in enumerate(ends):
        rig = rig_at(rigs, i)
        pair = even_pair(rig)
        low, high = even_stall_band(pair.alpha, pair.k, rig.slope, pair.kept) or FALLBACK_BAND
        end[:] = pair.damping * low / DAMPING_FACTOR, pair.damping * high * DAMPING_FACTOR
    return folds(rigs, 'b', ends[:, 0]), folds(rigs, 'b', ends[:, 1])


def steepest_stall(rig: RigParams) -> tuple[float, float]:
    """The damping [N·s/m] that needs the steepest slope, and that slope [rad]: on a steeper one no damper stalls."""
    pair = even_pair(rig)
    center, width = math.log(worst_damping(pair.alpha, pair.k, pair.kept)), math.log(2.0)
    for _ in range(PEAK_ROUNDS):
        logs = np.linspace(center - width, center + width, PEAK_POINTS)
        slopes = gentlest_slopes(spread(rig, PEAK_POINTS, {'b': pair.damping * np.exp(logs)})).values
        if np.isnan(slopes).any():
            return math.nan, math.nan
        center, width = float(logs[slopes.argmax()]), 2.0 * width / (PEAK_POINTS - 1)
    return pair.damping * math.exp(center), float(slopes.max())


def judge_starts(rigs: Rigs, states: Floats, seconds: float) -> Judgement:
    """What becomes of N pairs.

    Args:
        rigs: as `spread` gives them.
        states: a start of each, shape (N, 4).
        seconds: how long to simulate.

    """
    capacity = 4 * section_room(rigs, seconds) + ROCKING
    return judge(run_pairs(rigs, states, seconds, capacity, strict=False, extremes=True), rigs, 1)[0]


def bisect(holds: Callable[[Floats], Bools], inside: ArrayLike, outside: ArrayLike, halvings: int) -> Floats:
    """The edge of what holds inside and not outside, N of them side by side; NaN where that is not so.

    Args:
        holds: of each of N values.
        inside: values where it holds, shape (N,).
        outside: values where it does not.
        halvings: of the bracket.

    Returns:
        The last values where it holds, shape (N,).

    """
    inner, outer = np.array(inside, float), np.array(outside, float)
    known = holds(inner) & ~holds(outer)
    for _ in range(halvings):
        middle = 0.5 * (inner + outer)
        good = holds(middle)
        inner, outer = np.where(good, middle, inner), np.where(good, outer, middle)
    return np.where(known, inner, math.nan)


def stall_edges(
    rigs: Rigs, name: str, inside: ArrayLike, outside: ArrayLike, states: Floats, seconds: float, halvings: int = 20
) -> Floats:
    """The value of a parameter up to which all of a pair's starts walk on, of N pairs; NaN where there is no edge.

    Args:
        rigs: as `spread` gives them.
        name: the parameter: k, b or D0.
        inside: its value where all starts walk, shape (N,).
        outside: its value where one stalls, or worse.
        states: the starts of each pair, shape (N, M, 4).
        seconds: how long to simulate.
        halvings: of the bracket.

    """
    count, each = states.shape[:2]

    def walk(values: Floats) -> Bools:
        pairs = take(rigs.with_column(name, values), np.repeat(np.arange(count), each))
        found = judge_starts(pairs, states.reshape(-1, 4), seconds).verdict
        return np.asarray((found <= Verdict.ELSEWHERE).reshape(count, each).all(axis=1))

    return bisect(walk, inside, outside, halvings)


class Basin(NamedTuple):
    """What becomes of a pair from a grid of starts: P phases, Q speeds."""

    phases: Floats
    """Phases of the starts, in steps, shape (P,)."""
    speeds: Floats
    """Speeds of both wheels, as fractions of those of their uncoupled limit cycles, shape (Q,)."""
    verdicts: NDArray[np.int8]
    """`Verdict`, shape (P, Q)."""
    steps: Floats
    """To synchronization; NaN where the pair is not in step at the end. Shape (P, Q)."""
    strike_steps: Floats
    """The same by the strikes of the front wheel alone. Shape (P, Q)."""


def basin(rig: RigParams, phases: ArrayLike, speeds: ArrayLike, seconds: float) -> Basin:
    """Judge a pair from every phase at every speed.

    Args:
        rig: the rig; derived defaults are filled in.
        phases: in steps, shape (P,), as `dcdrw_sim.model.start.starts`.
        speeds: of both wheels, as fractions of those of their uncoupled limit cycles, shape (Q,).
        seconds: how long to simulate.

    Raises:
        ValueError: an impossible rig, or a slope on which its wheels do not roll by themselves.

    """
    across, up = np.meshgrid(np.asarray(phases, float), np.asarray(speeds, float), indexing='ij')
    found = judge_from(rig, across.ravel(), up.ravel(), seconds)
    judged = (found.verdict, found.steps, found.strike_steps)
    return Basin(across[:, 0], up[0], *(values.reshape(across.shape) for values in judged))


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
    """The least fraction of the limit cycles' speeds from which a pair walks on, at each phase; shape (P,).

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

    return bisect(walks, np.ones_like(across), np.zeros_like(across), BASIN_HALVINGS)


def _along(rigs: Rigs, name: str, gaits: Gaits, more: Floats) -> Gaits:
    """The gaits whose periods are longer by so much [s]; NaN where Newton's method finds none from here."""
    unknowns = np.column_stack([gaits.states, gaits.values]) + more[:, None] * gaits.tangents
    return _gaits(rigs, name, gaits.periods + more, unknowns)


def _gaits(rigs: Rigs, name: str, periods: Floats, unknowns: Floats) -> Gaits:
    """The gaits of given periods, by Newton's method from a guess of [θ1′, θ2, θ2′, parameter], shape (N, 4)."""
    unit = np.sqrt(rigs.gravity / rigs.front.length)
    scales = np.column_stack([unit, np.ones_like(unit), unit, abs(unknowns[:, 3])])
    for _ in range(NEWTON_STEPS):
        residuals, jacobians = _linearize(rigs, name, periods, unknowns, scales)
        size = np.sqrt(((residuals / np.column_stack([unit, np.ones_like(unit), unit, 1.0 / unit])) ** 2).sum(axis=1))
        inverses = np.full_like(jacobians, math.nan)
        regular = np.isfinite(jacobians).all(axis=(1, 2))
        inverses[regular] = np.linalg.pinv(jacobians[regular])
        if not (size > EXACT).any():
            break
        unknowns = unknowns - scales * (inverses @ residuals[:, :, None])[:, :, 0]
    tangents = scales * inverses[:, :, 3]
    derivatives = jacobians[:, :3, :3] / scales[:, None, :3] + np.eye(3)
    found = size <= EXACT
    return _where(
        found,
        Gaits(unknowns[:, 3], periods, unknowns[:, :3], tangents, derivatives),
        Gaits(*(np.full_like(part, math.nan) for part in (periods, periods, tangents[:, :3], tangents, derivatives))),
    )


def _linearize(rigs: Rigs, name: str, periods: Floats, unknowns: Floats, scales: Floats) -> tuple[Floats, Floats]:
    """Distance by which a step misses the start, and the period, shape (N, 4); and its derivative, shape (N, 4, 4)."""
    kicks = DIFFERENCE * scales
    around = unknowns + np.concatenate([np.zeros((1, 4)), np.eye(4), -np.eye(4)])[:, None] * kicks  # (9, N, 4)
    which = np.tile(np.arange(len(periods)), 9)
    states, values = around[:, :, :3].reshape(-1, 3), around[:, :, 3].ravel()
    steps = step_maps(take(rigs, which).with_column(name, values), states, np.arange(len(which)))
    misses = np.column_stack([steps.states - states, steps.periods - periods[which]]).reshape(9, -1, 4)
    return misses[0], np.moveaxis((misses[1:5] - misses[5:]) / (2.0 * DIFFERENCE), 0, 2)


def _guesses(rigs: Rigs) -> Floats:
    """Where to search each limit cycle, shape (N, 3): at the gait of evenly spaced strikes."""
    guesses = np.empty((len(rigs.k), 3))
    for i in range(len(guesses)):
        rig = rig_at(rigs, i)
        pair = even_pair(rig)
        even = (pair.alpha, pair.k, pair.b)
        gait = even_gait_on(*even, rig.slope, pair.kept) or gentlest_even_gait(*even, pair.kept)
        guesses[i] = gait.omega1 / pair.time, gait.theta2, gait.omega2 / pair.time
    return guesses


def _where(which: Bools, one: Gaits, other: Gaits) -> Gaits:
    """For each pair the one gait or the other."""
    return Gaits(*(np.where(which.reshape(-1, *[1] * (a.ndim - 1)), a, b) for a, b in zip(one, other, strict=True)))

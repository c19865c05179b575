"""Limit cycles of many pairs at once: Newton's method on the compiled return map, speed and losses on the cycle.

The map is that of `dcdrw_sim.map.return_map`; here its derivative comes from central differences of the compiled
motion, with an error of about 1e-9, thousands of pairs in the time of one by the variational equations.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.values import Floats, each
from dcdrw_sim.map.return_map import (
    NEWTON_TOLERANCE,
    PROGRESS,
    SINGULAR,
    Complexes,
    FixedPoint,
    ReturnMap,
    SectionState,
    spectrum,
)
from dcdrw_sim.model.rigs import Rigs, take
from dcdrw_sim.model.wheel import kept, kinetic_energy
from dcdrw_sim.motion.ends import FORWARD, End
from dcdrw_sim.motion.ensemble import run_pairs, spread

LIMIT = 30
"""Iterations of the search; from a motion that has settled it takes two or three."""
DIFFERENCE = 3e-6
"""Half width of the central differences, in rad and √(g/ℓ)."""
NEUTRAL = 1e-6
"""A multiplier so close to 1 counts as 1."""
SEARCHED = tuple(j / 24 for j in range(24))
"""Phases from which a limit cycle is searched, in steps."""
FOLLOWED, MOST_STRIKES = 400.0, 2000
"""How long motions are followed to where the search may begin, in √(ℓ/g), and by how many strikes at most."""
EQUAL = 1e-9
"""Steps whose lengths differ by no more than this part are of one length."""


class LimitCycles(NamedTuple):
    """The limit cycles of N pairs; NaN where none was found."""

    states: Floats
    """[θ1′, θ2, θ2′] at the section, shape (N, 3)."""
    derivatives: Floats
    """Derivatives of the map, shape (N, 3, 3)."""
    periods: Floats
    """A step's time [s], shape (N,)."""
    omega2: Floats
    """Speed of the rear wheel just before its strike [rad/s], shape (N,)."""
    swings: Floats
    """Least and greatest error 100 (p − 0.5) at any instant of a step [%], exactly, shape (N, 2)."""

    @property
    def found(self) -> NDArray[np.bool_]:
        """Which were found, shape (N,)."""
        return np.isfinite(self.periods)

    @property
    def multipliers(self) -> Complexes:
        """Eigenvalues of the derivatives, the largest first, shape (N, 3)."""
        values = np.full((len(self.periods), 3), complex(math.nan, math.nan))
        values[self.found] = spectrum(self.derivatives[self.found])
        return values

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Whether every small deviation dies out, shape (N,)."""
        stable: NDArray[np.bool_] = abs(self.multipliers[:, 0]) < 1.0 - NEUTRAL
        return stable


class Losses(NamedTuple):
    """How fast N pairs walk on their limit cycles, and where the slope's energy goes; shape (N,) each.

    Per metre the slope gives (m1 + m2) g sin γ, of which strikes and damper take all: on the cycle nothing is stored.
    """

    speed: Floats
    """Mean, down the slope [m/s]."""
    strikes: Floats
    """Energy lost at the strikes of both wheels [J/m]: ½ m ℓ² ω² (1 − η²) each."""
    damper: Floats
    """Energy lost in the damper and in friction [J/m]: what the strikes leave."""


class _Steps(NamedTuple):
    """One step of each map; NaN where the motion does not return."""

    states: Floats
    periods: Floats
    omega2: Floats
    swings: Floats


def find_limit_cycles(rigs: Rigs, starts: Floats) -> LimitCycles:
    """The limit cycle of each of N pairs near a start: as `ReturnMap.fixed_point`, all pairs side by side.

    The result of a pair does not depend on the others.

    Args:
        rigs: as `dcdrw_sim.motion.ensemble.spread` gives them, each parameter of shape (N,).
        starts: section states [θ1′, θ2, θ2′], shape (N, 3); a pair whose start is NaN is passed over, and so is one
            whose wheels step differently far: its feet never come back to the same distance.

    """
    count, unit = len(starts), np.sqrt(rigs.gravity / rigs.front.length)
    scales = np.column_stack([unit, np.ones(count), unit])
    found = LimitCycles(
        np.full((count, 3), math.nan),
        np.full((count, 3, 3), math.nan),
        np.full(count, math.nan),
        np.full(count, math.nan),
        np.full((count, 2), math.nan),
    )
    sigma1, sigma2 = rigs.front.step_length, rigs.rear.step_length
    sought = np.flatnonzero(np.isfinite(starts).all(axis=1) & (abs(sigma1 - sigma2) <= EQUAL * sigma1))
    here = np.array(starts, float)
    for _ in range(LIMIT):
        if not sought.size:
            break
        there, derivatives = _linearize(rigs, here, scales, sought)
        change = there.states - here[sought]
        left = _size(change / scales[sought])
        known = np.isfinite(left) & np.isfinite(derivatives).all(axis=(1, 2))
        done = (left < NEWTON_TOLERANCE) & known
        at = sought[done]
        found.states[at], found.derivatives[at] = here[at], derivatives[done]
        found.periods[at], found.omega2[at] = there.periods[done], there.omega2[done]
        found.swings[at] = there.swings[done]
        alive = ~done & known
        sought, change, left = sought[alive], change[alive], left[alive]
        if not sought.size:
            break
        # As `ReturnMap`: Newton's step where it is progress, else the map's own.
        candidates = here[sought] + _least_squares(np.eye(3) - derivatives[alive], change)
        after = step_maps(rigs, candidates, sought).states
        progress = _size((after - candidates) / scales[sought]) < np.maximum(PROGRESS * left, NEWTON_TOLERANCE)
        here[sought] = np.where(progress[:, None], candidates, there.states[alive])
    return found


def search_fixed_point(return_map: ReturnMap, phases: Sequence[float] = SEARCHED) -> FixedPoint:
    """The limit cycle of one pair, searched from several phases at once; a stable one where there is one.

    Of several it is the one that was found from the phase nearest to one half.

    Args:
        return_map: the pair's.
        phases: where to begin, as `ReturnMap.at_phase`.

    Raises:
        ValueError: from none of the phases a limit cycle was found, or no phase tells how to start.

    """
    rigs = spread(return_map.rig, len(phases), {})
    states = np.array([return_map.at_phase(phase) for phase in phases])
    found = find_limit_cycles(rigs, states)
    if not found.stable.any():  # as far as the motions lead, and on from there
        unit = math.sqrt(return_map.rig.front.length / return_map.rig.gravity)
        section = np.column_stack([rigs.front.alpha, states])
        motion = run_pairs(rigs, section, FOLLOWED * unit, MOST_STRIKES, strict=False)
        for index, count in enumerate(motion.counts):
            fronts = motion.strikes[index, :count][motion.strikes[index, :count]['wheel'] == 1]
            states[index] = fronts['state'][-1, 1:]
        later = find_limit_cycles(rigs, states)
        found = LimitCycles(*(np.concatenate(pair) for pair in zip(found, later, strict=True)))
    known = np.flatnonzero(found.found)
    if not known.size:
        raise ValueError(
            f'no fixed point was found from {len(phases)} phases: the pair has no limit cycle, or starts too far off'
        )
    distance = abs(np.resize(np.asarray(phases, float), len(found.found)) - 0.5)
    best = min(known.tolist(), key=lambda index: (not found.stable[index], distance[index]))
    return return_map.fixed_point(SectionState(*found.states[best].tolist()))


def losses(rigs: Rigs, cycles: LimitCycles) -> Losses:
    """Speed and energy on the limit cycles; NaN where there is none.

    Args:
        rigs: as of `find_limit_cycles`.
        cycles: what that found.

    """
    sigma, lost = rigs.front.step_length, np.zeros(len(cycles.periods))
    for wheel, omega in ((rigs.front, cycles.states[:, 0]), (rigs.rear, cycles.omega2)):
        lost = lost + kinetic_energy(wheel, omega) * (1.0 - kept(wheel) ** 2)
    gain = (rigs.front.mass + rigs.rear.mass) * rigs.gravity * each(math.sin, rigs.slope)
    return Losses(sigma / cycles.periods, lost / sigma, gain - lost / sigma)


def _linearize(rigs: Rigs, states: Floats, scales: Floats, which: NDArray[np.intp]) -> tuple[_Steps, Floats]:
    """A step of some pairs, and its derivatives by central differences, shape (n, 3, 3)."""
    here, kicks = states[which], DIFFERENCE * scales[which]
    shifts = np.concatenate([np.eye(3), -np.eye(3)])[:, None] * kicks  # (6, n, 3)
    around = np.concatenate([here[None], here + shifts]).reshape(-1, 3)
    steps = step_maps(rigs, around, np.tile(which, 7))
    mapped = steps.states.reshape(7, -1, 3)
    columns = (mapped[1:4] - mapped[4:]) / (2.0 * kicks.T[:, :, None])
    base = slice(len(which))
    return _Steps(*(part[base] for part in steps)), np.moveaxis(columns, 0, 2)


def step_maps(rigs: Rigs, states: Floats, which: NDArray[np.intp]) -> _Steps:
    """One step of the map from each state, of the pairs that `which` names; NaN where the motion does not return."""
    some = take(rigs, which)
    omega1, theta2, _ = states.T
    possible = np.isfinite(states).all(axis=1) & (omega1 > 0.0) & (abs(theta2) <= some.rear.alpha)
    some, states = take(some, possible), states[possible]
    motion = run_pairs(some, np.column_stack([some.front.alpha, states]), math.inf, 3, strict=False, extremes=True)
    first, rear, last = motion.strikes.T
    returns = (
        (motion.ends == End.STRIKES)
        & (motion.strikes['direction'] == FORWARD).all(axis=1)
        & (first['wheel'] == 1)
        & (rear['wheel'] == 2)
        & (last['wheel'] == 1)
    )
    count = len(which)
    result = _Steps(*(np.full(shape, math.nan) for shape in ((count, 3), count, count, (count, 2))))
    at = np.flatnonzero(possible)[returns]
    result.states[at], result.periods[at] = last['state'][returns, 1:], last['t'][returns]
    result.omega2[at] = rear['state'][returns, 3]
    # The strike of the rear wheel between the two parts of the step puts θ1/2α1 − θ2/2α2 up by a step.
    low, high = np.minimum(rear['low'], last['low'] - 1.0), np.maximum(rear['high'], last['high'] - 1.0)
    least = (100.0 * low[returns]) % 100.0 - 50.0
    result.swings[at] = np.column_stack([least, least + 100.0 * (high - low)[returns]])
    return result


def _least_squares(matrices: Floats, right: Floats) -> Floats:
    """The shortest x that solves A x = y as well as can be, of n systems; shape (n, 3).

    By sums of products: a matrix product may round a system in another way where it stands among others.
    """
    u, sizes, vt = np.linalg.svd(matrices)
    along = (u * right[:, :, None]).sum(axis=1)
    along = np.where(sizes > SINGULAR * sizes[:, :1], along / np.where(sizes > 0.0, sizes, 1.0), 0.0)
    solution: Floats = (vt * along[:, :, None]).sum(axis=1)
    return solution


def _size(changes: Floats) -> Floats:
    """Length of each row."""
    size: Floats = np.sqrt((changes * changes).sum(axis=1))
    return size

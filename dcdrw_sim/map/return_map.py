"""The Poincaré map of the pair, from one strike of the front wheel to the next: steps, derivative, fixed point.

The section is the instant before a strike of the front wheel, θ1 = α1, where n = 0 and S = S0. The coupler's length
is a function of θ2 there, so three coordinates are left, not the paper's four (erratum 4).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.map.variation import motion_derivative, rates
from dcdrw_sim.model.dynamics import State, hub_distance
from dcdrw_sim.model.start import starts
from dcdrw_sim.motion.ends import FORWARD, End, accept
from dcdrw_sim.motion.trajectory import WHEELS, Run, run

Complexes = NDArray[np.complex128]

NEWTON_TOLERANCE = 1e-12
"""Change over a step, in rad and √(g/ℓ), below which a point counts as fixed."""
MAX_ITERATIONS = 200
"""Limit of the search for a fixed point."""
PROGRESS = 0.5
"""Newton's step is taken where it cuts the change over a step to this fraction of what it was."""
SINGULAR = 1e-10
"""Smallest singular value, of the largest, along which Newton's step is taken."""
NEUTRAL = 1e-9
"""A multiplier so close to 1 counts as 1: the deviation stays."""


class NoReturnError(ValueError):
    """The motion does not come back to the section, or with a step slipped."""


class SectionState(NamedTuple):
    """The pair at the instant before a strike of the front wheel."""

    omega1: float
    """[rad/s]"""
    theta2: float
    """[rad]"""
    omega2: float
    """[rad/s]"""


class Return(NamedTuple):
    """One step of the map, with its derivative."""

    state: SectionState
    """After the step."""
    derivative: Floats
    """Derivative of that state by the one before, shape (3, 3)."""
    by_force: Floats
    """Derivative of that state by a constant external force, shape (3,) [per N]."""
    period: float
    """How long the step took [s]."""


class FixedPoint(NamedTuple):
    """A limit cycle of the pair, where it passes the section."""

    state: SectionState
    derivative: Floats
    """Derivative of the map, shape (3, 3)."""
    by_force: Floats
    """How the state at the next section changes with a constant external force, shape (3,) [per N]."""
    period: float
    """A step's time [s]."""
    iterations: int
    """How many it took to find it."""

    @property
    def multipliers(self) -> Complexes:
        """Eigenvalues of the derivative, the largest first, shape (3,): by these a deviation shrinks per step."""
        return spectrum(self.derivative)

    @property
    def stable(self) -> bool:
        """Whether every small deviation dies out."""
        return bool(abs(self.multipliers[0]) < 1.0 - NEUTRAL)

    @property
    def steps_per_decade(self) -> float:
        """Steps until a small deviation is a tenth; infinite where it stays or grows."""
        return math.log(0.1) / math.log(max(abs(self.multipliers[0]), 1e-300)) if self.stable else math.inf


class ReturnMap:
    """The map of a rig, stepped from section to section.

    Args:
        rig: the rig; derived defaults are filled in.
        external_force: a constant force that adds to the coupler's [N], positive in tension.

    Raises:
        ValueError: impossible parameters, or wheels that step differently far, so that S never comes back.

    """

    def __init__(self, rig: RigParams, external_force: float = 0.0) -> None:
        self.rig, self._force = accept(rig), external_force
        sigma1, sigma2 = self.rig.front.step_length, self.rig.rear.step_length
        if abs(sigma1 - sigma2) > 1e-9 * sigma1:
            raise ValueError(
                f'a return map needs wheels of equal step length 2 ℓ sin α, got {sigma1:.6g} m in front '
                f'and {sigma2:.6g} m in the rear: their feet never come back to the same distance'
            )
        unit = math.sqrt(self.rig.gravity / self.rig.front.length)
        self._scale = np.array([unit, 1.0, unit])

    def step(self, state: SectionState) -> SectionState:
        """The state at the next section.

        Raises:
            NoReturnError: a wheel stands, falls, stalls, rocks back or slips a step, or the hubs meet.
            ValueError: a state that is not on the section.

        """
        return _section_of(self._run(state))

    def linearize(self, state: SectionState) -> Return:
        """A step and its exact derivative, by the variational equation with its jumps at the strikes.

        Raises:
            ValueError: as `step`.

        """
        result = self._run(state)
        last = result.segments[-1]
        flow = rates(self.rig, result.strikes[-1].state, self.rig.S0, self._force)
        at_time = motion_derivative(self.rig, result.segments, self._force)
        on_section = at_time - np.outer(flow / flow[0], at_time[0])  # the deviation where θ1 is α1 again
        return Return(_section_of(result), on_section[1:4, 1:4], on_section[1:4, 4], last.end)

    def iterate(self, start: SectionState, steps: int) -> Floats:
        """The states from a start on, each a row [θ1′, θ2, θ2′], shape (steps + 1, 3).

        Raises:
            ValueError: as `step`.

        """
        states = [start]
        for _ in range(steps):
            states.append(self.step(states[-1]))
        return np.array(states, float)

    def fixed_point(self, start: SectionState | None = None, limit: int = MAX_ITERATIONS) -> FixedPoint:
        """The fixed point to which Newton's method leads from a start, by default `at_phase` 0.5.

        Where Newton's step does not at least halve what is left, the map itself is stepped instead: the motion
        leads to where Newton's method converges, while ever shorter parts of its step end where a wheel slips.

        Raises:
            NoReturnError: the motion from the start or on the way does not come back to the section.
            ValueError: none was found, or the start is impossible.

        """
        try:
            return self._search(self.at_phase(0.5) if start is None else start, limit)
        except NoReturnError as error:
            raise NoReturnError(f'no fixed point was found: {error}') from None

    def _search(self, here: SectionState, limit: int) -> FixedPoint:
        there = self.linearize(here)
        for iteration in range(limit):
            if self._distance(here, there.state) < NEWTON_TOLERANCE:
                return FixedPoint(here, there.derivative, there.by_force, there.period, iteration)
            here, there = self._newton(here, there) or (there.state, self.linearize(there.state))
        raise ValueError(
            f'no fixed point was found in {limit} iterations; the last state, {_text(here)}, still changes '
            f'by {self._distance(here, there.state):.2g} in a step: start elsewhere, or the pair has no limit cycle'
        )

    def _newton(self, here: SectionState, there: Return) -> tuple[SectionState, Return] | None:
        """Newton's step and the map there, where that is progress."""
        change = np.subtract(there.state, here)
        # By least squares: without a coupler every phase is fixed, and the system singular.
        correction = np.linalg.lstsq(np.eye(3) - there.derivative, change, rcond=SINGULAR)[0]
        candidate = SectionState(*(here + correction).tolist())
        try:
            result = self.linearize(candidate)
        except ValueError:  # too far
            return None
        progress = self._distance(candidate, result.state) < PROGRESS * self._distance(here, there.state)
        return (candidate, result) if progress else None

    def at_phase(self, phase: float) -> SectionState:
        """The section at a phase p in [0, 1), each wheel at the speed of its uncoupled limit cycle: θ2 = α2 (1 − 2 p).

        Raises:
            ValueError: as `starts`.

        """
        if not 0.0 <= phase < 1.0:
            raise ValueError(f'phase must be in [0, 1), got {phase}')
        return SectionState(*starts(self.rig, phase)[1:].tolist())

    def phase(self, state: SectionState) -> float:
        """The gait phase difference p at the section, in steps; the goal is 0.5."""
        return 0.5 - state.theta2 / (2.0 * self.rig.rear.alpha)

    def raw(self, states: ArrayLike) -> Floats:
        """The paper's four section states: rows [θ1′, θ2, θ2′] to rows [θ1′, θ2, θ2′, D]."""
        rows = np.asarray(states, float)
        omega1, theta2, omega2 = rows.T
        front = np.full(theta2.shape, self.rig.front.alpha)
        length = hub_distance(self.rig, State(front, omega1, theta2, omega2), self.rig.S0)
        return np.column_stack([rows, length])

    def _run(self, state: SectionState) -> Run:
        """The motion through a strike of the front wheel, one of the rear, and up to the next of the front."""
        if not state.omega1 > 0.0:
            raise ValueError(f'omega1 at the section must be > 0, got {state.omega1}')
        result = run(self.rig, State(self.rig.front.alpha, *state), strikes=3, external_force=self._force)
        if trouble := _trouble(result):
            raise NoReturnError(f'the step from {_text(state)} does not come back to the section: {trouble}')
        return result

    def _distance(self, one: SectionState, other: SectionState) -> float:
        """Free of units."""
        return float(np.linalg.norm(np.subtract(one, other) / self._scale))


def spectrum(matrix: Floats) -> Complexes:
    """Eigenvalues of a matrix, or of each of many, shape (..., n, n); those of largest modulus first."""
    values = np.linalg.eigvals(matrix).astype(complex)
    order = np.lexsort((-values.imag, -abs(values)))
    ordered: Complexes = np.take_along_axis(values, order, -1)
    return ordered


def _section_of(result: Run) -> SectionState:
    _, omega1, theta2, omega2 = map(float, result.strikes[-1].state)
    return SectionState(omega1, theta2, omega2)


def _trouble(result: Run) -> str:
    """Why a run is not a step of the map; empty where it is."""
    for strike in result.strikes:
        if strike.direction != FORWARD:
            return f'the {WHEELS[strike.wheel - 1]} wheel did not pass its apex and rocked back'
    if result.end is not End.STRIKES:
        return result.reason
    for (wheel, *_), (following, *_) in zip(result.strikes, result.strikes[1:], strict=False):
        if wheel == following:
            n = 1 if wheel == 1 else -1
            return f'the {WHEELS[2 - wheel]} wheel slipped a step (n = {n} at the section)'
    return ''


def _text(state: SectionState) -> str:
    omega1, theta2, omega2 = state
    return f'θ1′ = {omega1:.6g} rad/s, θ2 = {math.degrees(theta2):.6g}°, θ2′ = {omega2:.6g} rad/s'

"""How small deviations grow along a motion: the variational equation between strikes, and its jumps at them.

A deviation x of [θ1, ω1, θ2, ω2, F], the state and a constant external force in the coupler, follows x' = J x, J the
Jacobian of the paper's (1) and (2) along the motion; that of F stays. At a strike it jumps by the saltation matrix,
because a deviation also moves the strike's time (Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth
Mechanical Systems, 2004).
"""

from collections.abc import Sequence
from functools import reduce
from itertools import pairwise
from operator import matmul

import numpy as np
from numpy.polynomial import legendre

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.values import Floats, Real
from dcdrw_sim.model.dynamics import State, accelerations, coupler, coupler_force, grip_slope, reset, stance_distance
from dcdrw_sim.model.wheel import inertia, kept, pull
from dcdrw_sim.motion.pair import Segment

STAGES = 12
"""Points per segment of the Gauss-Legendre method: of order 24, so that rounding is what remains."""

_NODES, _WEIGHTS = legendre.leggauss(STAGES)
_PARTS = 0.5 * (_NODES + 1.0)
_LAGRANGE = np.linalg.inv(legendre.legvander(_NODES, STAGES - 1))
_INTEGRALS = 0.5 * legendre.legval(_NODES, legendre.legint(_LAGRANGE, lbnd=-1)).T
"""[i, j]: what a value at point j of the unit interval adds to the integral up to point i."""


def rates(rig: RigParams, state: State, S: Real, external_force: float = 0.0) -> Floats:
    """Rates of [θ1, ω1, θ2, ω2, F], shape (5,)."""
    acceleration1, acceleration2 = accelerations(rig, state, S, external_force)
    return np.array([state.omega1, acceleration1, state.omega2, acceleration2, 0.0])


def jacobian(rig: RigParams, state: State, S: Real, external_force: float = 0.0) -> Floats:
    """Derivatives of the rates by state and force, shape (..., 5, 5), at states and stance distances of shape (...)."""
    front, rear = rig.front, rig.rear
    l1, l2 = front.length, rear.length
    theta1, omega1, theta2, omega2 = np.broadcast_arrays(*state)
    length, rate, p1, p2 = coupler(rig, State(theta1, omega1, theta2, omega2), S)
    cos_difference, zero, one = np.cos(theta1 - theta2), np.zeros(theta1.shape), np.ones(theta1.shape)
    tension = (coupler_force(rig, length, rate) + external_force) / length

    # Gradients by [θ1, ω1, θ2, ω2, F]: of p1, p2, D, of D Ḋ = ℓ1 p1 ω1 − ℓ2 p2 ω2, and of F/D.
    by_p1 = np.array([l2 * cos_difference - S * np.sin(theta1), zero, -l2 * cos_difference, zero, zero])
    by_p2 = np.array([l1 * cos_difference, zero, -l1 * cos_difference - S * np.sin(theta2), zero, zero])
    by_length = np.array([l1 * p1, zero, -l2 * p2, zero, zero]) / length
    by_product = l1 * omega1 * by_p1 - l2 * omega2 * by_p2 + np.array([zero, l1 * p1, zero, -l2 * p2, zero])
    by_rate = (by_product - rate * by_length) / length
    damping = rig.b + rig.coupler_friction * grip_slope(rig, rate)
    by_force = rig.k * by_length + damping * by_rate + np.array([zero, zero, zero, zero, one])
    by_pull = (by_force - tension * by_length) / length

    slowing1, slowing2 = (
        rig.rolling_resistance * pull(wheel, rig.gravity) * wheel.length * grip_slope(rig, wheel.length * omega)
        for wheel, omega in ((front, omega1), (rear, omega2))
    )
    weight1 = pull(front, rig.gravity) * np.cos(theta1 + rig.slope)
    weight2 = pull(rear, rig.gravity) * np.cos(theta2 + rig.slope)
    rows = np.array(
        [
            [zero, one, zero, zero, zero],
            np.array([weight1, -slowing1, zero, zero, zero]) - (tension * by_p1 + p1 * by_pull) * (l1 / inertia(front)),
            [zero, zero, zero, one, zero],
            np.array([zero, zero, weight2, -slowing2, zero]) + (tension * by_p2 + p2 * by_pull) * (l2 / inertia(rear)),
            [zero, zero, zero, zero, zero],
        ]
    )
    return np.moveaxis(rows, (0, 1), (-2, -1))


def propagators(rig: RigParams, segments: Sequence[Segment], external_force: float = 0.0) -> Floats:
    """What each of N segments does to a deviation, shape (N, 5, 5).

    By collocation at Gauss points c_i, where all is known of the motion: X_i = 1 + h Σ_j a_ij J_j X_j, solved for
    all points of a segment at once.
    """
    durations = np.array([segment.end - segment.start for segment in segments])
    states = np.array(
        [segment.at(segment.start + duration * _PARTS) for segment, duration in zip(segments, durations, strict=True)]
    )
    S = np.array([[stance_distance(rig, *segment.steps)] for segment in segments])
    growth = durations[:, None, None, None] * jacobian(rig, State(*np.moveaxis(states, 1, 0)), S, external_force)
    size = 5 * STAGES
    system = np.eye(size) - np.einsum('ij,njab->niajb', _INTEGRALS, growth).reshape(-1, size, size)
    start = np.tile(np.eye(5), (1, STAGES, 1))  # with all three axes: numpy 1 takes two for a row of vectors
    deviations = np.linalg.solve(system, start).reshape(growth.shape)
    total: Floats = np.eye(5) + np.einsum('j,njab,njbc->nac', 0.5 * _WEIGHTS, growth, deviations)
    return total


def jump(rig: RigParams, before: Segment, after: Segment, external_force: float = 0.0) -> Floats:
    """What the strike between two segments does to a deviation, shape (5, 5): the saltation matrix.

    R + (f₊ − R f₋) nᵀ / (nᵀ f₋): R the derivative of the strike rule, f the rates, nᵀ x the striking angle. The
    identity where no wheel strikes.
    """
    matrix = np.eye(5)
    f_before, f_after = (
        rates(rig, segment.at(time), stance_distance(rig, *segment.steps), external_force)
        for segment, time in ((before, before.end), (after, after.start))
    )
    for i, wheel in enumerate((rig.front, rig.rear)):
        direction = after.steps[i] - before.steps[i]
        if direction:
            _, matrix[2 * i + 1, 2 * i + 1] = reset(wheel.alpha, kept(wheel), 1.0, direction)
            matrix[:, 2 * i] += (f_after - matrix @ f_before) / f_before[2 * i]
    return matrix


def motion_derivative(rig: RigParams, segments: Sequence[Segment], external_force: float = 0.0) -> Floats:
    """Derivative of [θ1, ω1, θ2, ω2, F] at the end of the last segment by that at the start of the first, shape (5, 5).

    Both at fixed times, with a constant external force [N]; the rig's derived defaults are filled in. A strike at the
    end of the last segment is not in it yet.
    """
    jumps = [jump(rig, *pair, external_force) for pair in pairwise(segments)]
    factors = [
        matrix
        for pair in zip(propagators(rig, segments, external_force), [*jumps, np.eye(5)], strict=True)
        for matrix in pair
    ]
    return reduce(matmul, reversed(factors))

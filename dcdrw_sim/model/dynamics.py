"""The physics of the coupled wheels between strikes, each quantity one small function.

Scalars or arrays of equal shape; SI units, or none (m = ℓ = g = 1). Equation numbers are the paper's.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_msgs_py.rolling import hub_offset
from dcdrw_msgs_py.rolling import stance_distance as _stance_distance
from dcdrw_msgs_py.values import Real, functions_of
from dcdrw_sim.model.wheel import inertia, kinetic_energy, pull

NO_TORQUES = (0.0, 0.0)


class State(NamedTuple):
    """Stance angles [rad] and speeds [rad/s] of the front (1) and rear (2) wheel."""

    theta1: Real
    omega1: Real
    theta2: Real
    omega2: Real


class Coupler(NamedTuple):
    """Where the coupler is: length D [m], its rate Ḋ [m/s], and the levers p_i = D cos(θ_i + β) [m]."""

    length: Real
    rate: Real
    p1: Real
    p2: Real


def stance_distance(rig: RigParams, steps1: Real, steps2: Real) -> Real:
    """S = S0 + n1 σ1 − n2 σ2 [m] (13)."""
    return _stance_distance(rig.front, rig.rear, rig.S0, steps1, steps2)


def hub_distance(rig: RigParams, state: State, S: Real) -> Real:
    """D [m] at stance distance S (4), (5), (7)."""
    dx, dy = hub_offset(rig.front, rig.rear, state.theta1, state.theta2)
    return functions_of(dx).hypot(dx + S, dy)


def coupler(rig: RigParams, state: State, S: Real) -> Coupler:
    """Length, rate and levers of the coupler at stance distance S, where the hubs do not meet (4)–(12)."""
    theta1, omega1, theta2, omega2 = state
    l1, l2, functions = rig.front.length, rig.rear.length, functions_of(theta1)
    sin_difference, length = functions.sin(theta1 - theta2), hub_distance(rig, state, S)
    p1 = l2 * sin_difference + S * functions.cos(theta1)
    p2 = l1 * sin_difference + S * functions.cos(theta2)
    return Coupler(length, (l1 * p1 * omega1 - l2 * p2 * omega2) / length, p1, p2)


def coupler_force(rig: RigParams, length: Real, rate: Real) -> Real:
    """F = k (D − D0) + b Ḋ + F_c tanh(Ḋ/v0) [N], positive in tension (3), (contract §5)."""
    return rig.k * (length - rig.D0) + rig.b * rate + rig.coupler_friction * grip(rig, rate)


def grip(rig: RigParams, speed: Real) -> Real:
    """tanh(v/v0), the part of a dry friction that a speed [m/s] brings to bear, with its sign."""
    return functions_of(speed).tanh(speed / rig.friction_speed)


def grip_slope(rig: RigParams, speed: Real) -> Real:
    """Derivative of `grip` by the speed [s/m]."""
    return (1.0 - grip(rig, speed) ** 2) / rig.friction_speed


def resistance(rig: RigParams, wheel: WheelParams, omega: Real) -> Real:
    """What rolling resistance takes of an angular acceleration [rad/s²]: c_r m g ℓ tanh(ℓ ω/v0) over the inertia."""
    return rig.rolling_resistance * pull(wheel, rig.gravity) * grip(rig, wheel.length * omega)


def accelerations(
    rig: RigParams, state: State, S: Real, external_force: Real = 0.0, torques: tuple[float, float] = NO_TORQUES
) -> tuple[Real, Real]:
    """θ̈1 and θ̈2 [rad/s²] (1), (2), for unequal wheels.

    `external_force` [N] adds to the coupler's; the torques [N·m] act on the hubs, positive downhill.
    """
    spring = coupler(rig, state, S)
    force = (coupler_force(rig, spring.length, spring.rate) + external_force) / spring.length
    front, rear, sin = rig.front, rig.rear, functions_of(state.theta1).sin
    return (
        pull(front, rig.gravity) * sin(state.theta1 + rig.slope)
        - resistance(rig, front, state.omega1)
        + (torques[0] - spring.p1 * force * front.length) / inertia(front),
        pull(rear, rig.gravity) * sin(state.theta2 + rig.slope)
        - resistance(rig, rear, state.omega2)
        + (torques[1] + spring.p2 * force * rear.length) / inertia(rear),
    )


def reset(alpha: float, kept: float, omega: float, direction: int) -> tuple[float, float]:
    """Angle and speed after a strike: rules A and B of the paper, and their mirror for a wheel that rolls back.

    Args:
        alpha: of the wheel [rad].
        kept: the fraction of its speed that a strike leaves it (`dcdrw_sim.model.wheel.kept`).
        omega: its speed before the strike [rad/s].
        direction: 1 forward, −1 backward.

    """
    return -direction * alpha, omega * kept


def tipping(
    rig: RigParams,
    i: int,
    state: State,
    steps: Sequence[int],
    external_force: float = 0.0,
    torques: tuple[float, float] = NO_TORQUES,
) -> float:
    """Acceleration at which a wheel at rest on two spokes is pushed over one of them [rad/s²].

    Positive over its forward spoke, negative over the one behind, 0 where weight and coupler press it on both.
    One that is lifted off both goes where it is pushed harder.

    Args:
        rig: the rig, its derived defaults filled in.
        i: 0 the front wheel, 1 the rear.
        state: the state, with this wheel's angle told from its forward spoke: −α.
        steps: n1, n2.
        external_force: added to the coupler's [N].
        torques: on the hubs, positive downhill [N·m].

    """
    behind = list(state)
    behind[2 * i] = -state[2 * i]
    S = stance_distance(rig, *steps)
    S_behind = stance_distance(rig, steps[0] - (i == 0), steps[1] - (i == 1))
    forward = float(accelerations(rig, state, S, external_force, torques)[i])
    backward = -float(accelerations(rig, State(*behind), S_behind, external_force, torques)[i])
    if max(forward, backward) <= 0.0:
        return 0.0
    return forward if forward >= backward else -backward


def mechanical_energy(rig: RigParams, state: State, steps1: Real, steps2: Real) -> Real:
    """Kinetic energy, weight and spring of the whole rig [J]; the rear wheel's first foothold is at height 0."""
    spring = coupler(rig, state, stance_distance(rig, steps1, steps2))
    energy, cos = 0.5 * rig.k * (spring.length - rig.D0) ** 2, functions_of(state.theta1).cos
    for wheel, theta, omega, foot in (
        (rig.front, state.theta1, state.omega1, rig.S0 + steps1 * rig.front.step_length),
        (rig.rear, state.theta2, state.omega2, steps2 * rig.rear.step_length),
    ):
        height = wheel.length * cos(theta + rig.slope) - foot * math.sin(rig.slope)
        energy = energy + kinetic_energy(wheel, omega) + wheel.mass * rig.gravity * height
    return energy


def damper_power(rig: RigParams, rate: Real) -> Real:
    """b Ḋ² + F_c Ḋ tanh(Ḋ/v0), what damper and friction of the coupler take [W]."""
    return rig.b * rate**2 + rig.coupler_friction * rate * grip(rig, rate)


def resistance_power(rig: RigParams, state: State) -> Real:
    """What the rolling resistance of both wheels takes [W]."""
    return sum(
        inertia(wheel) * resistance(rig, wheel, omega) * omega
        for wheel, omega in ((rig.front, state.omega1), (rig.rear, state.omega2))
    )

"""The physics of the coupled wheels between strikes, each quantity one small function.

Scalars or arrays of equal shape; SI units, or none (m = ℓ = g = 1). Equation numbers are the paper's.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from dcdrw_msgs_py.rig import RigParams, WheelParams


class State(NamedTuple):
    """Stance angles [rad] and speeds [rad/s] of the front (1) and rear (2) wheel."""

    theta1: Any
    omega1: Any
    theta2: Any
    omega2: Any


class Coupler(NamedTuple):
    """Where the coupler is: length D [m], its rate Ḋ [m/s], and the levers p_i = D cos(θ_i + β) [m]."""

    length: Any
    rate: Any
    p1: Any
    p2: Any


def stance_distance(rig: RigParams, steps1: Any, steps2: Any) -> Any:
    """S = S0 + n1 σ1 − n2 σ2 [m] (13)."""
    return rig.S0 + steps1 * rig.front.step_length - steps2 * rig.rear.step_length


def hub_distance(rig: RigParams, state: State, S: Any) -> Any:
    """D [m] at stance distance S (4), (5), (7)."""
    theta1, _, theta2, _ = state
    l1, l2, functions = rig.front.length, rig.rear.length, _functions(theta1)
    return functions.hypot(
        l1 * functions.sin(theta1) - l2 * functions.sin(theta2) + S,
        l1 * functions.cos(theta1) - l2 * functions.cos(theta2),
    )


def coupler(rig: RigParams, state: State, S: Any) -> Coupler:
    """Length, rate and levers of the coupler at stance distance S, where the hubs do not meet (4)–(12)."""
    theta1, omega1, theta2, omega2 = state
    l1, l2, functions = rig.front.length, rig.rear.length, _functions(theta1)
    sin_difference, length = functions.sin(theta1 - theta2), hub_distance(rig, state, S)
    p1 = l2 * sin_difference + S * functions.cos(theta1)
    p2 = l1 * sin_difference + S * functions.cos(theta2)
    return Coupler(length, (l1 * p1 * omega1 - l2 * p2 * omega2) / length, p1, p2)


def coupler_force(rig: RigParams, length: Any, rate: Any) -> Any:
    """F = k (D − D0) + b Ḋ [N], positive in tension (3)."""
    return rig.k * (length - rig.D0) + rig.b * rate


def accelerations(rig: RigParams, state: State, S: Any, external_force: Any = 0.0) -> tuple[Any, Any]:
    """θ̈1 and θ̈2 [rad/s²] (1), (2), for unequal wheels; `external_force` [N] adds to the coupler's."""
    spring = coupler(rig, state, S)
    pull = (coupler_force(rig, spring.length, spring.rate) + external_force) / spring.length
    front, rear, sin = rig.front, rig.rear, _functions(state.theta1).sin
    return (
        rig.gravity / front.length * sin(state.theta1 + rig.slope) - spring.p1 * pull / (front.mass * front.length),
        rig.gravity / rear.length * sin(state.theta2 + rig.slope) + spring.p2 * pull / (rear.mass * rear.length),
    )


def reset(alpha: float, omega: float, direction: int) -> tuple[float, float]:
    """Angle and speed after a strike: rules A and B of the paper, and their mirror for a wheel that rolls back.

    Angular momentum about the new stance foot is kept, so the speed falls by cos 2α.
    """
    return -direction * alpha, omega * math.cos(2.0 * alpha)


def tipping(rig: RigParams, i: int, state: State, steps: Sequence[int], external_force: float = 0.0) -> float:
    """Acceleration at which a wheel at rest on two spokes is pushed over one of them [rad/s²].

    Positive over its forward spoke, negative over the one behind, 0 where weight and coupler press it on both.
    One that is lifted off both goes where it is pushed harder.

    Args:
        rig: the rig, its derived defaults filled in.
        i: 0 the front wheel, 1 the rear.
        state: the state, with this wheel's angle told from its forward spoke: −α.
        steps: n1, n2.
        external_force: added to the coupler's [N].

    """
    behind = list(state)
    behind[2 * i] = -state[2 * i]
    S = stance_distance(rig, *steps)
    S_behind = stance_distance(rig, steps[0] - (i == 0), steps[1] - (i == 1))
    forward: float = accelerations(rig, state, S, external_force)[i]
    backward: float = -accelerations(rig, State(*behind), S_behind, external_force)[i]
    if max(forward, backward) <= 0.0:
        return 0.0
    return forward if forward >= backward else -backward


def kinetic_energy(wheel: WheelParams, omega: Any) -> Any:
    """½ m ℓ² ω² of one wheel [J]."""
    return 0.5 * wheel.mass * (wheel.length * omega) ** 2


def mechanical_energy(rig: RigParams, state: State, steps1: Any, steps2: Any) -> Any:
    """Kinetic energy, weight and spring of the whole rig [J]; the rear wheel's first foothold is at height 0."""
    spring = coupler(rig, state, stance_distance(rig, steps1, steps2))
    energy = 0.5 * rig.k * (spring.length - rig.D0) ** 2
    for wheel, theta, omega, foot in (
        (rig.front, state.theta1, state.omega1, rig.S0 + steps1 * rig.front.step_length),
        (rig.rear, state.theta2, state.omega2, steps2 * rig.rear.step_length),
    ):
        height = wheel.length * np.cos(theta + rig.slope) - foot * np.sin(rig.slope)
        energy = energy + kinetic_energy(wheel, omega) + wheel.mass * rig.gravity * height
    return energy


def damper_power(rig: RigParams, rate: Any) -> Any:
    """b Ḋ², what the damper takes [W]."""
    return rig.b * rate**2


def limit_cycle_speed(wheel: WheelParams, slope: float, gravity: float, theta: Any = None) -> Any:
    """Speed of the uncoupled wheel on its limit cycle [rad/s], at angle θ or, without one, just after a strike.

    After a strike ω₊² = cos²(2α) (4 g/ℓ) sin γ sin α / sin²(2α) (McGeer 1990): what the slope gives in a
    step is what the strike takes. NaN where the slope is too gentle for a limit cycle (`gentlest_slope`).
    """
    if not slope > gentlest_slope(wheel):
        return math.nan if theta is None else np.full(np.shape(theta), math.nan)[()]
    alpha, rate2 = wheel.alpha, gravity / wheel.length
    omega2 = 4.0 * rate2 * math.sin(slope) * math.sin(alpha) / math.tan(2.0 * alpha) ** 2
    if theta is None:
        return math.sqrt(omega2)
    return np.sqrt(omega2 + 2.0 * rate2 * (math.cos(slope - alpha) - np.cos(theta + slope)))


def gentlest_slope(wheel: WheelParams) -> float:
    """The slope [rad] above which an uncoupled wheel has a limit cycle: there it just passes its apex.

    ω₊² = 2 (g/ℓ) (1 − cos(γ − α)) with the closed form of ω₊ is cos α cos γ + (sin α + K) sin γ = 1,
    K = 2 sin α / tan²(2α).
    """
    x = math.cos(wheel.alpha)
    y = math.sin(wheel.alpha) * (1.0 + 2.0 / math.tan(2.0 * wheel.alpha) ** 2)
    return math.atan2(y, x) - math.acos(min(1.0 / math.hypot(x, y), 1.0))


def _functions(angle: Any) -> Any:
    """Sine and its kin: of plain numbers from `math`, a tenth of the cost."""
    return math if isinstance(angle, float) else np

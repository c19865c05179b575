"""The physics of the coupled wheels between strikes, each quantity one small function.

Scalars or arrays of equal shape; SI units, or none (m = ℓ = g = 1). Equation numbers are the paper's.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.rig import RigParams, WheelParams

Real = float | NDArray[np.float64]


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


def coupler(rig: RigParams, state: State, S: Any) -> Coupler:
    """Length, rate and levers of the coupler at stance distance S (4)–(12)."""
    theta1, omega1, theta2, omega2 = state
    l1, l2 = rig.front.length, rig.rear.length
    dx = l1 * np.sin(theta1) - l2 * np.sin(theta2) + S
    dy = l1 * np.cos(theta1) - l2 * np.cos(theta2)
    length = np.hypot(dx, dy)
    p1 = l2 * np.sin(theta1 - theta2) + S * np.cos(theta1)
    p2 = l1 * np.sin(theta1 - theta2) + S * np.cos(theta2)
    return Coupler(length, (l1 * p1 * omega1 - l2 * p2 * omega2) / length, p1, p2)


def coupler_force(rig: RigParams, length: Any, rate: Any) -> Any:
    """F = k (D − D0) + b Ḋ [N], positive in tension (3)."""
    return rig.k * (length - rig.D0) + rig.b * rate


def accelerations(rig: RigParams, state: State, S: Any, external_force: Any = 0.0) -> tuple[Any, Any]:
    """θ̈1 and θ̈2 [rad/s²] (1), (2), for unequal wheels; `external_force` [N] adds to the coupler's."""
    spring = coupler(rig, state, S)
    pull = (coupler_force(rig, spring.length, spring.rate) + external_force) / spring.length
    front, rear = rig.front, rig.rear
    return (
        rig.gravity / front.length * np.sin(state.theta1 + rig.slope) - spring.p1 * pull / (front.mass * front.length),
        rig.gravity / rear.length * np.sin(state.theta2 + rig.slope) + spring.p2 * pull / (rear.mass * rear.length),
    )


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
    step is what the strike takes. NaN where the wheel does not reach θ: the slope is too gentle.
    """
    alpha, rate2 = wheel.alpha, gravity / wheel.length
    omega2 = np.cos(2 * alpha) ** 2 * 4 * rate2 * np.sin(slope) * np.sin(alpha) / np.sin(2 * alpha) ** 2
    if theta is not None:
        omega2 = omega2 + 2 * rate2 * (np.cos(slope - alpha) - np.cos(theta + slope))
    with np.errstate(invalid='ignore'):
        return np.sqrt(omega2)

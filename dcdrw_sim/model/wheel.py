"""One wheel: what gravity does to it between strikes, what a strike leaves of its speed, and its own limit cycle."""

import math
from typing import overload

from dcdrw_msgs_py.rig import WheelParams
from dcdrw_msgs_py.rolling import speed_kept
from dcdrw_msgs_py.values import Floats, Real, functions_of
from dcdrw_sim.model.rigs import Wheels


@overload
def inertia(wheel: WheelParams) -> float: ...
@overload
def inertia(wheel: Wheels) -> Floats: ...
def inertia(wheel: WheelParams | Wheels) -> Real:
    """Moment of inertia about the stance foot, m ℓ² [kg·m²]."""
    return wheel.mass * wheel.length**2


@overload
def pull(wheel: WheelParams, gravity: float) -> float: ...
@overload
def pull(wheel: WheelParams | Wheels, gravity: Real) -> Real: ...
def pull(wheel: WheelParams | Wheels, gravity: Real) -> Real:
    """Gravity's hold on the wheel, m g ℓ over its inertia [1/s²]: θ̈ = pull · sin(θ + γ) without a coupler (1)."""
    return wheel.mass * gravity * wheel.length / inertia(wheel)


@overload
def kept(wheel: WheelParams) -> float: ...
@overload
def kept(wheel: Wheels) -> Floats: ...
def kept(wheel: WheelParams | Wheels) -> Real:
    """The fraction η of its speed that a strike leaves to the wheel: θ̇₊ = η θ̇₋ (15)."""
    return speed_kept(wheel.alpha)


def kinetic_energy(wheel: WheelParams | Wheels, omega: Real) -> Real:
    """½ m ℓ² ω² of one wheel [J]."""
    return 0.5 * inertia(wheel) * omega**2


@overload
def limit_cycle_speed(wheel: WheelParams, slope: float, gravity: float, theta: float | None = None) -> float: ...
@overload
def limit_cycle_speed(wheel: WheelParams, slope: float, gravity: float, theta: Floats) -> Floats: ...
def limit_cycle_speed(wheel: WheelParams, slope: float, gravity: float, theta: Real | None = None) -> Real:
    """Speed of the uncoupled wheel on its limit cycle [rad/s], at angle θ or, without one, just after a strike.

    After a strike ω₊² = η²/(1 − η²) · 4 (g/ℓ) sin γ sin α, η = cos 2α (McGeer 1990): what the slope gives in a step is
    what the strike takes. NaN where the slope is too gentle for a limit cycle (`gentlest_slope`).
    """
    theta = -wheel.alpha if theta is None else theta
    if not slope > gentlest_slope(wheel):
        return theta * math.nan
    alpha, rate2 = wheel.alpha, pull(wheel, gravity)
    omega2 = 4.0 * rate2 * math.sin(slope) * math.sin(alpha) * _regained(wheel)
    return (omega2 + 2.0 * rate2 * (math.cos(slope - alpha) - functions_of(theta).cos(theta + slope))) ** 0.5


def gentlest_slope(wheel: WheelParams) -> float:
    """The slope [rad] above which an uncoupled wheel has a limit cycle: there it just passes its apex.

    ω₊² = 2 (g/ℓ) (1 − cos(γ − α)) with the closed form of ω₊ is cos α cos γ + (1 + 2 η²/(1 − η²)) sin α sin γ = 1.
    """
    x = math.cos(wheel.alpha)
    y = math.sin(wheel.alpha) * (1.0 + 2.0 * _regained(wheel))
    return math.atan2(y, x) - math.acos(min(1.0 / math.hypot(x, y), 1.0))


def _regained(wheel: WheelParams) -> float:
    """η²/(1 − η²): the kinetic energy after a strike over what it has lost in it."""
    return kept(wheel) ** 2 / (1.0 - kept(wheel) ** 2)

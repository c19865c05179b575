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
    """Moment of inertia about the stance foot, m ℓ² (1 + r²) [kg·m²] (contract §5)."""
    return wheel.mass * wheel.length**2 * (1.0 + wheel.gyration**2)


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
    """The fraction η of its speed that a strike leaves to the wheel: θ̇₊ = η θ̇₋ (15), (contract §5)."""
    return speed_kept(wheel.alpha, wheel.gyration, wheel.restitution)


def kinetic_energy(wheel: WheelParams | Wheels, omega: Real) -> Real:
    """½ m ℓ² (1 + r²) ω² of one wheel [J]."""
    return 0.5 * inertia(wheel) * omega**2


@overload
def limit_cycle_speed(
    wheel: WheelParams, slope: float, gravity: float, theta: float | None = None, rolling_resistance: float = 0.0
) -> float: ...
@overload
def limit_cycle_speed(
    wheel: WheelParams, slope: float, gravity: float, theta: Floats, rolling_resistance: float = 0.0
) -> Floats: ...
@overload
def limit_cycle_speed(
    wheel: WheelParams, slope: float, gravity: float, theta: Real, rolling_resistance: float = 0.0
) -> Real: ...
def limit_cycle_speed(
    wheel: WheelParams, slope: float, gravity: float, theta: Real | None = None, rolling_resistance: float = 0.0
) -> Real:
    """Speed of the uncoupled wheel on its limit cycle [rad/s], at angle θ or, without one, just after a strike.

    After a strike ω₊² = η²/(1 − η²) · 4 pull (sin γ sin α − c_r α) (McGeer 1990): what the slope gives in a step is
    what strike and rolling resistance take, the wheel being much faster than v0. NaN where the slope is too gentle for
    a limit cycle (`gentlest_slope`).
    """
    alpha, rate2 = wheel.alpha, pull(wheel, gravity)
    theta = -alpha if theta is None else theta
    if not slope > gentlest_slope(wheel, rolling_resistance):
        return theta * math.nan
    omega2 = 4.0 * rate2 * _regained(wheel) * (math.sin(slope) * math.sin(alpha) - rolling_resistance * alpha)
    fallen = math.cos(slope - alpha) - functions_of(theta).cos(theta + slope) - rolling_resistance * (theta + alpha)
    return (omega2 + 2.0 * rate2 * fallen) ** 0.5


def gentlest_slope(wheel: WheelParams, rolling_resistance: float = 0.0) -> float:
    """The slope [rad] above which an uncoupled wheel has a limit cycle: there it just passes its apex.

    ω₊² = 2 pull (1 − cos(γ − α)) with the closed form of ω₊ is cos α cos γ + (1 + 2 η²/(1 − η²)) sin α sin γ = 1. With
    rolling resistance the apex is where sin(θ + γ) = c_r, and the condition is solved numerically.
    """
    alpha, regained, lean = wheel.alpha, _regained(wheel), math.asin(rolling_resistance)

    def spare(slope: float) -> float:
        """ω²/(2 pull) at the apex, but for resistance below v0."""
        climb = math.cos(lean) - math.cos(slope - alpha) + rolling_resistance * (lean - slope + alpha)
        return 2.0 * regained * (math.sin(slope) * math.sin(alpha) - rolling_resistance * alpha) - climb

    if rolling_resistance:
        from scipy.optimize import brentq  # half of a node's start-up, and seldom needed

        steepest = min(alpha + lean, 0.5 * math.pi)
        return float(brentq(spare, 0.0, steepest)) if spare(steepest) > 0.0 else math.inf
    x, y = math.cos(alpha), math.sin(alpha) * (1.0 + 2.0 * regained)
    return math.atan2(y, x) - math.acos(min(1.0 / math.hypot(x, y), 1.0))


def _regained(wheel: WheelParams) -> float:
    """η²/(1 − η²): the kinetic energy after a strike over what it has lost in it."""
    return kept(wheel) ** 2 / (1.0 - kept(wheel) ** 2)

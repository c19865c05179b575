"""One rimless wheel by itself (McGeer 1990; Coleman 1998), in closed form.

A point mass at the hub, massless spokes, a strike that keeps the angular momentum about the new stance foot. The
square of the speed just after a strike, ω₊², then follows an affine map, and everything else follows from that.
The limit cycle's speed and the gentlest slope are in `dcdrw_sim.model.wheel`.
Slopes γ ≥ 0; a negative one is a mirror.
"""

import math
from enum import Enum

from scipy.special import ellipkinc

from dcdrw_msgs_py.rig import WheelParams
from dcdrw_sim.model.wheel import gentlest_slope, kept, limit_cycle_speed, pull


class Fate(Enum):
    """What becomes of a wheel that is left alone."""

    ROLLS = 'rolls: it comes to its limit cycle'
    STANDS = 'stands: it rocks to rest on two spokes'


def multiplier(wheel: WheelParams) -> float:
    """η², η = cos 2α: what a strike leaves of ω², and a step of a small deviation from the limit cycle."""
    return kept(wheel) ** 2


def slope_gain(wheel: WheelParams, slope: float, gravity: float) -> float:
    """What the slope adds to ω² in a step: 4 (g/ℓ) sin γ sin α [rad²/s²]."""
    return 4.0 * pull(wheel, gravity) * math.sin(slope) * math.sin(wheel.alpha)


def speed_to_pass(wheel: WheelParams, slope: float, gravity: float, theta: float) -> float:
    """Least speed at an angle θ that carries the hub over its highest point [rad/s].

    √(2 (g/ℓ) (cos(θ_top + γ) − cos(θ + γ))), with θ_top = −γ upright, or −α where the slope is steeper than α.
    """
    top = -min(slope, wheel.alpha)
    height = math.cos(top + slope) - math.cos(theta + slope)
    return math.sqrt(2.0 * pull(wheel, gravity) * max(height, 0.0))


def next_speed(wheel: WheelParams, slope: float, gravity: float, omega: float) -> float:
    """The step map: ω₊ just after a strike → ω₊ just after the next, √(cos²(2α) (ω₊² + 4 (g/ℓ) sin γ sin α)) [rad/s].

    NaN where the wheel does not pass its highest point.
    """
    if not omega > speed_to_pass(wheel, slope, gravity, -wheel.alpha):
        return math.nan
    return math.sqrt(multiplier(wheel) * (omega**2 + slope_gain(wheel, slope, gravity)))


def fate(wheel: WheelParams, slope: float, gravity: float, theta: float, omega: float) -> Fate:
    """What becomes of a wheel at θ within ±α that moves at ω; one that hangs on its apex is counted as turning back.

    Raises:
        ValueError: a slope < 0.

    """
    if not slope >= 0.0:
        raise ValueError(
            f'slope must be ≥ 0, got {slope:g} rad: for an uphill one change the signs of slope, angle and speed'
        )
    if not slope > gentlest_slope(wheel):
        return Fate.STANDS
    if slope >= wheel.alpha:  # nowhere to rest: the weight presses on the forward spoke only
        return Fate.ROLLS
    keeps, gain, alpha = multiplier(wheel), slope_gain(wheel, slope, gravity), wheel.alpha
    passes = abs(omega) > speed_to_pass(wheel, slope, gravity, theta)
    forward = omega > 0.0 if passes else theta > -slope
    strike = alpha if forward else -alpha
    square = omega**2 + 2.0 * pull(wheel, gravity) * (math.cos(theta + slope) - math.cos(strike + slope))
    if not forward:  # uphill from spoke to spoke, until it turns back
        square *= keeps
        while square > speed_to_pass(wheel, slope, gravity, alpha) ** 2:
            square = keeps * (square - gain)
    rolls = math.sqrt(keeps * max(square, 0.0)) > speed_to_pass(wheel, slope, gravity, -alpha)
    return Fate.ROLLS if rolls else Fate.STANDS


def uphill_bands(wheel: WheelParams, slope: float, gravity: float, count: int) -> list[tuple[float, float]]:
    """Speeds at θ = α, uphill, from which a wheel turns back, rolls down and comes to its limit cycle [rad/s].

    In the first band it turns back at once, in the next after one step uphill, and so on; between the bands it turns
    back too slowly to pass its apex, and stands. Empty where the slope is too gentle for a limit cycle, or for any
    band; on slopes ≥ α there are no gaps between the bands.
    """
    keeps, gain = multiplier(wheel), slope_gain(wheel, slope, gravity)
    low = speed_to_pass(wheel, slope, gravity, -wheel.alpha) ** 2 / keeps if keeps else math.inf
    high = speed_to_pass(wheel, slope, gravity, wheel.alpha) ** 2
    if not (slope > gentlest_slope(wheel) and low < high):
        return []
    bands = []
    for _ in range(count):
        bands.append((math.sqrt(low), math.sqrt(high)))
        low, high = low / keeps + gain, high / keeps + gain
    return bands


def limit_cycle_period(wheel: WheelParams, slope: float, gravity: float) -> float:
    """Time of a step on the limit cycle [s]; NaN where there is none.

    With u = (θ + γ)/2 and h the square of the speed at the apex, 2/√h · ∫ du / √(1 + 4 (g/ℓ)/h sin² u): the elliptic
    integral of the first kind of parameter −4 (g/ℓ)/h.
    """
    omega = float(limit_cycle_speed(wheel, slope, gravity))
    rate2 = pull(wheel, gravity)
    h = omega**2 - 2.0 * rate2 * (1.0 - math.cos(slope - wheel.alpha))
    if not h > 0.0:
        return math.nan
    begin, end = (slope - wheel.alpha) / 2.0, (slope + wheel.alpha) / 2.0
    m = -4.0 * rate2 / h
    return float(2.0 / math.sqrt(h) * (ellipkinc(end, m) - ellipkinc(begin, m)))


def limit_cycle_velocity(wheel: WheelParams, slope: float, gravity: float) -> float:
    """Mean speed down the slope on the limit cycle, σ/T [m/s]; NaN where there is none."""
    return wheel.step_length / limit_cycle_period(wheel, slope, gravity)


def steepest_slope(wheel: WheelParams) -> float:
    """The slope [rad] beyond which a real foot would lift off on the limit cycle, at the end of each stance.

    There the spoke presses with m (g cos(α + γ) − ℓ ω₋²), ω₋² = 4 (g/ℓ) sin γ sin α / sin²(2α); it vanishes at
    tan γ = cot α / (1 + 4/sin²(2α)). The model itself holds the foot down and rolls on.
    """
    return math.atan(1.0 / (math.tan(wheel.alpha) * (1.0 + 4.0 / (1.0 - multiplier(wheel)))))

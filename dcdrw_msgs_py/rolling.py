"""How rimless wheels roll: rotations, spokes and stance angles, the gait phase, and where the feet are (contract §1).

Of numbers, or of arrays of equal shape.
"""

import math
from typing import Protocol, overload

import numpy as np

from dcdrw_msgs_py.values import Real, Value, each, functions_of


class Pitched(Protocol):
    """What a phase needs of a wheel."""

    @property
    def alpha(self) -> float:
        """Half the angle between two spokes, α [rad]."""


class Wheel(Pitched, Protocol):
    """What footholds need of a wheel."""

    @property
    def length(self) -> float:
        """Hub to foot, ℓ [m]."""


def stance(alpha: float, psi: Value) -> tuple[Value, Value]:
    """Number of the stance spoke, floor((ψ + α) / 2α), and the stance angle θ in [−α, α), at a rotation ψ [rad]."""
    spoke = (psi + alpha) // (2.0 * alpha)
    return spoke, psi - 2.0 * alpha * spoke


def rotation(alpha: float, spoke: Real, theta: Real) -> Real:
    """ψ = θ + 2α n: the inverse of `stance`."""
    return theta + 2.0 * alpha * spoke


def steps_ahead(front: Pitched, rear: Pitched, psi1: Value, psi2: Value) -> Value:
    """Steps by which the front wheel is ahead, ψ1/2α1 − ψ2/2α2; given speeds, the rate of that."""
    return psi1 / (2.0 * front.alpha) - psi2 / (2.0 * rear.alpha)


def phase(front: Pitched, rear: Pitched, psi1: Value, psi2: Value) -> Value:
    """The gait phase difference p = frac(ψ1/2α1 − ψ2/2α2), in [0, 1) steps."""
    p = steps_ahead(front, rear, psi1, psi2) % 1.0
    return p * (p < 1.0)  # the remainder of a tiny negative number is 1.0


def rear_side(front_steps: int, rear_steps: int) -> int:
    """0 where the even steps of the rear wheel are of the left foot, 1 where its odd ones are: in the order 1-4-2-3.

    A wheel's strikes are of the left and the right foot in turn, and the front one begins with the left: after that
    the right rear foot follows.

    Args:
        front_steps: taken by the front wheel when the rear one strikes.
        rear_steps: which of its steps that strike is.

    """
    return (rear_steps + front_steps + 1) % 2


def phi_pitch(front: Pitched, rear: Pitched) -> float:
    """The angle φ of a whole step, α1 + α2 [rad]: φ = p (α1 + α2)."""
    return front.alpha + rear.alpha


def step_length(length: Value, alpha: Value) -> Value:
    """Distance between two footholds, σ = 2 ℓ sin α [m] (paper's (14), with ℓ_i)."""
    return 2.0 * length * each(math.sin, alpha)


def hub_travel(wheel: Wheel, psi: float) -> float:
    """Place of the hub along the slope, from that at ψ = 0 [m]: the feet are σ apart, the hub ℓ sin θ past its own."""
    spoke, theta = stance(wheel.alpha, psi)
    return step_length(wheel.length, wheel.alpha) * spoke + wheel.length * math.sin(theta)


def default_stance_distance(S0: Value, front_length: Value) -> Value:
    """S0 where it is given, and ℓ of the front wheel where it is NaN [m]."""
    if isinstance(S0, float):
        return front_length if math.isnan(S0) else S0
    return np.where(np.isnan(S0), front_length, S0)


def default_rest_length(D0: Value, S0: Value, front_length: Value, front_alpha: Value) -> Value:
    """D0 where it is given, and S0 + ℓ sin α where it is NaN: the spring at rest at φ = α [m]; at least 0."""
    at_rest = S0 + 0.5 * step_length(front_length, front_alpha)
    if isinstance(D0, float):
        return max(at_rest if math.isnan(D0) else D0, 0.0)
    return np.maximum(np.where(np.isnan(D0), at_rest, D0), 0.0)


def stance_distance(front: Wheel, rear: Wheel, S0: float, steps1: Real, steps2: Real) -> Real:
    """S = S0 + n1 σ1 − n2 σ2 [m] (paper's (13))."""
    return S0 + steps1 * step_length(front.length, front.alpha) - steps2 * step_length(rear.length, rear.alpha)


def hub_offset(front: Wheel, rear: Wheel, theta1: Real, theta2: Real) -> tuple[Real, Real]:
    """D_x − S and D_y, by which the front hub is ahead of the rear one, and above it, beside the feet [m] (4), (5)."""
    l1, l2, functions = front.length, rear.length, functions_of(theta1)
    return (
        l1 * functions.sin(theta1) - l2 * functions.sin(theta2),
        l1 * functions.cos(theta1) - l2 * functions.cos(theta2),
    )


def regular_stance_distance(front: Wheel, rear: Wheel, S0: float, theta1: float, theta2: float) -> float:
    """S of a regular gait: S0, and σ1 more from a strike of the front wheel to the next of the rear one [m].

    That is where n = 1, the phase being p = n + (θ1/α1 − θ2/α2)/2 in [0, 1).
    """
    n = theta1 / front.alpha < theta2 / rear.alpha
    return default_stance_distance(S0, front.length) + n * step_length(front.length, front.alpha)


def stance_distance_by_hubs(
    front: Wheel, rear: Wheel, theta1: float, theta2: float, D: float, expected: float
) -> float:
    """S at which the hubs are D apart, the front one on the side where it is expected [m].

    Args:
        front: the front wheel.
        rear: the rear wheel.
        theta1: stance angles [rad].
        theta2: of the rear wheel.
        D: distance of the hubs [m]; NaN where it is not known.
        expected: S as far as it is known otherwise; the answer where no S makes the hubs D apart.

    """
    dx, dy = map(float, hub_offset(front, rear, theta1, theta2))
    if not abs(dy) <= D < math.inf:
        return expected
    return math.copysign(math.sqrt(D * D - dy * dy), expected + dx) - dx


@overload
def speed_kept(alpha: float, gyration: float = 0.0, restitution: float = 0.0) -> float: ...
@overload
def speed_kept(alpha: Real, gyration: Real, restitution: Real) -> Real: ...
def speed_kept(alpha: Real, gyration: Real = 0.0, restitution: Real = 0.0) -> Real:
    """The fraction η of its speed that a strike leaves to a wheel: cos 2α for a point mass (paper's (15)).

    η = η0 + e (1 − η0), η0 = (cos 2α + r²)/(1 + r²): the angular momentum about the new foot is kept (McGeer 1990), and
    of the speed so lost the part e comes back (contract §5).
    """
    rigid = (each(math.cos, 2.0 * alpha) + gyration**2) / (1.0 + gyration**2)
    return rigid + restitution * (1.0 - rigid)

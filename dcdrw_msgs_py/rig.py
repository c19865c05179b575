"""The rig: two rimless wheels, the coupler between their hubs, and the slope (contract §1)."""

import math
from typing import Annotated, NamedTuple

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rolling import default_rest_length, default_stance_distance, step_length

FRONT = 'front'
REAR = 'rear'


Length = Annotated[float, Quantity('hub to foot, ℓ', 'm', above=0.0, high=10.0)]
Spokes = Annotated[float, Quantity('number of spokes, π/α; need not be whole', low=4.0, high=1000.0)]


class WheelPitch(NamedTuple):
    """How a wheel is divided: all that a phase needs."""

    spokes: Spokes = 12.0

    @property
    def alpha(self) -> float:
        """Half the angle between two spokes, α [rad]."""
        return math.pi / self.spokes


class WheelShape(NamedTuple):
    """A wheel's geometry: what footholds need."""

    length: Length = 0.9652
    spokes: Spokes = WheelPitch().spokes

    @property
    def alpha(self) -> float:
        """Half the angle between two spokes, α [rad]."""
        return math.pi / self.spokes

    @property
    def step_length(self) -> float:
        """Distance between two footholds, σ = 2 ℓ sin α [m] (paper's (14), with ℓ_i)."""
        return step_length(self.length, self.alpha)


class WheelParams(NamedTuple):
    """One rimless wheel; the paper's wheel by default."""

    length: Length = WheelShape().length
    mass: Annotated[float, Quantity('mass, its centre at the hub, m', 'kg', above=0.0, high=1000.0)] = 10.0
    spokes: Spokes = WheelShape().spokes
    gyration: Annotated[
        float, Quantity('radius of gyration about the hub over ℓ, r; 0 for a point mass', low=0.0, high=2.0, live=True)
    ] = 0.0
    restitution: Annotated[
        float,
        Quantity('part of the speed lost in a rigid strike that it gives back, e', low=0.0, high=0.999, live=True),
    ] = 0.0

    @property
    def alpha(self) -> float:
        """Half the angle between two spokes, α [rad]."""
        return math.pi / self.spokes

    @property
    def step_length(self) -> float:
        """Distance between two footholds, σ = 2 ℓ sin α [m]."""
        return step_length(self.length, self.alpha)


StanceDistance = Annotated[
    float,
    Quantity(
        'distance of the stance feet just before a strike of the front wheel, x1 − x2',
        'm',
        low=-100.0,
        high=100.0,
        derived='ℓ of the front wheel',
    ),
]
Slope = Annotated[float, Quantity('slope γ, positive downhill', 'rad', low=-math.pi / 4, high=math.pi / 4, live=True)]

Gravity = Annotated[float, Quantity('gravitational acceleration g', 'm/s²', above=0.0, high=100.0)]


class RigParams(NamedTuple):
    """The whole rig; the paper's experiment by default."""

    front: WheelParams = WheelParams()
    rear: WheelParams = WheelParams()
    k: Annotated[float, Quantity('stiffness of the coupler', 'N/m', low=0.0, high=1e6, live=True)] = 5.25
    b: Annotated[float, Quantity('damping of the coupler', 'N·s/m', low=0.0, high=1e6, live=True)] = 100.0
    D0: Annotated[
        float,
        Quantity(
            'length of the coupler at rest',
            'm',
            low=0.0,
            high=100.0,
            live=True,
            derived='S0 + ℓ sin α: at rest at φ = α',
        ),
    ] = math.nan
    S0: StanceDistance = math.nan
    slope: Slope = math.radians(2.0)
    gravity: Gravity = 9.81
    coupler_friction: Annotated[
        float, Quantity('dry friction of the coupler, F_c', 'N', low=0.0, high=1e6, live=True)
    ] = 0.0
    rolling_resistance: Annotated[
        float, Quantity('torque that resists each wheel, over m g ℓ, c_r', low=0.0, high=0.2, live=True)
    ] = 0.0
    friction_speed: Annotated[
        float, Quantity('speed over which both frictions turn round, v0', 'm/s', above=0.0, high=10.0, live=True)
    ] = 0.01

    def resolved(self) -> 'RigParams':
        """The same rig with its derived defaults filled in."""
        front = self.front
        S0 = default_stance_distance(self.S0, front.length)
        return self._replace(S0=S0, D0=default_rest_length(self.D0, S0, front.length, front.alpha))

"""What comes from the sensors on the legs, and what the leg tracker makes of it, as plain data."""

import math
from typing import NamedTuple

from dcdrw_control.legs.mounting import Vector
from dcdrw_control.legs.params import Kind
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import Turn
from dcdrw_msgs_py.topics import SIDES


class Leg(NamedTuple):
    """Which leg: of the person in front, or of the robot behind."""

    half: str
    """`front` or `rear`."""
    side: str
    """`left` or `right`."""

    def __str__(self) -> str:
        return f'{self.half}_{self.side}'


LEGS = tuple(Leg(half, side) for half in (FRONT, REAR) for side in SIDES)
"""1 front left, 2 front right, 3 rear left, 4 rear right."""


class ImuReading(NamedTuple):
    """An inertial sensor on the foot or the shank."""

    rate: Vector
    """Angular rate [rad/s]."""
    acceleration: Vector
    """In any unit."""


class ContactReading(NamedTuple):
    """A switch or an insole under the foot."""

    touches: bool


class WrenchReading(NamedTuple):
    """A plate or an insole under the foot."""

    force: float
    """Vertical, of either sign [N]."""


class HipReading(NamedTuple):
    """A joint of an exoskeleton, or an orientation sensor on the thigh."""

    angle: float
    """[rad]"""
    rate: float = math.nan
    """[rad/s]; NaN where it is not measured."""


Reading = ImuReading | ContactReading | WrenchReading | HipReading
KIND_OF: dict[type[Reading], Kind] = {
    ImuReading: 'imu',
    ContactReading: 'contact',
    WrenchReading: 'wrench',
    HipReading: 'hip',
}


class LegReading(NamedTuple):
    """One sample of one sensor."""

    stamp_ns: int
    leg: Leg
    reading: Reading


class LegUpdate(NamedTuple):
    """Where the legs are at one time: what `leg_phases` and `joint_states` carry. What is unknown is left out."""

    stamp_ns: int
    legs: dict[Leg, Turn]
    """2π per stride, 0 at the first heel strike, unbounded [rad], and its rate [rad/s]."""
    wheels: dict[str, Turn]
    """The rotation ψ of each half as a wheel, by the joint's name [rad], and its rate [rad/s]."""

"""Readings in messages, by their fields alone: of rclpy, or of a recording that is read without ROS."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from dcdrw_control.legs.mounting import Vector
from dcdrw_control.legs.samples import LEGS, ContactReading, HipReading, ImuReading, Leg, Reading, WrenchReading
from dcdrw_msgs_py.words import names_and_positions


def imu_reading(message: Any) -> ImuReading:
    """The reading in a sensor_msgs/Imu."""
    return ImuReading(_vector(message.angular_velocity), _vector(message.linear_acceleration))


def contact_reading(message: Any) -> ContactReading:
    """The reading in a std_msgs/Bool."""
    return ContactReading(bool(message.data))


def wrench_reading(message: Any) -> WrenchReading:
    """The reading in a geometry_msgs/WrenchStamped."""
    return WrenchReading(float(message.wrench.force.z))


READERS: dict[str, Callable[[Any], Reading]] = {
    'imu': imu_reading,
    'contact': contact_reading,
    'wrench': wrench_reading,
}
"""What reads the messages of each topic in LEG_SENSORS."""


def hip_readings(message: Any, names: Sequence[str]) -> list[tuple[Leg, HipReading]]:
    """The hips in a sensor_msgs/JointState, whatever their order and company; those it does not name are left out.

    Args:
        message: of leg_joint_states.
        names: of the hips, in the order of LEGS.

    Raises:
        ValueError: it names no hip, one of them twice, or positions and names disagree.

    """
    given = list(message.name)
    if len(message.position) != len(given):
        raise ValueError(names_and_positions(len(given), len(message.position)))
    speeds = message.velocity if len(message.velocity) == len(given) else [math.nan] * len(given)
    hips = [(leg, given.index(name)) for leg, name in zip(LEGS, names, strict=True) if given.count(name) == 1]
    if not hips:
        raise ValueError(f'none of the hips {", ".join(names)} is named once; the message names {", ".join(given)}')
    return [(leg, HipReading(float(message.position[at]), float(speeds[at]))) for leg, at in hips]


def _vector(vector: Any) -> Vector:
    return float(vector.x), float(vector.y), float(vector.z)

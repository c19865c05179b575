"""Recordings of sensors on legs, as ros2 bag makes them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer

from dcdrw_control.legs.samples import LEGS, Leg
from dcdrw_msgs_py.topics import LEG_SENSORS
from tests.bags import TYPES

AHEAD = dict(zip(LEGS, (0.0, 0.5, 0.75, 0.25), strict=True))
"""How far each leg is ahead of the front left one in its stride: the robot's legs lead by a quarter stride."""
STANCE, RATE, PERIOD = 0.6, 100, 1.1


def write_walk(
    path: Path, legs: Sequence[Leg] = LEGS, seconds: float = 20.0, namespace: str = '', kind: str = 'wrench'
):
    """What is under feet that walk evenly."""
    writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    with writer:
        topics = {leg: LEG_SENSORS[leg.half, leg.side, kind] for leg in legs}
        connections = {
            leg: writer.add_connection(f'{namespace}/{topic.name}', topic.type, typestore=TYPES)
            for leg, topic in topics.items()
        }
        for index in range(round(seconds * RATE)):
            when_ns = 10**9 + index * 10**9 // RATE
            for leg in legs:
                touches = (index / RATE / PERIOD + AHEAD[leg]) % 1.0 < STANCE
                writer.write(connections[leg], when_ns, _message(kind, when_ns, touches))
    return path


def _message(kind: str, when_ns: int, touches: bool) -> bytes:
    types = TYPES.types
    if kind == 'contact':
        return bytes(TYPES.serialize_cdr(types['std_msgs/msg/Bool'](touches), 'std_msgs/msg/Bool'))
    header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](*divmod(when_ns, 10**9)), '')
    vector = types['geometry_msgs/msg/Vector3']
    if kind == 'wrench':
        wrench = types['geometry_msgs/msg/Wrench'](vector(0.0, 0.0, 700.0 * touches), vector(0.0, 0.0, 0.0))
        message = types['geometry_msgs/msg/WrenchStamped'](header, wrench)
        return bytes(TYPES.serialize_cdr(message, 'geometry_msgs/msg/WrenchStamped'))
    still, nowhere = np.zeros(9), types['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0)
    message = types['sensor_msgs/msg/Imu'](
        header, nowhere, still, vector(0.1, 0.2, 0.3), still, vector(0.0, 0.0, 9.8), still
    )
    return bytes(TYPES.serialize_cdr(message, 'sensor_msgs/msg/Imu'))

"""Bags as others make them: by rosbags' own writer."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode
from rosbags.typesys import Stores, get_typestore

from dcdrw.recordings.bag_file import Stream

TYPES = get_typestore(Stores.ROS2_JAZZY)
JOINT_STATE = 'sensor_msgs/msg/JointState'
JOINTS = Stream('/joint_states', JOINT_STATE)


def joint_state(
    stamp_ns: int,
    names: Iterable[str],
    position: Iterable[float],
    velocity: Iterable[float] = (),
    effort: Iterable[float] = (),
    frame: str = '',
    little_endian: bool = True,
) -> bytes:
    """A serialized JointState."""
    time = TYPES.types['builtin_interfaces/msg/Time'](stamp_ns // 10**9, stamp_ns % 10**9)
    message = TYPES.types[JOINT_STATE](
        TYPES.types['std_msgs/msg/Header'](time, frame),
        list(names),
        *(np.array(list(column), float) for column in (position, velocity, effort)),
    )
    return bytes(TYPES.serialize_cdr(message, JOINT_STATE, little_endian=little_endian))


def write_bag(
    path: Path,
    messages: Iterable[tuple[int, bytes]],
    topic: str = '/joint_states',
    storage: StoragePlugin = StoragePlugin.MCAP,
    compression: CompressionMode = CompressionMode.NONE,
) -> Path:
    """Write log times and messages."""
    writer = Writer(path, version=9, storage_plugin=storage)
    writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(topic, JOINT_STATE, typestore=TYPES)
        for log_ns, data in messages:
            writer.write(connection, log_ns, data)
    return path

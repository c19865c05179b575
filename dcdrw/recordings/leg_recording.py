"""Sensors on legs in a recording: as readings, and as the joint states that the leg tracker makes of them. No ROS."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, islice
from typing import Any

import numpy as np

from dcdrw.recordings.bag_file import Stream
from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.recordings.recording import BATCH, Recording
from dcdrw_control.legs.conversion import READERS, hip_readings
from dcdrw_control.legs.samples import Leg, LegReading, LegUpdate
from dcdrw_msgs_py.samples import SECOND, Turn
from dcdrw_msgs_py.topics import LEG_JOINT_STATES, LEG_PHASES, LEG_SENSORS, PERSON_FORCE, Topic

_TOPICS = (*LEG_SENSORS.values(), LEG_JOINT_STATES)


def find_topic(recording: Recording, topic: Topic, namespace: str = '') -> Stream | None:
    """The topic in a recording, in this namespace or in whatever one; None where it has none.

    Raises:
        ValueError: it has one in several namespaces.

    """
    there = recording.found(topic.name, topic.type, namespace)
    return recording.find(topic.name, topic.type, namespace) if there else None


def leg_topics(recording: Recording, namespace: str = '') -> list[Stream]:
    """The topics of sensors on legs that a recording has, in this namespace or in whatever one."""
    return [found for topic in _TOPICS if (found := find_topic(recording, topic, namespace))]


def is_walked(recording: Recording, namespace: str = '') -> bool:
    """Whether a wheel of this recording is a person's legs: sensed ones, or simulated ones that feel a force."""
    return any(recording.found(topic.name, topic.type, namespace) for topic in (*_TOPICS, LEG_PHASES, PERSON_FORCE))


def namespace_of(found: Stream) -> str:
    """The namespace of a topic of sensors on legs."""
    ends = (f'/{topic.name}' for topic in _TOPICS if f'/{found.name}'.endswith(f'/{topic.name}'))
    return found.name.removesuffix(next(ends))


def leg_readings(
    recording: Recording, hips: Sequence[str], namespace: str = '', window: tuple[int, ...] = ()
) -> Iterator[LegReading]:
    """The readings of all sensors on legs, in the order in which they were recorded.

    Args:
        recording: an open recording.
        hips: names of the hips in leg_joint_states, in the order of LEGS.
        namespace: of the sensors, where the recording has several.
        window: from when to before when they were recorded [ns].

    """
    sensors = {find_topic(recording, topic, namespace): key for key, topic in LEG_SENSORS.items()}
    for topic, log_ns, message in recording.decoded(leg_topics(recording, namespace), *window):
        # A Bool has no stamp of its own: it is of the time of its arrival, as for the node.
        stamp_ns = _stamp_ns(message.header.stamp) if hasattr(message, 'header') else log_ns
        if topic in sensors:
            half, side, kind = sensors[topic]
            yield LegReading(stamp_ns, Leg(half, side), READERS[kind](message))
            continue
        try:
            yield from (LegReading(stamp_ns, leg, hip) for leg, hip in hip_readings(message, hips))
        except ValueError:  # the node passes it over, too
            continue


def wheel_batches(updates: Iterable[LegUpdate]) -> Iterator[JointBatch]:
    """What the leg tracker found, as the joint states that it publishes."""
    for names, group in groupby((update for update in updates if update.wheels), lambda update: tuple(update.wheels)):
        while part := list(islice(group, BATCH)):
            turns = np.array([[update.wheels[name] for name in names] for update in part]).reshape(-1, len(names), 2)
            stamps = np.array([update.stamp_ns for update in part], np.int64)
            yield JointBatch('', names, stamps, turns[..., 0], turns[..., 1], np.full(turns.shape[:2], Turn().angle))


def _stamp_ns(stamp: Any) -> int:
    return int(stamp.sec) * SECOND + int(stamp.nanosec)

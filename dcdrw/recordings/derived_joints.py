"""Joint states of a recording that has none: what tag_tracker or leg_tracker makes of what was recorded. No ROS."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from dcdrw.recordings.bag_file import Message, Stream
from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.recordings.joint_recording import serializers
from dcdrw.recordings.leg_recording import find_topic, leg_readings, leg_topics, namespace_of, wheel_batches
from dcdrw.recordings.pose_recording import pose_batches
from dcdrw.recordings.pose_sources import pose_sources, what_poses
from dcdrw.recordings.recording import Recording
from dcdrw.suite.parameter_file import read_parameter_file
from dcdrw_control.legs.params import LegParams
from dcdrw_control.legs.walk import leg_updates
from dcdrw_msgs_py.samples import JointSample, Turn
from dcdrw_msgs_py.topics import JOINT_STATES
from dcdrw_tracker.gait.phase import PhaseParams


class WalkParams(NamedTuple):
    """The parameters of leg_tracker."""

    legs: LegParams = LegParams()


def recorded_walk(recording: Recording, rig: Path | None, namespace: str = '') -> tuple[LegParams, list[Stream]]:
    """The parameters of leg_tracker, and the topics of sensors on legs, of which there may be none."""
    params, topics = WalkParams(), leg_topics(recording, namespace)
    space = namespace_of(topics[0]) if topics else namespace
    for file in filter(None, (recording.parameters, rig)):
        params = read_parameter_file(file, params, space)
    return params.legs, topics


def derived_joints(
    recording: Recording, topic: str, rig: Path | None, namespace: str = '', window: tuple[int, ...] = ()
) -> tuple[str, Iterator[JointBatch]] | None:
    """Where only poses of the wheels or sensors on legs were recorded, the topic of the joint states, and these.

    Args:
        recording: an open recording.
        topic: of the joint states; only the suite's own are derived.
        rig: a parameter file; it takes the place of what was recorded.
        namespace: of the suite, where the recording has several.
        window: from when to before when the messages were recorded [ns].

    Raises:
        ValueError: several suites were recorded; or of the parameter files; while they are read: one half alone is
            no trial.
        OSError: of the parameter files.

    """
    if topic != JOINT_STATES.name or find_topic(recording, JOINT_STATES, namespace):
        return None
    poses = pose_sources(recording, namespace)
    if poses:
        return f'{poses.namespace}/{topic}', pose_batches(recording, poses, rig, window)
    params, legs = recorded_walk(recording, rig, namespace)
    if not legs:
        return None
    readings = leg_readings(recording, params.hip_joints, namespace, window)
    batches = _of_both(wheel_batches(leg_updates(readings, params)), recording, legs)
    return f'{namespace_of(legs[0])}/{topic}', batches


def joint_topic(recording: Recording, topic: str, namespace: str = '') -> Stream:
    """The topic of the joint states that were recorded.

    Raises:
        ValueError: there is none, or one in several namespaces; what poses were recorded in its place is told.

    """
    try:
        return recording.find(topic, namespace=namespace)
    except ValueError as error:
        if recording.found(topic, namespace=namespace) or not (poses := what_poses(recording)):
            raise
        raise ValueError(f'{error}; {poses}') from None


def _of_both(batches: Iterator[JointBatch], recording: Recording, legs: list[Stream]) -> Iterator[JointBatch]:
    """Those that tell of both halves: before the second is known, and while it is silent, there is no pair."""
    found = False
    for batch in batches:
        if len(batch.names) == 2:
            found = True
            yield batch
    if not found:
        raise ValueError(
            f'{recording.path}: a trial needs both legs of both halves at one time, dcdrw legs only one leg; '
            f'recorded are {", ".join(leg.name for leg in legs)}'
        )


def as_messages(topic: str, batches: Iterator[JointBatch], begin_ns: int) -> Iterator[Message]:
    """The same joint states as they come off the wire, as if recorded from `begin_ns` on when their stamps say so."""
    names, stream = PhaseParams(), Stream(topic, JOINT_STATES.type)
    serialize, _ = serializers(names)
    first_ns: int | None = None
    for batch in batches:
        if batch.error:
            continue
        wheels = [batch.names.index(name) for name in (names.front_joint, names.rear_joint)]
        rows = zip(batch.stamp_ns.tolist(), batch.position[:, wheels], batch.velocity[:, wheels], strict=True)
        for stamp_ns, angles, rates in rows:
            first_ns = stamp_ns if first_ns is None else first_ns
            front, rear = map(Turn, angles.tolist(), rates.tolist())
            sample = JointSample(stamp_ns, front, rear)
            yield Message(stream, begin_ns + stamp_ns - first_ns, serialize(sample))

"""Motion capture in a recording: as the joint states that the tag tracker makes of both wheels' poses. No ROS."""

from collections.abc import Iterator
from itertools import groupby, islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dcdrw.recordings.bag_file import Stream
from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.recordings.leg_recording import find_topic
from dcdrw.recordings.recording import BATCH, Recording
from dcdrw.suite.parameter_file import read_parameter_file
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import SECOND, JointSample, PoseSample
from dcdrw_msgs_py.topics import FRONT_POSE, FRONT_WHEEL, REAR_POSE, REAR_WHEEL
from dcdrw_tracker.wheels.poses import PosePairs, PoseParams
from dcdrw_tracker.wheels.wheel_angles import WheelAngles
from dcdrw_tracker.wheels.wheel_track import TrackParams


class PoseTracking(NamedTuple):
    """The parameters of tag_tracker, as far as poses concern them."""

    track: TrackParams = TrackParams()
    bodies: PoseParams = PoseParams()


def pose_topics(recording: Recording, namespace: str = '') -> list[Stream]:
    """The topics of both wheels' poses, the front one's first; none unless both were recorded."""
    found = [one for topic in (FRONT_POSE, REAR_POSE) if (one := find_topic(recording, topic, namespace))]
    return found if len(found) == 2 else []


def pose_batches(
    recording: Recording, rig: Path | None = None, namespace: str = '', window: tuple[int, ...] = ()
) -> Iterator[JointBatch]:
    """What the tag tracker makes of the poses, and those of no use, as messages that cannot be read.

    Args:
        recording: an open recording that has `pose_topics`.
        rig: a parameter file; it takes the place of what was recorded.
        namespace: of the poses, where the recording has several.
        window: from when to before when they were recorded [ns].

    Raises:
        ValueError, OSError: of the parameter files.

    """
    params = PoseTracking()
    topics = pose_topics(recording, namespace)
    for file in filter(None, (recording.parameters, rig)):
        params = read_parameter_file(file, params, topics[0].name.removesuffix(FRONT_POSE.name))
    for kind, group in groupby(_followed(recording, params, topics, window), _kind):
        while part := list(islice(group, BATCH)):
            yield _unread(kind, len(part)) if isinstance(kind, str) else _joints(part, kind)


def _kind(found: JointSample | str) -> int | str:
    """What the messages of one batch have in common: the run, or why they are of no use."""
    return found if isinstance(found, str) else found.run


def _followed(
    recording: Recording, params: PoseTracking, topics: list[Stream], window: tuple[int, ...]
) -> Iterator[JointSample | str]:
    """Joint states, and in the place of poses that are of no use why."""
    pairs, angles = PosePairs(params.bodies, params.track.slope), WheelAngles(params.track)
    wheels = dict(zip(topics, (FRONT, REAR), strict=True))
    for topic, _, message in recording.decoded(topics, *window):
        try:
            views = pairs.take(wheels[topic], _pose(message))
        except ValueError as error:
            yield f'{topic.name}: {error}'
            continue
        yield from filter(None, map(angles.update, views))


def _pose(message: Any) -> PoseSample:
    stamp, place, turn = message.header.stamp, message.pose.position, message.pose.orientation
    return PoseSample(
        int(stamp.sec) * SECOND + int(stamp.nanosec), (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w)
    )


def _joints(samples: list[Any], run: int) -> JointBatch:
    turns = np.array([(*sample.front, *sample.rear) for sample in samples])
    return JointBatch(
        '',
        (FRONT_WHEEL, REAR_WHEEL),
        np.array([sample.stamp_ns for sample in samples], np.int64),
        turns[:, ::2],
        turns[:, 1::2],
        np.full((len(samples), 2), np.nan),
        run=np.full(len(samples), run, np.int64),
    )


def _unread(why: str, count: int) -> JointBatch:
    none = np.empty((count, 0))
    return JointBatch('', (), np.zeros(count, np.int64), none, none, none, why)

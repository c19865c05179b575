"""Motion capture in a recording: as the joint states that the tag tracker makes of both wheels' poses. No ROS."""

from collections.abc import Iterator
from itertools import groupby, islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.recordings.pose_sources import PoseSources, poses_of
from dcdrw.recordings.recording import BATCH, Recording
from dcdrw.suite.parameter_file import read_parameter_file
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import JointSample
from dcdrw_msgs_py.text_file import one_line
from dcdrw_msgs_py.topics import FRONT_WHEEL, REAR_WHEEL
from dcdrw_tracker.wheels.poses import PosePairs, PoseParams
from dcdrw_tracker.wheels.wheel_angles import WheelAngles
from dcdrw_tracker.wheels.wheel_track import TrackParams


class PoseTracking(NamedTuple):
    """The parameters of tag_tracker, as far as poses concern them."""

    track: TrackParams = TrackParams()
    bodies: PoseParams = PoseParams()


def pose_batches(
    recording: Recording, sources: PoseSources, rig: Path | None = None, window: tuple[int, ...] = ()
) -> Iterator[JointBatch]:
    """What the tag tracker makes of the poses, and those of no use, as messages that cannot be read.

    Args:
        recording: an open recording.
        sources: what of it tells the poses.
        rig: a parameter file; it takes the place of what was recorded.
        window: from when to before when they were recorded [ns].

    Raises:
        ValueError, OSError: of the parameter files.

    """
    params = PoseTracking()
    for file in filter(None, (recording.parameters, rig)):
        params = read_parameter_file(file, params, sources.namespace)
    for kind, group in groupby(_followed(recording, params, sources, window), _kind):
        while part := list(islice(group, BATCH)):
            yield _unread(kind, len(part)) if isinstance(kind, str) else _joints(part, kind)


def _kind(found: JointSample | str) -> int | str:
    """What the messages of one batch have in common: the run, or why they are of no use."""
    return found if isinstance(found, str) else found.run


def _followed(
    recording: Recording, params: PoseTracking, sources: PoseSources, window: tuple[int, ...]
) -> Iterator[JointSample | str]:
    """Joint states, and in the place of poses that are of no use why."""
    pairs, angles = PosePairs(params.bodies, params.track), WheelAngles(params.track)
    wheels = {FRONT: sources.front, REAR: sources.rear}
    parents: dict[str, str] = {}
    for topic, _, message in recording.decoded(list({body.topic for body in wheels.values()}), *window):
        for wheel, body in wheels.items():
            for parent, pose in poses_of(body, message) if body.topic == topic else ():
                parents[wheel] = parent
                try:
                    if body.frame and len(set(parents.values())) > 1:
                        frames = one_line(' and '.join(parents.values()))
                        raise ValueError(f'both wheels must be told in one frame, got {frames}')
                    views = pairs.take(wheel, pose)
                except ValueError as error:
                    yield f'{one_line(body.frame or topic.name)}: {error}'
                    continue
                yield from filter(None, map(angles.update, views))
    if pairs.waits:
        yield pairs.waits


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

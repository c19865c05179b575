"""Where a recording has the poses of both wheels: in whatever message tells them, under one of the usual names."""

from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any, NamedTuple

from dcdrw.recordings.bag_file import Stream
from dcdrw.recordings.recording import Recording
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import SECOND, PoseSample
from dcdrw_msgs_py.text_file import one_line
from dcdrw_msgs_py.topics import FRONT_POSE
from dcdrw_msgs_py.words import MOST_NAMED, listed

NAMES = ('{0}_pose', '{0}_wheel', '{0}_wheel/pose', '{0}/pose', '{0}_wheel/odom', '{0}_wheel/{0}_wheel')
"""What a wheel's topic or frame may be called, in any namespace; the first that both wheels have counts."""
LOOKED_AT = 10_000
"""Messages of a topic that are searched for frames."""
_TF = 'tf2_msgs/msg/TFMessage'
_TRANSFORM = 'geometry_msgs/msg/TransformStamped'
_STATIC = 'tf_static'


class Body(NamedTuple):
    """What tells the pose of one wheel."""

    topic: Stream
    frame: str = ''
    """The child frame that is the wheel's, in messages that tell of several; empty where the topic is its own."""


class PoseSources(NamedTuple):
    """What tells the poses of both wheels."""

    namespace: str
    """It begins with a slash, or is empty."""
    front: Body
    rear: Body


class _Told(NamedTuple):
    """One body in a message."""

    frame: str
    """The child frame; empty where the message names none."""
    parent: str
    pose: PoseSample


def pose_sources(recording: Recording, namespace: str = '') -> PoseSources | None:
    """What tells the poses of both wheels, in this namespace or in whatever one; None where nothing does.

    Raises:
        ValueError: several namespaces have them.

    """
    topics = [
        (_rooted(topic.name), Body(topic)) for kind in _READERS if kind != _TF for topic in recording.of_type(kind)
    ]
    pairs = _pairs(topics) or _pairs([(_rooted(body.frame), body) for body in _framed(recording)])
    if namespace:
        pairs = [pair for pair in pairs if pair.namespace == _rooted(namespace).rstrip('/')]
    if len(pairs) > 1:
        spaces = sorted(one_line(pair.namespace) or '/' for pair in pairs)
        raise ValueError(
            f'{recording.path} has several suites with poses of the wheels: choose one with --namespace '
            f'{listed(spaces, " or ")}'
        )
    return pairs[0] if pairs else None


def poses_of(body: Body, message: Any) -> Iterator[tuple[str, PoseSample]]:
    """The frame in which a message tells the pose of a body, and this pose, as often as the message has it."""
    for told in _READERS[body.topic.type](message):
        if not body.frame or told.frame == body.frame:
            yield told.parent, told.pose


def what_poses(recording: Recording) -> str:
    """What a recording has of poses that are none of the wheels', and how these would be found; empty for none."""
    told: dict[Stream, list[str]] = {
        topic: [topic.type] for kind in (*_READERS, *_UNREAD) for topic in recording.of_type(kind)
    }
    for body in _framed(recording)[:MOST_NAMED]:
        told[body.topic].append(one_line(body.frame))
    if not told:
        return ''
    there = [f'{one_line(topic.name)} ({", ".join(words)})' for topic, words in told.items()]
    return (
        f'poses of the wheels would do, in topics {NAMES[0].format(FRONT)} and {NAMES[0].format(REAR)} of '
        f'{FRONT_POSE.type}, say, or as frames {NAMES[1].format(FRONT)} and {NAMES[1].format(REAR)}: '
        f'it has {listed(there)}'
    )


def _pairs(bodies: list[tuple[str, Body]]) -> list[PoseSources]:
    """Both wheels of each namespace, from bodies by their names."""
    found: dict[str, PoseSources] = {}
    named = {(name, body.topic.type): body for name, body in reversed(bodies)}
    for pattern in NAMES:
        front_end, rear_end = (f'/{pattern.format(wheel)}' for wheel in (FRONT, REAR))
        for name, front in bodies:
            space = name.removesuffix(front_end)
            rear = named.get((space + rear_end, front.topic.type))
            if name.endswith(front_end) and rear:
                found.setdefault(space, PoseSources(space, front, rear))
    return list(found.values())


def _framed(recording: Recording) -> list[Body]:
    """Bodies that messages name by their frames, in the order in which they appear."""
    topics = [topic for kind in (_TRANSFORM, _TF) for topic in recording.of_type(kind)]
    found: dict[Body, None] = {}
    for topic in topics:
        if topic.name.rpartition('/')[2] != _STATIC:
            for _, _, message in islice(recording.decoded([topic]), LOOKED_AT):
                found |= dict.fromkeys(Body(topic, told.frame) for told in _READERS[topic.type](message) if told.frame)
    return list(found)


def _rooted(name: str) -> str:
    return f'/{name.lstrip("/")}'


def _told(header: Any, place: Any, turn: Any, frame: str = '') -> _Told:
    stamp_ns = int(header.stamp.sec) * SECOND + int(header.stamp.nanosec)
    pose = PoseSample(stamp_ns, (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))
    return _Told(frame, header.frame_id, pose)


def _posed(message: Any) -> list[_Told]:
    return [_told(message.header, message.pose.position, message.pose.orientation)]


def _uncertain(message: Any) -> list[_Told]:
    return [_told(message.header, message.pose.pose.position, message.pose.pose.orientation)]


def _transformed(message: Any) -> list[_Told]:
    move = message.transform
    return [_told(message.header, move.translation, move.rotation, message.child_frame_id)]


def _tree(message: Any) -> list[_Told]:
    return [told for one in message.transforms for told in _transformed(one)]


_READERS: dict[str, Callable[[Any], list[_Told]]] = {
    FRONT_POSE.type: _posed,
    'geometry_msgs/msg/PoseWithCovarianceStamped': _uncertain,
    'nav_msgs/msg/Odometry': _uncertain,
    _TRANSFORM: _transformed,
    _TF: _tree,
}
"""The messages that tell a pose and its time, by type, and what each tells."""
_UNREAD = ('geometry_msgs/msg/Pose', 'geometry_msgs/msg/PoseArray')
"""Messages that tell a pose without its time, or without a name."""

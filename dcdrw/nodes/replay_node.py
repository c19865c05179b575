"""The node of `dcdrw replay`: recorded joint states once more, with their own stamps, and the clock that they tell."""

import struct
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from dcdrw.recordings.bag_file import Message
from dcdrw.recordings.recorded_runs import runs_topic
from dcdrw.recordings.recording import Recording
from dcdrw_msgs_py.messages import to_stamp
from dcdrw_msgs_py.node import advertise, steady_clock
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.topics import CLOCK, JOINT_STATES, RUNS

TICK_SECONDS = 0.001
LOOK_SECONDS = 0.05
SETTLE_SECONDS = 1.5
"""So long nobody new must have come before the replay begins: DDS finds nodes, and what they listen to, one by one."""
CLOCK_NS = 10_000_000
"""How far the stamps go between two messages on /clock."""
STEP_NS = 1_000_000_000
"""A larger step of the stamps is none of the trial's time: the source has started anew, or has another clock."""
LONGEST_SECONDS = 0.05
"""Time after which a tick lets others in, where the replay is behind [s]."""


class Part(NamedTuple):
    """What of a recording is replayed, and how fast."""

    begin_ns: int
    end_ns: int
    rate: float
    loop: bool


class ReplayNode(Node):
    """Publishes each joint state when it is due by its stamp; what is late is sent at once, never dropped.

    So the rate is that of the trial's own time, also where this was simulated faster. Where the stamps stand still, go
    back or jump, the recorder's log tells the time. Until it begins, /clock stands at the first stamp: some nodes, the
    recorder of `ros2 bag record --use-sim-time` among them, listen to nothing before they know the time.
    """

    def __init__(
        self,
        recording: Recording,
        topic: str,
        joints: Callable[[int, int], Iterator[Message]],
        part: Part,
        names: Mapping[str, str],
        **kwargs: Any,
    ) -> None:
        super().__init__('replay', **kwargs)
        self._recording, self._joint_messages, self._part, self._names = recording, joints, part, names
        self._joints = advertise(self, JOINT_STATES)
        self._clock_publisher = advertise(self, CLOCK)
        self._runs = advertise(self, RUNS)
        self._announced: list[Message] = []
        self.sent = 0
        self.log_ns = part.begin_ns
        """Where in the recording the replay is."""
        self.done = False
        self._runs_topic = runs_topic(topic)
        self._found: tuple[int, ...] = ()
        self._since = time.monotonic()
        self._messages: Iterator[Message] = iter(())
        self._next: Message | None = None
        self._next_ns = 0
        self._due_ns = 0
        self._begun = 0.0
        self._told_ns = -CLOCK_NS
        self._begin()
        self._timer = self.create_timer(LOOK_SECONDS, self._wait, clock=steady_clock())

    def _begin(self) -> None:
        part = self._part
        self._messages = self._joint_messages(part.begin_ns, part.end_ns)
        self._announced = list(self._recording.messages([self._runs_topic]))
        self._next = next(self._messages, None)
        self._next_ns = _stamp_ns(self._next) if self._next else 0
        self._due_ns = 0
        self._begun = time.monotonic()

    def _wait(self) -> None:
        """Begin when somebody listens, and nobody new has come for a while."""
        if self._next:
            self._tell(self._next_ns)
        now = time.monotonic()
        found = (
            self._joints.get_subscription_count(),
            self._clock_publisher.get_subscription_count(),
            len(self.get_node_names()),
            len(self.get_topic_names_and_types()),
        )
        if found != self._found:
            self._found, self._since = found, now
        if self._joints.get_subscription_count() and now - self._since >= SETTLE_SECONDS:
            self.destroy_timer(self._timer)
            self._begun = now
            self._timer = self.create_timer(TICK_SECONDS, self._play, clock=steady_clock())

    def _play(self) -> None:
        if self.done:
            return
        now = time.monotonic()
        until_ns = int((now - self._begun) * self._part.rate * 1e9)
        while self._next and self._due_ns <= until_ns and time.monotonic() - now < LONGEST_SECONDS:
            self._publish(self._next, self._next_ns)
            self._advance()
        if self._next is None:
            if self._part.loop and self.sent:
                self._begin()
            else:
                self.done = True
                self._joints.wait_for_all_acked(Duration(seconds=1))

    def _advance(self) -> None:
        last, last_ns = self._next, self._next_ns
        self._next = next(self._messages, None)
        if last and self._next:
            self._next_ns = _stamp_ns(self._next)
            step_ns = self._next_ns - last_ns
            self._due_ns += step_ns if 0 < step_ns <= STEP_NS else self._next.log_ns - last.log_ns

    def _tell(self, now_ns: int) -> None:
        self._told_ns = now_ns
        self._clock_publisher.publish(Clock(clock=to_stamp(now_ns or 1)))  # zero says in ROS that no time is known

    def _publish(self, message: Message, stamp_ns: int) -> None:
        self.log_ns = message.log_ns
        if not 0 <= stamp_ns - self._told_ns < CLOCK_NS:  # the clock first: no sample lies far in the future
            self._tell(stamp_ns)
        while self._announced and _stamp_ns(self._announced[0]) <= stamp_ns:  # the run before its first sample
            self._runs.publish(self._announced.pop(0).data)
        if self._names:
            joints = deserialize_message(message.data, JointState)
            joints.name = [self._names.get(name, name) for name in joints.name]
            self._joints.publish(joints)
        else:
            self._joints.publish(message.data)
        self.sent += 1


def _stamp_ns(message: Message) -> int:
    """The stamp of a serialized JointState."""
    sec, nanosec = struct.unpack_from('<iI' if message.data[1] & 1 else '>iI', message.data, 4)
    return int(sec * SECOND + nanosec)

"""What every node does alike: declare parameters, advertise, listen, report, spin, and end cleanly."""

import ctypes
import faulthandler
import gc
import math
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from difflib import get_close_matches
from importlib import import_module
from itertools import pairwise
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

import rclpy
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from dcdrw_msgs_py.diagnosis import LOST_SAMPLES, Diagnosis, Level, lost_since
from dcdrw_msgs_py.executor import StreamExecutor
from dcdrw_msgs_py.messages import diagnostics_message, stamp_ns
from dcdrw_msgs_py.quantity import Field, build, fields, flatten
from dcdrw_msgs_py.samples import Runs
from dcdrw_msgs_py.topics import DIAGNOSTICS, RUNS, SAMPLE_DEPTH, Topic
from dcdrw_msgs_py.wire import JointStateReader

Params = TypeVar('Params', bound=tuple[Any, ...])

SPIN_SECONDS = 0.1
"""How long a spin waits at most before it looks whether a signal came."""
END_SECONDS = 5.0
"""A node that has not ended so long after a signal is ended by force: DDS was seen to hang for minutes [s]."""
ACKNOWLEDGED_SECONDS = 0.2
"""How long a publisher waits for its listeners to have received its last words [s]."""
LEASE_SECONDS = 1.0
"""The liveliness that a latched topic offers: who asks for as much is told when its publisher is gone [s]."""
TWIN_SECONDS = 0.2
"""A terminal and `ros2 launch` both pass on one Ctrl-C: a second signal this soon is the same one [s]."""
LOOK_SECONDS = 0.02
"""So seldom a publisher looks whether anybody listens: to look costs as much as to publish to nobody [s]."""
BURST_SECONDS = 4.0
"""Who has to miss nothing falls behind for so long in a burst, of a source that catches up, before it drops any [s]."""
BURST_DEPTH = 4 * SAMPLE_DEPTH
"""So many samples of such a burst wait at most: 3 s at 1 kHz, and what comes meanwhile."""
OLD, FRESH = 0.25, 0.05
"""Messages older than the first are too old to hear for long; those younger than the second are heard again [s]."""


class Parameters(Generic[Params]):
    """A parameter set declared on a node, and kept current: `value` is always a valid set.

    What is not declared `live` keeps its value: only the same one is accepted, so that a node's own dump can be loaded
    again. A live parameter that is set to something impossible is refused with the reason, by its bounds or by
    `validate`, which raises ValueError; else `on_change` is told the new set.

    Raises:
        ValueError: an override (YAML or command line) is impossible.

    """

    def __init__(
        self,
        node: Node,
        params: type[Params],
        on_change: Callable[[Params], None] | None = None,
        validate: Callable[[Params], object] | None = None,
    ) -> None:
        self._params, self._on_change, self._further = params, on_change, validate
        self._fields = {field.name: field for field in fields(params)}
        values = {
            name: node.declare_parameter(name, field.default, _descriptor(field)).value
            for name, field in self._fields.items()
        }
        self.value = build(params, values, f'parameter of {node.get_name()}')
        if validate:
            validate(self.value)
        for name, field in self._fields.items():  # only now: rclpy's message on a start out of range names no mend
            if limits := _range(field):
                node.set_descriptor(name, _descriptor(field, **limits))
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._apply)

    def _changed(self, parameters: list[Parameter]) -> Params | None:
        changes = {p.name: p.value for p in parameters if p.name in self._fields}
        if not changes:
            return None
        return build(self._params, {**flatten(self.value), **changes})

    def _validate(self, parameters: list[Parameter]) -> Any:
        try:
            changed = self._changed(parameters)
            if changed is not None:
                self._require_fixed(changed)
                if self._further:
                    self._further(changed)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _require_fixed(self, changed: Params) -> None:
        before = flatten(self.value)
        for name in self._differing(changed):
            if not self._fields[name].quantity.live:
                raise ValueError(f'{name} is fixed while the node runs (now {before[name]}); give it at the start')

    def _differing(self, changed: Params) -> list[str]:
        """Names of the parameters that another set has otherwise."""
        before, after = flatten(self.value), flatten(changed)
        return [name for name in self._fields if repr(after[name]) != repr(before[name])]  # NaN differs from itself

    def _apply(self, parameters: list[Parameter]) -> None:
        changed = self._changed(parameters)
        if changed is not None and self._differing(changed):
            self.value = changed
            if self._on_change:
                self._on_change(changed)


def _descriptor(field: Field, **limits: Any) -> Any:
    quantity = field.quantity
    default = f'; default: {quantity.derived}' if quantity.derived else ''
    unit = f' [{quantity.unit}]' if quantity.unit else ''
    return ParameterDescriptor(
        name=field.name,
        description=f'{quantity.doc}{unit}{default}',
        additional_constraints=', '.join(filter(None, (quantity.bounds, '' if quantity.live else 'fixed'))),
        dynamic_typing=True,  # a YAML integer does for a double
        **limits,
    )


def _range(field: Field) -> dict[str, Any]:
    """The range that lets rqt show a slider, where a number has two bounds; a derived default, NaN, lies in none."""
    quantity = field.quantity
    low, high = max(quantity.low, quantity.above), quantity.high
    if field.kind not in (int, float) or quantity.derived or not (math.isfinite(low) and math.isfinite(high)):
        return {}
    if field.kind is int:
        return {'integer_range': [IntegerRange(from_value=int(low), to_value=int(high))]}
    return {'floating_point_range': [FloatingPointRange(from_value=low, to_value=high)]}


def message_type(topic: Topic) -> Any:
    """The class of a topic's messages."""
    package, kind, name = topic.type.split('/')
    return getattr(import_module(f'{package}.{kind}'), name)


_outlets: dict[str, list['Outlet']] | None = None
"""Where several nodes share this process: who of them publishes a stream, by its full name."""


class Outlet:
    """A publisher that costs next to nothing while nobody listens.

    In a shared process it hands what it publishes directly to the other nodes that listen.
    """

    def __init__(self, publisher: Any, latched: bool) -> None:
        self._publisher, self._latched = publisher, latched
        self._listeners, self._look_at = 0, 0.0
        self._by_message: list[Callable[[Any], None]] = []
        self._by_sample: list[Callable[[Any], None]] = []
        self._last: Any = None

    @property
    def is_heard(self) -> bool:
        """Whether anybody listens, or will hear it later, so that a message is worth being made."""
        return bool(self._by_message or self._is_heard_outside())

    def hand_to(self, callback: Callable[[Any], None], take_sample: Callable[[Any], None] | None) -> None:
        """Hand over from now on, of a latched topic the last message at once; arguments as of `listen`."""
        if take_sample:
            self._by_sample.append(take_sample)
            return
        self._by_message.append(callback)
        if self._last is not None:
            callback(self._last)

    def publish(self, message: Any) -> None:
        """Publish a message, or its bytes, to all who listen now; a listener of this process must not keep it."""
        self._publish(message, self._is_heard_outside())

    def _publish(self, message: Any, is_heard_outside: bool) -> None:
        if self._latched:
            self._last = message
        if is_heard_outside:
            self._publisher.publish(message)
        if self._by_message and isinstance(message, bytes):
            message = deserialize_message(message, self._publisher.msg_type)
        for callback in self._by_message:
            callback(message)

    def publish_sample(self, sample: Any, write: Callable[[Any], Any]) -> None:
        """Publish a sample, as a message, or its bytes, that `write` makes of it where somebody needs one."""
        is_heard_outside = self._is_heard_outside()
        if self._by_message or is_heard_outside:
            self._publish(write(sample), is_heard_outside)
        for take_sample in self._by_sample:
            take_sample(sample)

    def _is_heard_outside(self) -> bool:
        now = time.monotonic()
        if now >= self._look_at:
            self._listeners, self._look_at = self._publisher.get_subscription_count(), now + LOOK_SECONDS
        return bool(self._latched or self._listeners)

    def __getattr__(self, name: str) -> Any:
        """All else is the publisher's."""
        return getattr(self._publisher, name)


def share_process() -> None:
    """From now on, nodes made in this process hand streams to those made after them directly, without DDS."""
    global _outlets
    _outlets = {}


def advertise(node: Node, topic: Topic, from_threads: bool = False) -> Any:
    """Publish a topic: reliably, and latched where it is declared so.

    Args:
        node: the node.
        topic: the topic.
        from_threads: whether other threads than the executor's publish it, so that it takes the way by DDS even to a
            node of the same process.

    """
    durability = DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
    qos = QoSProfile(depth=topic.depth, reliability=ReliabilityPolicy.RELIABLE, durability=durability)
    if topic.latched:  # what is kept outlives whoever said it: let consumers ask whether that node still lives
        qos.liveliness_lease_duration = Duration(seconds=LEASE_SECONDS)
    outlet = Outlet(node.create_publisher(message_type(topic), topic.name, qos), topic.latched)
    if _outlets is not None and (topic.latched or topic.depth == SAMPLE_DEPTH) and not from_threads:
        _outlets.setdefault(outlet.topic_name, []).append(outlet)
    return outlet


class Inbox:
    """Passes messages on while they are fresh.

    A subscriber that cannot keep up would hear ever older messages, up to the depth of its queue. Once messages have
    been older than OLD, and ever older, for longer than its patience, all that wait are dropped and counted, down to
    the newest ones. A short stall, or a burst, loses nothing. Where dropping alone takes longer than messages take to
    come, one is passed on every OLD seconds all the same, so that the subscriber does not take its input for silent.
    """

    def __init__(
        self, callback: Callable[[Any], None], patience: float = OLD, read: Callable[[bytes], Any] | None = None
    ) -> None:
        self._callback, self._patience, self._read = callback, patience, read
        self._behind_since, self._oldest = math.inf, 0.0
        self._dropping, self._passed_at = False, 0.0
        self.dropped = 0
        """Messages that were dropped so far."""
        self.unreadable = 0
        """Messages whose bytes are none."""
        self.age = 0.0
        """How long the message that is passed on has waited here [s]."""

    def __call__(self, message: Any, info: Any) -> None:
        """Take a message with rclpy's MessageInfo."""
        self.age = age = max((time.time_ns() - info['received_timestamp']) * 1e-9, 0.0)
        if self._dropping:
            self._dropping = age > FRESH
        elif age <= OLD:
            self._behind_since = math.inf
        else:
            now = time.monotonic()
            if math.isinf(self._behind_since) or age < self._oldest - FRESH:  # it is catching up
                self._behind_since, self._oldest = now, age
            self._oldest = max(self._oldest, age)
            if now - self._behind_since > self._patience:
                self._dropping, self._behind_since, self._passed_at = True, math.inf, now
        if self._dropping and time.monotonic() - self._passed_at <= OLD:
            self.dropped += 1
            return
        if self._read:
            try:
                message = self._read(message)
            except RuntimeError:  # of rclpy, which passes over such bytes where it reads them by itself
                self.unreadable += 1
                return
        self._callback(message)
        if self._dropping:
            self._passed_at = time.monotonic()


def listen(
    node: Node,
    topic: Topic,
    callback: Callable[[Any], None],
    depth: int = SAMPLE_DEPTH,
    take_sample: Callable[[Any], None] | None = None,
    misses_nothing: bool = False,
) -> Any:
    """Subscribe so that reliable and best-effort publishers both match; to a latched topic, as it is published.

    Where the node cannot keep up, an `Inbox` drops what is old; `report` tells of it. In a shared process, what another
    node of it publishes is handed over, and heard from nobody else; there is no subscription then.

    Args:
        node: the node.
        topic: the topic.
        callback: is called with each message.
        depth: so many messages wait at least.
        take_sample: is called in its place with the sample itself, where another node of this process hands samples
            over (`Outlet.publish_sample`).
        misses_nothing: whether a burst of BURST_DEPTH messages is worked off, though it grows old, where a subscriber
            that shows or acts upon the newest message alone drops what is old.

    """
    outlets = _outlets.get(node.resolve_topic_name(topic.name)) if _outlets else None
    if outlets:
        for outlet in outlets:
            outlet.hand_to(callback, take_sample)
        return None
    if topic.latched:
        qos = QoSProfile(
            depth=topic.depth, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
        )
        return node.create_subscription(message_type(topic), topic.name, callback, qos)
    depth = max(topic.depth, depth, BURST_DEPTH if misses_nothing else 0)
    qos = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
    kind = message_type(topic)
    read = JointStateReader() if kind is JointState else None
    inbox = Inbox(callback, BURST_SECONDS if misses_nothing else OLD, read)
    return node.create_subscription(kind, topic.name, inbox.__call__, qos, raw=bool(read))


def listen_aged(
    node: Node,
    topic: Topic,
    callback: Callable[[Any, float], None],
    take_sample: Callable[[Any], None] | None = None,
) -> Any:
    """As `listen`; the callback is told as well how long ago the message was received [s].

    Where a process was not let run, what has waited is told from what is fresh.
    """

    def pass_on(message: Any) -> None:
        callback(message, inbox.age if inbox else 0.0)

    subscription = listen(node, topic, pass_on, take_sample=take_sample)
    inbox = subscription and subscription.callback.__self__
    return subscription


def follow_runs(node: Node, runs: Runs) -> Any:
    """Hear what the source announces; subscribe to the samples after this, for what is ready is read in this order."""
    return listen(node, RUNS, lambda message: runs.announce(stamp_ns(message.stamp), message.frame_id))


def dropped(node: Node) -> dict[str, int]:
    """How many messages of each topic a node has dropped because it could not keep up; only topics that lost some."""
    return {name: inbox.dropped for name, inbox in _inboxes(node) if inbox.dropped}


def _inboxes(node: Node) -> list[tuple[str, Inbox]]:
    """The inboxes of a node's subscriptions, with their topics."""
    every = [(one.topic_name, getattr(one.callback, '__self__', None)) for one in node.subscriptions]
    return [(name, inbox) for name, inbox in every if isinstance(inbox, Inbox)]


def publishers(node: Node, topic: Topic) -> list[str]:
    """The nodes that publish a topic, by their full names, each as often as it does."""
    ends = node.get_publishers_info_by_topic(node.resolve_topic_name(topic.name))
    return sorted(f'{end.node_namespace.rstrip("/")}/{end.node_name}' for end in ends)


def publish_diagnosis(
    node: Node, diagnose: Callable[[], Diagnosis], warns_of_losses: bool = True
) -> Callable[[], None]:
    """Publish a node's diagnosis once a second, by a clock that goes on where simulated time stands still.

    Args:
        node: the node.
        diagnose: what it says of itself.
        warns_of_losses: whether many samples lost within a second are a warning; else the node judges that itself, as
            one does that passes over frames while it works.

    Returns:
        publishes it at once: to be called when the node's state has changed.

    """
    publisher = advertise(node, DIAGNOSTICS)
    told: dict[str, int] = {}
    missing: Any = 0

    def publish() -> None:
        nonlocal missing
        diagnosis, lost = diagnose(), dropped(node)
        before, missing = missing, diagnosis.values.get(LOST_SAMPLES, 0)
        diagnosis = lost_since(diagnosis, before) if warns_of_losses else diagnosis
        unreadable = {f'unreadable bytes on {name}': box.unreadable for name, box in _inboxes(node) if box.unreadable}
        unheard = {f'messages dropped of {topic}': count for topic, count in lost.items()}
        values = {**diagnosis.values, **unheard, **unreadable}
        level, message = diagnosis.level, diagnosis.message
        if lost != told:
            news = ', '.join(f'{count - told.get(topic, 0)} of {topic}' for topic, count in lost.items())
            level, message = max(level, Level.WARN), f'overloaded: dropped {news} within a second; {message}'
            told.update(lost)
        name = node.get_fully_qualified_name()
        publisher.publish(diagnostics_message(name, Diagnosis(level, message, values), clock_ns(node)))

    node.create_timer(1.0, publish, clock=steady_clock())
    return publish


def clock_ns(node: Node) -> int:
    """What a node's clock says [ns], at half the cost of the object that rclpy makes of it."""
    clock = node.get_clock().handle
    with clock:
        return int(clock.get_now().nanoseconds)


def steady_clock() -> Clock:
    """A clock that never jumps, for ages and pace."""
    return Clock(clock_type=ClockType.STEADY_TIME)


class Age:
    """How long ago something last happened, by a steady clock."""

    def __init__(self) -> None:
        self._at = -math.inf

    def renew(self, ago: float = 0.0) -> None:
        """It happened so many seconds ago."""
        self._at = time.monotonic() - ago

    @property
    def seconds(self) -> float:
        """Seconds since; infinite where it never happened."""
        return time.monotonic() - self._at


def _warn_of_unknown(nodes: list[Node], arguments: list[str]) -> None:
    """Warn of parameters on the command line (-p NAME:=VALUE) that no node has."""
    node = nodes[0]
    known = [parameter.name for each in nodes for parameter in each.get_parameters_by_prefix('').values()]
    for flag, value in pairwise(arguments):
        whose, _, name = value.split(':=')[0].rpartition(':')
        if whose and whose not in [one.get_name() for one in nodes]:
            continue  # of a node in another process, which the same arguments start
        if flag in ('-p', '--param') and ':=' in value and name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f'did you mean {near[0]}?' if near else '`ros2 param list` names those that there are'
            node.get_logger().warning(f'no parameter is named {name}, so it has no effect; {hint}')


@runtime_checkable
class HasLastWords(Protocol):
    """A node that has something to publish before it ends in order."""

    def say_last_words(self) -> None:
        """Publish what must not be left as it is."""


def run(name: str, make_node: Callable[[], Node], args: list[str] | None = None) -> int:
    """Run one node until SIGINT, SIGTERM or shutdown; returns the process's exit status: as `run_all`."""
    return run_all(name, lambda: [make_node()], args)


def run_all(name: str, make_nodes: Callable[[], list[Node]], args: list[str] | None = None) -> int:
    """Run nodes until SIGINT, SIGTERM or shutdown; returns the process's exit status.

    An impossible parameter or argument ends it with one line and status 2.
    """
    stopped = 0.0

    def stop(*_: object) -> None:
        # It takes no lock and raises nothing, so that further signals do no harm, even while it runs.
        nonlocal stopped
        if not stopped:
            stopped = time.monotonic()
        elif time.monotonic() > stopped + TWIN_SECONDS:
            os._exit(0)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        nodes = make_nodes()
    except (ValueError, RuntimeError, InvalidParameterTypeException, InvalidParameterValueException) as error:
        print(f'{name}: {error}', file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    _warn_of_unknown(nodes, sys.argv if args is None else args)
    executor = StreamExecutor()
    for node in nodes:
        executor.add_node(node)
    gc.freeze()  # what exists now stays: collections that come need not look at it
    with suppress(ExternalShutdownException):
        while not stopped and rclpy.ok():
            executor.spin_once(timeout_sec=SPIN_SECONDS)
    # A thread without Python ends what hangs: DDS may hold the interpreter.
    faulthandler.dump_traceback_later(END_SECONDS, exit=True, file=open(os.devnull, 'w'))  # noqa: SIM115
    for node in nodes:
        writers = list(node.publishers)
        if isinstance(node, HasLastWords):
            node.say_last_words()
            for publisher in writers:  # what is lost on the way is sent again only while its writer lives
                publisher.wait_for_all_acked(Duration(seconds=ACKNOWLEDGED_SECONDS))
    # In this order, so that no thread of DDS outlives what it works on: neither waits for Python's own end.
    executor.shutdown()
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown()
    ignore_end_signals()  # Python itself ends now, and would die of a second one
    return 0


def ignore_end_signals() -> None:
    """Ignore SIGINT and SIGTERM from here on, also one that comes meanwhile."""
    ignore = ctypes.c_void_p(int(signal.SIG_IGN))
    for number in (signal.SIGINT, signal.SIGTERM):
        # Linux first: Python, told alone, complains at length of one that has come before Linux ignores them.
        ctypes.pythonapi.PyOS_setsig(int(number), ignore)
        signal.signal(number, signal.SIG_IGN)

"""What every node does alike: declare parameters, advertise, listen, report, spin, and end cleanly."""

import gc
import math
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import Any, Generic, TypeVar

import rclpy
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from dcdrw_msgs_py.diagnosis import Diagnosis
from dcdrw_msgs_py.messages import diagnostics_message
from dcdrw_msgs_py.quantity import Field, build, fields, flatten
from dcdrw_msgs_py.topics import DIAGNOSTICS, SAMPLE_DEPTH, Topic

Params = TypeVar('Params', bound=tuple[Any, ...])

SPIN_SECONDS = 0.1
"""How long a spin waits at most before it looks whether a signal came."""


class Parameters(Generic[Params]):
    """A parameter set declared on a node, and kept current: `value` is always a valid set.

    What is not declared `live` is read-only. A live parameter that is set to something impossible is refused
    with the reason, by its bounds or by `validate`, which raises ValueError; else `on_change` is told the new set.

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
            if changed is not None and self._further:
                self._further(changed)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        changed = self._changed(parameters)
        if changed is not None and changed != self.value:
            self.value = changed
            if self._on_change:
                self._on_change(changed)


def _descriptor(field: Field) -> Any:
    quantity = field.quantity
    default = f'; default: {quantity.derived}' if quantity.derived else ''
    unit = f' [{quantity.unit}]' if quantity.unit else ''
    return ParameterDescriptor(
        name=field.name,
        description=f'{quantity.doc}{unit}{default}',
        additional_constraints=quantity.bounds,
        read_only=not quantity.live,
        dynamic_typing=True,
    )  # dynamic: a YAML integer does for a double


def message_type(topic: Topic) -> Any:
    """The class of a topic's messages."""
    package, kind, name = topic.type.split('/')
    return getattr(import_module(f'{package}.{kind}'), name)


def advertise(node: Node, topic: Topic) -> Any:
    """Publish a topic: reliably, and latched where it is declared so."""
    durability = DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
    qos = QoSProfile(depth=topic.depth, reliability=ReliabilityPolicy.RELIABLE, durability=durability)
    return node.create_publisher(message_type(topic), topic.name, qos)


def listen(node: Node, topic: Topic, callback: Callable[[Any], None], depth: int = SAMPLE_DEPTH) -> Any:
    """Subscribe so that reliable and best-effort publishers both match; to a latched topic, as it is published."""
    qos = QoSProfile(depth=max(topic.depth, depth), reliability=ReliabilityPolicy.BEST_EFFORT)
    if topic.latched:
        qos = QoSProfile(
            depth=topic.depth, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
        )
    return node.create_subscription(message_type(topic), topic.name, callback, qos)


def report(node: Node, diagnose: Callable[[], Diagnosis]) -> None:
    """Publish a node's diagnosis once a second, by a clock that goes on where simulated time stands still."""
    publisher = advertise(node, DIAGNOSTICS)
    name = node.get_fully_qualified_name().lstrip('/')

    def publish() -> None:
        publisher.publish(diagnostics_message(name, diagnose(), node.get_clock().now().nanoseconds))

    node.create_timer(1.0, publish, clock=steady_clock())


def steady_clock() -> Clock:
    """A clock that never jumps, for ages and pace."""
    return Clock(clock_type=ClockType.STEADY_TIME)


class Age:
    """How long ago something last happened, by a steady clock."""

    def __init__(self) -> None:
        self._at = -math.inf

    def renew(self) -> None:
        """It happened now."""
        self._at = time.monotonic()

    @property
    def seconds(self) -> float:
        """Seconds since; infinite where it never happened."""
        return time.monotonic() - self._at


def make_executor() -> Any:
    """The events executor, at a third of the default's cost, where this rclpy has it."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor()
    return EventsExecutor()


def run(name: str, make_node: Callable[[], Node], args: list[str] | None = None) -> int:
    """Run one node until SIGINT, SIGTERM or shutdown; returns the process's exit status.

    An impossible parameter or argument ends it with one line and status 2.
    """
    stopped = False

    def stop(*_: object) -> None:
        # It takes no lock and raises nothing, so that further signals do no harm, even while it runs.
        nonlocal stopped
        stopped = True

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
    except (ValueError, RuntimeError, InvalidParameterTypeException, InvalidParameterValueException) as error:
        print(f'{name}: {error}', file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    executor = make_executor()
    executor.add_node(node)
    gc.freeze()  # what exists now stays: collections that come need not look at it
    with suppress(ExternalShutdownException):
        while not stopped and rclpy.ok():
            executor.spin_once(timeout_sec=SPIN_SECONDS)
    # In this order, so that no thread of DDS outlives what it works on: neither waits for Python's own end.
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()
    for number in (signal.SIGINT, signal.SIGTERM):  # Python itself ends now, and would die of a second signal
        signal.signal(number, signal.SIG_IGN)
    return 0

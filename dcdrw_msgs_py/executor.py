"""An executor for streams of messages: timers go on however many messages come, and queues stay bounded."""

import math
import time
from typing import Any, NamedTuple

from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.subscription import Subscription
from rclpy.utilities import timeout_sec_to_nsec
from rclpy.waitable import NumberOfEntities

from dcdrw_msgs_py.topics import CLOCK

TURN_SECONDS = 0.01
"""How long one subscription is read at most before timers, services and the other subscriptions have their turn [s]."""
SELDOM_SECONDS = 0.02
"""While messages and timers keep coming, services and clients are looked at so seldom [s]."""
RARELY_SECONDS = 0.2
"""And so rarely what else there is: events, of which each publisher and each subscription has several [s]."""
_STREAM_KINDS = ('timer', 'subscription', 'guard_condition')
_ASKING_KINDS = ('service', 'client')


class _Streams(NamedTuple):
    """What all nodes wait for all the time."""

    subscriptions: tuple[Any, ...] = ()
    guards: tuple[Any, ...] = ()
    timers: tuple[Any, ...] = ()


class _Seldom(NamedTuple):
    """What happens seldom: several times as many, and each costs time in every wait."""

    clients: tuple[Any, ...] = ()
    services: tuple[Any, ...] = ()
    waitables: tuple[Any, ...] = ()
    """What happens rarely."""


class StreamExecutor(Executor):
    """Runs callbacks in one thread, and reads every message that waits before it waits again.

    rclpy's own single-threaded executor builds a wait set anew for every message, at several times the cost; its
    events executor queues one event for each message without bound, so that a node which is slower than its input
    serves its timers ever later. Here a message that is not read yet waits in its subscription, whose depth bounds
    it, and timers come first. Entities must be created and destroyed in the thread that spins.
    """

    _tasks: list[Any]
    _streams = _Streams()
    _seldom = _Seldom()
    _has_changed = True
    _known: set[Any] | None = None
    _seldom_due = 0.0
    _rarely_due = 0.0
    _wait_set: Any = None
    _by_handle: dict[int, Any]
    """The streams' entities."""

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait until something is ready, and run the callbacks of all that is.

        Args:
            timeout_sec: how long to wait at most [s]; for ever where it is None.

        Raises:
            ExternalShutdownException: the context was shut down.

        """
        self._run_tasks()
        end = math.inf if timeout_sec is None or timeout_sec < 0.0 else time.monotonic() + timeout_sec
        if self._has_changed or self._known != self._nodes:
            self._look_up()
        ready: list[list[int]] = []
        seldom = None
        soon = min(end, self._seldom_due)
        while not any(ready) and time.monotonic() < soon:  # a timer that is set anew ends a wait, too
            ready = self._wait(None, soon)
        if not any(ready):
            asked = False
            if time.monotonic() < self._rarely_due:
                seldom = self._seldom._replace(waitables=())
                ready = self._wait(seldom, min(end, self._rarely_due))
                asked = any(map(self._wait_set.get_ready_entities, _ASKING_KINDS))
            if not (any(ready) or asked):
                seldom = self._seldom
                ready = self._wait(seldom, end)
                self._rarely_due = time.monotonic() + RARELY_SECONDS
            self._seldom_due = time.monotonic() + SELDOM_SECONDS
        timers, subscriptions, guards = ready
        by_handle = self._by_handle  # what a callback brings or takes is looked up before the next wait
        for pointer in timers:
            timer = by_handle[pointer]
            try:
                with timer.handle:
                    is_due = timer.handle.is_timer_ready()
                    if is_due:
                        timer.handle.call_timer()
            except InvalidHandle:  # another one's callback has destroyed it
                continue
            if is_due:
                timer.callback()
        for pointer in subscriptions:
            self._read(by_handle[pointer])
        for pointer in guards:
            if guard := by_handle.get(pointer):  # else one of the executor's own, which have only ended the wait
                self._handle(guard, self._take_guard_condition)
        if seldom:
            self._see_to(seldom)

    def spin_once_until_future_complete(self, future: Any, timeout_sec: Any = None) -> None:
        """As `spin_once`; a future that is done ends the wait."""
        future.add_done_callback(lambda _: self.wake())
        self.spin_once(getattr(timeout_sec, 'timeout', timeout_sec))

    def wake(self) -> None:
        """End a wait, because entities of a node have come or gone, or a future is done."""
        self._has_changed = True
        super().wake()

    def _look_up(self) -> None:
        """Find what there is to wait for."""
        self._has_changed, self._known = False, set(self._nodes)
        self._streams, self._seldom = _Streams(*self._all_of(_Streams)), _Seldom(*self._all_of(_Seldom))
        self._by_handle = {entity.handle.pointer: entity for kind in self._streams for entity in kind}
        self._wait_set = self._make_wait_set(self._streams, self._seldom)
        self._seldom_due = self._rarely_due = 0.0

    def _all_of(self, kinds: type[_Streams | _Seldom]) -> list[tuple[Any, ...]]:
        """The entities of these kinds, of all nodes."""
        nodes = self.get_nodes()
        return [tuple(entity for node in nodes for entity in getattr(node, kind)) for kind in kinds._fields]

    def _make_wait_set(self, streams: _Streams, seldom: _Seldom) -> Any:
        count = NumberOfEntities(
            len(streams.subscriptions),
            len(streams.guards) + 2,
            len(streams.timers),
            len(seldom.clients),
            len(seldom.services),
        )
        for waitable in seldom.waitables:
            count += waitable.get_num_entities()
        return _rclpy.WaitSet(
            count.num_subscriptions,
            count.num_guard_conditions,
            count.num_timers,
            count.num_clients,
            count.num_services,
            count.num_events,
            self._context.handle,
        )

    def _wait(self, seldom: _Seldom | None, end: float) -> list[list[int]]:
        """Wait until a time [s], and return the handles of the streams that are ready, by their kind."""
        wait_set, streams = self._wait_set, self._streams
        wait_set.clear_entities()
        for subscription in streams.subscriptions:
            wait_set.add_subscription(subscription.handle)
        for timer in streams.timers:
            wait_set.add_timer(timer.handle)
        for guard in (*streams.guards, self._guard, self._sigint_gc):
            wait_set.add_guard_condition(guard.handle)
        if seldom:
            for client in seldom.clients:
                wait_set.add_client(client.handle)
            for service in seldom.services:
                wait_set.add_service(service.handle)
            for waitable in seldom.waitables:
                waitable.add_to_wait_set(wait_set)
        wait_set.wait(timeout_sec_to_nsec(None if math.isinf(end) else max(end - time.monotonic(), 0.0)))
        if not self._context.ok():
            raise ExternalShutdownException
        return [wait_set.get_ready_entities(kind) for kind in _STREAM_KINDS]

    def _see_to(self, seldom: _Seldom) -> None:
        """Run what services, clients and waitables have to do after the last wait."""
        wait_set = self._wait_set
        for waitable in [one for one in seldom.waitables if one.is_ready(wait_set)]:
            self._handle(waitable, self._take_waitable)
        for entities, kind, take in (
            (seldom.services, 'service', self._take_service),
            (seldom.clients, 'client', self._take_client),
        ):
            asked = set(wait_set.get_ready_entities(kind))
            for entity in entities:
                if entity.handle.pointer in asked:
                    self._handle(entity, take)

    def _read(self, subscription: Any) -> None:
        """Take what waits in a subscription, for at most TURN_SECONDS."""
        with_info = subscription._callback_type is Subscription.CallbackType.WithMessageInfo
        end = time.monotonic() + TURN_SECONDS
        while True:
            try:
                with subscription.handle:
                    taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            except InvalidHandle:  # a callback has destroyed it
                return
            if taken is None:
                return
            if subscription.topic_name == CLOCK.name and not subscription.raw and taken[0].clock.sec < 0:
                continue  # rclpy's own subscription would raise
            if with_info:
                subscription.callback(*taken)
            else:
                subscription.callback(taken[0])
            if time.monotonic() >= end:
                return

    def _handle(self, entity: Any, take: Any) -> None:
        """Run what happens seldom as rclpy does."""
        task = self._make_handler(entity, None, take)
        task()
        self._finish(task)

    def _run_tasks(self) -> None:
        """Go on with coroutines that wait."""
        with self._tasks_lock:
            tasks = [task for task, _, _ in self._tasks]
        for task in tasks:
            if not task.executing() and not task.done():
                task()
                self._finish(task)
        with self._tasks_lock:
            self._tasks = [one for one in self._tasks if not one[0].done()]

    def _finish(self, task: Any) -> None:
        if task.done() and task.exception() is not None:
            raise task.exception()

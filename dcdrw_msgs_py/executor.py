"""An executor for streams of messages: timers go on however many messages come, and queues stay bounded."""

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


class _Entities(NamedTuple):
    """What all nodes wait for."""

    subscriptions: tuple[Any, ...]
    guards: tuple[Any, ...]
    timers: tuple[Any, ...]
    clients: tuple[Any, ...]
    services: tuple[Any, ...]
    waitables: tuple[Any, ...]


class StreamExecutor(Executor):
    """Runs callbacks in one thread, and reads every message that waits before it waits again.

    rclpy's own single-threaded executor builds a wait set anew for every message, at several times the cost; its
    events executor queues one event for each message without bound, so that a node which is slower than its input
    serves its timers ever later. Here a message that is not read yet waits in its subscription, whose depth bounds
    it, and timers come first. Entities must be created and destroyed in the thread that spins.
    """

    _tasks: list[Any]
    _known: _Entities | None = None
    _wait_set: Any = None

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait until something is ready, and run the callbacks of all that is.

        Args:
            timeout_sec: how long to wait at most [s]; for ever where it is None.

        Raises:
            ExternalShutdownException: the context was shut down.

        """
        self._run_tasks()
        nodes = self.get_nodes()
        entities = _Entities(
            *(
                tuple(entity for node in nodes for entity in getattr(node, kind))
                for kind in ('subscriptions', 'guards', 'timers', 'clients', 'services', 'waitables')
            )
        )
        if entities != self._known:
            self._wait_set, self._known = self._make_wait_set(entities), entities
        ready = self._wait(entities, timeout_sec_to_nsec(timeout_sec))
        for timer in entities.timers:
            if timer.handle.pointer in ready and timer.handle.is_timer_ready():
                timer.handle.call_timer()
                timer.callback()
        for subscription in entities.subscriptions:
            if subscription.handle.pointer in ready:
                self._read(subscription)
        for some, take in (
            (entities.services, self._take_service),
            (entities.clients, self._take_client),
            (entities.guards, self._take_guard_condition),
        ):
            for entity in some:
                if entity.handle.pointer in ready:
                    self._handle(entity, take)

    def spin_once_until_future_complete(self, future: Any, timeout_sec: Any = None) -> None:
        """As `spin_once`; a future that is done ends the wait."""
        future.add_done_callback(lambda _: self.wake())
        self.spin_once(getattr(timeout_sec, 'timeout', timeout_sec))

    def _make_wait_set(self, entities: _Entities) -> Any:
        count = NumberOfEntities(
            len(entities.subscriptions),
            len(entities.guards) + 2,
            len(entities.timers),
            len(entities.clients),
            len(entities.services),
        )
        for waitable in entities.waitables:
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

    def _wait(self, entities: _Entities, timeout_ns: int) -> set[int]:
        """Wait, run what waitables have to do, and return the handles of the other entities that are ready."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        for subscription in entities.subscriptions:
            wait_set.add_subscription(subscription.handle)
        for timer in entities.timers:
            wait_set.add_timer(timer.handle)
        for client in entities.clients:
            wait_set.add_client(client.handle)
        for service in entities.services:
            wait_set.add_service(service.handle)
        for guard in (*entities.guards, self._guard, self._sigint_gc):
            wait_set.add_guard_condition(guard.handle)
        for waitable in entities.waitables:
            waitable.add_to_wait_set(wait_set)
        wait_set.wait(timeout_ns)
        if not self._context.ok():
            raise ExternalShutdownException
        for waitable in [one for one in entities.waitables if one.is_ready(wait_set)]:
            self._handle(waitable, self._take_waitable)
        kinds = ('subscription', 'timer', 'service', 'client', 'guard_condition')
        return {pointer for kind in kinds for pointer in wait_set.get_ready_entities(kind)}

    def _read(self, subscription: Any) -> None:
        """Take what waits in a subscription, for at most TURN_SECONDS."""
        with_info = subscription._callback_type is Subscription.CallbackType.WithMessageInfo
        end = time.monotonic() + TURN_SECONDS
        while True:
            try:
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

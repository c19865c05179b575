"""Streams over real DDS within one process: timers go on, queues stay bounded, and what is old is dropped and told."""

import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64
from std_srvs.srv import Trigger

from dcdrw.suite.processes import free_domain
from dcdrw_msgs_py import node as nodes
from dcdrw_msgs_py.executor import StreamExecutor
from dcdrw_msgs_py.node import (
    BURST_DEPTH,
    BURST_SECONDS,
    FRESH,
    OLD,
    Inbox,
    advertise,
    dropped,
    listen,
    share_process,
    steady_clock,
)
from dcdrw_msgs_py.topics import DIAGNOSTICS, JOINT_STATES, PHI, SYNCHRONIZED
from dcdrw_msgs_py.wire import float_bytes
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes


class Pair:
    """A node that hears and one that speaks, in one executor each."""

    def __init__(self, domain: int) -> None:
        self.context = Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self.hearer = rclpy.create_node('hearer', context=self.context)
        self.speaker = rclpy.create_node('speaker', context=self.context)
        self.executor = StreamExecutor(context=self.context)
        self.executor.add_node(self.hearer)
        self.executor.add_node(self.speaker)

    def until(self, condition: Callable[[], object], what: str) -> None:
        limit = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < limit, f'waited in vain for {what}'
            self.executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        self.executor.shutdown()
        self.hearer.destroy_node()
        self.speaker.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture
def pair() -> Iterator[Pair]:
    with free_domain() as domain:
        pair = Pair(domain)
        yield pair
        pair.close()


def test_a_timer_has_its_turn_among_messages_that_come_faster_than_they_are_read(pair):
    heard: list[float] = []
    ticks: list[int] = []

    def hear(message):
        heard.append(message.data)
        time.sleep(0.001)

    pair.hearer.create_subscription(Float64, 'phi', hear, 1000)
    publisher = pair.speaker.create_publisher(Float64, 'phi', 1000)
    pair.until(publisher.get_subscription_count, 'the subscription')
    pair.hearer.create_timer(0.01, lambda: ticks.append(len(heard)), clock=steady_clock())
    for i in range(500):
        publisher.publish(Float64(data=float(i)))
    pair.until(lambda: len(heard) == 500, 'every message')
    assert heard == sorted(heard)
    assert len({count for count in ticks if 0 < count < 500}) >= 5


def test_services_are_served_and_entities_come_and_go_while_it_spins(pair):
    pair.hearer.create_service(Trigger, 'ping', lambda request, response: response)
    client = pair.speaker.create_client(Trigger, 'ping')
    pair.until(client.service_is_ready, 'the service')
    answer = client.call_async(Trigger.Request())
    pair.until(answer.done, 'the answer')
    heard: list[float] = []
    subscription = listen(pair.hearer, PHI, lambda message: heard.append(message.data))
    publisher = pair.speaker.create_publisher(Float64, 'phi', 10)
    pair.until(publisher.get_subscription_count, 'the subscription')
    publisher.publish(Float64(data=1.0))
    pair.until(lambda: heard == [1.0], 'the message')
    pair.hearer.destroy_subscription(subscription)
    pair.until(lambda: not publisher.get_subscription_count(), 'its end')


def test_what_another_callback_has_destroyed_is_passed_over(pair):
    """Both are ready at once, and whichever comes first destroys the other."""
    publisher = pair.speaker.create_publisher(Float64, 'phi', 10)
    called: list[str] = []
    subscriptions: dict[str, Any] = {}
    timers: dict[str, Any] = {}

    def hear(name: str, other: str) -> None:
        called.append(name)
        pair.hearer.destroy_subscription(subscriptions[other])

    def tick(name: str, other: str) -> None:
        called.append(name)
        for each in (name, other):
            pair.hearer.destroy_timer(timers[each])

    for one, other in (('a', 'b'), ('b', 'a')):
        subscriptions[one] = listen(pair.hearer, PHI, lambda _, one=one, other=other: hear(one, other))
    pair.until(lambda: publisher.get_subscription_count() == 2, 'the subscriptions')
    publisher.publish(Float64(data=1.0))
    pair.until(lambda: called, 'the message')
    assert len(called) == 1
    called.clear()
    for one, other in (('a', 'b'), ('b', 'a')):
        timers[one] = pair.hearer.create_timer(
            0.001, lambda one=one, other=other: tick(one, other), clock=steady_clock()
        )
    while not all(timer.is_ready() for timer in timers.values()):
        pass
    pair.until(lambda: called, 'the tick')
    assert len(called) == 1


def test_an_exception_of_a_callback_comes_out_of_the_executor(pair):
    def fail() -> None:
        raise KeyError('ours')

    pair.hearer.create_timer(0.001, fail, clock=steady_clock())
    with pytest.raises(KeyError, match='ours'):
        pair.until(lambda: False, 'the exception')


def test_bytes_that_are_no_message_are_passed_over_and_counted(pair):
    heard: list[list[str]] = []
    inbox = listen(pair.hearer, JOINT_STATES, lambda message: heard.append(list(message.name))).callback.__self__
    publisher = pair.speaker.create_publisher(JointState, 'joint_states', 10)
    pair.until(publisher.get_subscription_count, 'the subscription')
    publisher.publish(JointState(name=['wheel'], position=[1.0]))
    for data in (b'', b'nonsense', b'\0\1\0\0' + b'\xff' * 40):
        publisher.publish(data)
    publisher.publish(JointState(name=['wheel'], position=[2.0]))
    pair.until(lambda: len(heard) == 2, 'both messages')
    assert inbox.unreadable == 3


@pytest.fixture
def shared(pair, monkeypatch) -> Pair:
    monkeypatch.setattr(nodes, '_outlets', None)
    share_process()
    return pair


def test_in_a_shared_process_streams_are_handed_over_and_others_hear_them_over_dds(shared):
    outlet = advertise(shared.speaker, PHI)
    handed: list[float] = []
    samples: list[float] = []
    listen(shared.hearer, PHI, lambda message: None, take_sample=samples.append)
    assert not outlet.is_heard  # nobody needs a message
    outlet.publish_sample(1.0, lambda sample: pytest.fail('a message was made for nobody'))
    listen(shared.hearer, PHI, lambda message: handed.append(message.data))
    outlet.publish_sample(2.0, float_bytes)
    assert (samples, handed) == ([1.0, 2.0], [2.0])
    assert outlet.get_subscription_count() == 0
    outside: list[float] = []
    shared.hearer.create_subscription(Float64, 'phi', lambda message: outside.append(message.data), 10)

    def hear_outside() -> bool:
        outlet.publish_sample(3.0, lambda sample: Float64(data=sample))
        return bool(outside)

    shared.until(hear_outside, 'the message')
    assert (set(outside), set(handed)) == ({3.0}, {2.0, 3.0})


def test_in_a_shared_process_what_is_latched_is_heard_by_whoever_comes_later(shared):
    outlet = advertise(shared.speaker, SYNCHRONIZED)
    outlet.publish(Bool(data=True))
    handed: list[bool] = []
    listen(shared.hearer, SYNCHRONIZED, lambda message: handed.append(message.data))
    assert handed == [True]


def test_what_many_publish_or_what_threads_publish_goes_over_dds_in_a_shared_process_too(shared):
    advertise(shared.speaker, DIAGNOSTICS)
    advertise(shared.speaker, PHI, from_threads=True)
    assert listen(shared.hearer, DIAGNOSTICS, lambda message: None) is not None
    assert listen(shared.hearer, PHI, lambda message: None) is not None


class Clock:
    """Time as the inbox sees it, in seconds."""

    now = 1000.0

    def time_ns(self) -> int:
        return round(self.now * 1e9)

    def monotonic(self) -> float:
        return self.now


def heard_of(
    monkeypatch: pytest.MonkeyPatch, arrivals: list[float], seconds_each: float, patience: float = OLD
) -> tuple[list[float], Inbox]:
    """Ages of the messages that a reader hears which takes so long for each."""
    clock, ages = Clock(), []
    monkeypatch.setattr(nodes, 'time', clock)

    def hear(arrival: float) -> None:
        ages.append(clock.now - arrival)
        clock.now += seconds_each

    inbox = Inbox(hear, patience)
    for arrival in arrivals:
        clock.now = max(clock.now, arrival)
        inbox(arrival, {'received_timestamp': round(arrival * 1e9)})
    return ages, inbox


def test_a_reader_three_times_too_slow_hears_no_old_messages_and_counts_what_it_missed(monkeypatch):
    arrivals = [1000.0 + 0.001 * i for i in range(20_000)]
    ages, inbox = heard_of(monkeypatch, arrivals, 0.003)
    assert inbox.dropped + len(ages) == len(arrivals)
    assert max(ages) < 3 * OLD
    assert 0.2 * len(arrivals) < len(ages) < 0.4 * len(arrivals)


def test_a_reader_that_cannot_even_drop_what_comes_still_hears_something(monkeypatch):
    clock, heard = Clock(), []
    monkeypatch.setattr(nodes, 'time', clock)
    inbox = Inbox(lambda arrival: heard.append(clock.now))
    for k in range(5000):
        inbox(None, {'received_timestamp': round((1000.0 + 0.001 * k) * 1e9)})
        clock.now += 0.002  # twice as long as from one to the next
    assert inbox.dropped + len(heard) == 5000
    assert max(later - earlier for earlier, later in pairwise(heard)) < 2 * OLD


def test_a_stall_or_a_burst_that_the_reader_catches_up_with_loses_nothing(monkeypatch):
    stall = [1000.0 + 0.001 * i for i in range(1000)]
    assert heard_of(monkeypatch, [*stall, *[1002.0] * 1000], 0.0001)[1].dropped == 0
    assert FRESH < OLD


@pytest.mark.parametrize('rate', [1250.0, 1500.0, 2000.0, 3000.0])
def test_who_has_to_miss_nothing_works_off_the_burst_of_a_source_that_was_stopped_for_three_seconds(monkeypatch, rate):
    arrivals = [
        *(1000.0 + i / 1000.0 for i in range(1000)),
        *(1004.0 + i / 4000.0 for i in range(4000)),
        *(1005.0 + i / 1000.0 for i in range(12_000)),
    ]
    ages, inbox = heard_of(monkeypatch, arrivals, 1.0 / rate, BURST_SECONDS)
    assert inbox.dropped == 0
    assert ages[-1] < OLD
    assert max(ages) * rate < BURST_DEPTH


def test_who_has_to_miss_nothing_drops_all_the_same_where_it_never_catches_up(monkeypatch):
    ages, inbox = heard_of(monkeypatch, [1000.0 + 0.001 * i for i in range(60_000)], 0.002, BURST_SECONDS)
    assert inbox.dropped > 20_000
    assert max(ages) < BURST_SECONDS


def test_a_node_tells_which_topics_it_dropped_messages_of(pair):
    subscription = listen(pair.hearer, PHI, lambda message: None)
    assert dropped(pair.hearer) == {}
    subscription.callback.__self__.dropped = 3
    assert dropped(pair.hearer) == {subscription.topic_name: 3}

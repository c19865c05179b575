"""The node over real DDS, alone and before the estimator and the monitor."""

import math
from collections.abc import Iterator
from itertools import count
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from legs import person, truth
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool

from dcdrw_control.legs.accuracy import judge_strikes
from dcdrw_control.legs.samples import LEGS, Leg
from dcdrw_msgs_py.messages import stamp_ns, to_stamp
from dcdrw_msgs_py.topics import (
    DIAGNOSTICS,
    JOINT_STATES,
    LEG_JOINT_STATES,
    LEG_PHASES,
    LEG_SENSORS,
    PHASE_STATE,
    SYNCHRONIZED,
)
from tests.bench import Bench

pytestmark = pytest.mark.processes

AHEAD = dict(zip(LEGS, (0.0, 0.5, 0.75, 0.25), strict=True))
"""How far each leg is ahead of the front left one in its stride: the robot's legs lead by a quarter stride."""
STANCE, RATE = 0.6, 100


class Player:
    """Publishes messages as their time comes; called again and again, as a condition that has yet to hold."""

    def __init__(self, bench: Bench, messages: Iterator[tuple[int, Any, Any]]) -> None:
        self._bench, self._messages = bench, messages
        self._next = next(messages, None)

    def __call__(self) -> bool:
        """Publish what is due; whether all has been."""
        while self._next and self._next[0] <= self._bench.node.get_clock().now().nanoseconds:
            self._next[1].publish(self._next[2])
            self._next = next(self._messages, None)
        return self._next is None


def four_legs(publishers: dict[Leg, Any], epoch_ns: int) -> Iterator[tuple[int, Any, Any]]:
    """What is under four feet that walk evenly, a stride a second, without end."""
    for index in count():
        when_ns = epoch_ns + index * 10**9 // RATE
        for leg in LEGS:
            message = WrenchStamped()
            message.header.stamp = to_stamp(when_ns)
            message.wrench.force.z = 700.0 * ((index / RATE + AHEAD[leg]) % 1.0 < STANCE)
            yield when_ns, publishers[leg], message


def worn_imus(publishers: dict[Leg, Any], epoch_ns: int) -> Iterator[tuple[int, Any, Any]]:
    """What the sensors on a person's feet told, for ten seconds."""
    for stamp, leg, reading in person():
        if stamp > 10 * 10**9:
            return
        message = Imu()
        message.header.stamp = to_stamp(epoch_ns + stamp)
        turning, pulling = message.angular_velocity, message.linear_acceleration
        turning.x, turning.y, turning.z = reading.rate
        pulling.x, pulling.y, pulling.z = reading.acceleration
        yield epoch_ns + stamp, publishers[leg], message


def test_a_recorded_person_walks_through_the_node(bench):
    bench.start('leg_tracker')
    phases = bench.hear(LEG_PHASES)
    publishers = {leg: bench.publisher(LEG_SENSORS[leg.half, leg.side, 'imu']) for leg in LEGS[:2]}
    epoch_ns = bench.node.get_clock().now().nanoseconds
    bench.wait(Player(bench, worn_imus(publishers, epoch_ns)), 'the end of the walk')
    bench.spin(0.5)
    for leg in LEGS[:2]:
        rows = [
            (stamp_ns(m.header.stamp) - epoch_ns, m.position[m.name.index(str(leg))])
            for m in phases
            if str(leg) in m.name
        ]
        seconds, strides = np.array(rows).T * [[1e-9], [1.0 / math.tau]]
        whole = np.arange(math.ceil(strides[0]), math.floor(strides[-1]) + 1)
        found = np.interp(whole, strides, seconds)
        true = truth(leg.side)
        true = true[(true > found[0] - 0.1) & (true < seconds[-1] - 0.1)]
        accuracy = judge_strikes(found, true)
        assert (accuracy.missed, accuracy.false) == (0, 0)
        assert accuracy.close >= 0.8  # of the seven


def test_four_legs_are_two_wheels_for_the_estimator_and_the_monitor(bench):
    for name in ('sync_monitor', 'phase_estimator', 'leg_tracker'):
        bench.start(name)
    joints, states, verdicts = bench.hear(JOINT_STATES), bench.hear(PHASE_STATE), bench.hear(SYNCHRONIZED)
    publishers = {leg: bench.publisher(LEG_SENSORS[leg.half, leg.side, 'wrench']) for leg in LEGS}
    bench.publisher(JOINT_STATES, readers=2)  # the estimator has been found, as the bench has
    play = Player(bench, four_legs(publishers, bench.node.get_clock().now().nanoseconds))
    bench.wait(lambda: play() or (verdicts and verdicts[-1].data), 'the verdict')
    last = joints[-1]
    assert sorted(last.name) == ['front_wheel', 'rear_wheel']
    assert len(states) > 0.8 * len([message for message in joints if len(message.name) == 2])
    front, rear = (last.position[last.name.index(f'{half}_wheel')] for half in ('front', 'rear'))
    assert (front - rear) / math.radians(30.0) % 1.0 == pytest.approx(0.5, abs=0.05)


def test_contacts_and_hips_are_taken_and_bad_messages_survived(bench):
    process = bench.start('leg_tracker')
    diagnostics = bench.hear(DIAGNOSTICS)
    hips = bench.publisher(LEG_JOINT_STATES)
    contacts = bench.publisher(LEG_SENSORS['rear', 'right', 'contact'])
    imus = bench.publisher(LEG_SENSORS['front', 'left', 'imu'])

    def values() -> dict[str, str]:
        return {pair.key: pair.value for pair in diagnostics[-1].status[0].values} if diagnostics else {}

    def sent() -> bool:
        now = to_stamp(bench.node.get_clock().now().nanoseconds)
        bad = JointState(name=['elbow'], position=[1.0])
        good = JointState(name=['front_right_hip', 'elbow'], position=[0.2, 1.0])
        nothing = Imu()
        nothing.angular_velocity.x = math.nan
        for message in (bad, good, nothing):
            message.header.stamp = now
        hips.publish(bad)
        hips.publish(good)
        imus.publish(nothing)
        contacts.publish(Bool(data=True))
        bench.spin(0.02)
        told = values()
        return (
            (told.get('front_right sensor'), told.get('rear_right sensor')) == ('hip', 'contact')
            and int(told['readings refused: unreadable']) > 0
            and int(told['readings refused: not finite']) > 0
        )

    bench.wait(sent, 'both sensors, and the refusals')
    assert process.poll() is None
    assert 'Traceback' not in bench.output('leg_tracker')

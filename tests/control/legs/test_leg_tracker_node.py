"""The node over real DDS, alone and before the estimator and the monitor."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool

from dcdrw_control.legs.accuracy import judge_strikes
from dcdrw_control.legs.samples import LEGS
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
from tests.control.legs.gait import person, truth

pytestmark = pytest.mark.processes

AHEAD = dict(zip(LEGS, (0.0, 0.5, 0.75, 0.25), strict=True))
"""How far each leg is ahead of the front left one in its stride: the robot's legs lead by a quarter stride."""
STANCE, RATE, SECONDS = 0.6, 100, 14


def play(bench: Bench, messages: list[tuple[int, Any, Any]], times: int = 3) -> None:
    """Publish messages in the order of time, some times as fast as they were taken."""
    start_ns, started = messages[0][0], bench.node.get_clock().now().nanoseconds
    for when_ns, publisher, message in messages:
        while (bench.node.get_clock().now().nanoseconds - started) * times < when_ns - start_ns:
            bench.executor.spin_once(timeout_sec=0.001)
        publisher.publish(message)
    bench.spin(0.2)


def four_legs(make: Callable[[bool], Any], publishers: dict, epoch_ns: int) -> list[tuple[int, Any, Any]]:
    """Messages of four legs that walk evenly, a stride a second."""
    made = []
    for index in range(RATE * SECONDS):
        when_ns = epoch_ns + index * 10**9 // RATE
        for leg in LEGS:
            message = make((index / RATE + AHEAD[leg]) % 1.0 < STANCE)
            message.header.stamp = to_stamp(when_ns)
            made.append((when_ns, publishers[leg], message))
    return made


def wrench(touches: bool) -> Any:
    message = WrenchStamped()
    message.wrench.force.z = 700.0 * touches
    return message


def test_a_recorded_person_walks_through_the_node(bench):
    bench.start('leg_tracker')
    phases = bench.hear(LEG_PHASES)
    publishers = {leg: bench.publisher(LEG_SENSORS[leg.half, leg.side, 'imu']) for leg in LEGS[:2]}
    epoch_ns = bench.node.get_clock().now().nanoseconds - 60 * 10**9
    messages = []
    for stamp, leg, reading in person():
        if stamp > 10 * 10**9:
            break
        message = Imu()
        message.header.stamp = to_stamp(epoch_ns + stamp)
        for field, values in (
            (message.angular_velocity, reading.rate),
            (message.linear_acceleration, reading.acceleration),
        ):
            field.x, field.y, field.z = values
        messages.append((epoch_ns + stamp, publishers[leg], message))
    play(bench, messages, times=1)
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
    epoch_ns = bench.node.get_clock().now().nanoseconds - 60 * 10**9
    play(bench, four_legs(wrench, publishers, epoch_ns))
    bench.wait(lambda: verdicts and verdicts[-1].data, 'the verdict')
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

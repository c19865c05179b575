"""The node over real DDS: a person's legs in, trajectories out while it is enabled."""

import math

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from dcdrw_msgs_py.messages import stamp_ns, turns_message
from dcdrw_msgs_py.samples import Turn
from dcdrw_msgs_py.topics import (
    DIAGNOSTICS,
    ENABLE,
    JOINT_TRAJECTORY,
    LEG_PHASES,
    PLANNED_FOOTFALLS,
    XRL_LEG_PHASES,
)
from tests.bench import Bench

pytestmark = pytest.mark.processes

JOINTS = ['rear_left_hip', 'rear_left_knee', 'rear_right_hip', 'rear_right_knee']


def walking(bench: Bench, phases, enable, enabled: bool = True):
    """A person of one stride a second, as long as the bench asks; to be called as a condition."""
    begin = bench.node.get_clock().now().nanoseconds

    def go_on() -> None:
        now = bench.node.get_clock().now().nanoseconds
        stride = (now - begin) / 1e9
        angles = {'front_left': math.tau * stride, 'front_right': math.tau * (stride - 0.5)}
        phases.publish(turns_message(now, {leg: Turn(angle, math.tau) for leg, angle in angles.items()}))
        if enabled:
            enable.publish(Bool(data=True))

    return go_on


def test_trajectories_come_while_it_is_enabled_and_bad_messages_are_survived(bench):
    process = bench.start('xrl_reference', approach=0.5, ramp_strides=0.5)
    trajectories, robot = bench.hear(JOINT_TRAJECTORY), bench.hear(XRL_LEG_PHASES)
    footfalls, said = bench.hear(PLANNED_FOOTFALLS), bench.hear(DIAGNOSTICS)
    phases, enable = bench.publisher(LEG_PHASES), bench.publisher(ENABLE)
    phases.publish(JointState(name=['front_left'], position=[]))
    phases.publish(JointState(name=['front_left', 'front_right'], position=[math.nan, 0.0]))
    person = walking(bench, phases, enable)

    def until(condition):
        return lambda: (person(), condition())[1]

    bench.wait(until(lambda: len(footfalls) > 3 and robot), 'planned footfalls')
    message = trajectories[-1]
    assert message.joint_names == JOINTS
    times = [point.time_from_start.sec * 10**9 + point.time_from_start.nanosec for point in message.points]
    assert times[0] > 0
    assert times == sorted(set(times))
    assert not any(message.points[-1].velocities)
    assert stamp_ns(message.header.stamp) % 20_000_000 != (stamp_ns(message.header.stamp) + times[0]) % 20_000_000 + 1
    assert [fall.point.y > 0.0 for fall in footfalls[:4]] in ([True, False] * 2, [False, True] * 2)
    assert sorted(robot[-1].name) == ['rear_left', 'rear_right']
    bench.wait(until(lambda: '1-4' not in said[-1].status[0].message and len(said) > 3), 'a diagnosis')
    still = walking(bench, phases, enable, enabled=False)
    bench.wait(lambda: (still(), len(trajectories))[1] and said[-1].status[0].message == 'not enabled', 'the end')
    assert process.poll() is None
    assert 'Traceback' not in bench.output('xrl_reference')

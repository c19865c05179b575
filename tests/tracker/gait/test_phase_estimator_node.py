"""The node `phase_estimator` over DDS. The core's truths are in tests/tracker/test_phase.py."""

import math

import pytest
from sensor_msgs.msg import JointState

from dcdrw_msgs_py.messages import PhaseSampleReader, footfall, to_stamp
from dcdrw_msgs_py.topics import DIAGNOSTICS, FOOTFALLS, JOINT_STATES, PHASE_STATE, PHI, STEP_DIFFERENCE
from tests.bench import Bench

pytestmark = pytest.mark.processes

ALPHA = math.pi / 12
SPEED = 1.0


def joints(bench: Bench, k: int, names: tuple[str, ...] = ('front_wheel', 'rear_wheel')) -> JointState:
    """Both wheels turn at SPEED, sampled at 100 Hz; the front one starts just after a strike, the rear at 0."""
    t = k / 100
    message = JointState(name=list(names))
    message.header.stamp = to_stamp(bench.start_ns + round(t * 1e9))
    where = {'front_wheel': -ALPHA + SPEED * t, 'rear_wheel': SPEED * t}
    message.position = [where.get(name, 0.0) for name in names]
    message.velocity = [SPEED] * len(names)
    return message


def held(bench: Bench, now: int, names: tuple[str, ...] = ('front_wheel', 'rear_wheel')) -> JointState:
    """The wheels at rest at their start; the motion then goes on from this stamp."""
    bench.start_ns = now
    message = joints(bench, 0, names)
    message.velocity = [0.0] * len(names)
    return message


def drive(bench: Bench, names: tuple[str, ...] = ('front_wheel', 'rear_wheel'), count: int = 200, **settings):
    bench.start_ns = bench.node.get_clock().now().nanoseconds
    phases, falls = bench.hear(PHASE_STATE), {wheel: bench.hear(topic) for wheel, topic in FOOTFALLS.items()}
    publisher = bench.publisher(JOINT_STATES)
    bench.wake(publisher, lambda now: held(bench, now, names), phases)
    for k in range(1, count + 1):
        publisher.publish(joints(bench, k, names))
        bench.spin(0.002)
    bench.wait(lambda: len(phases) >= count, f'{count} phases')
    return phases, falls


def test_phase_and_footfalls_follow_the_wheels(bench):
    bench.start('phase_estimator')
    phis, differences = bench.hear(PHI), bench.hear(STEP_DIFFERENCE)
    phases, falls = drive(bench)
    read = PhaseSampleReader()
    for message in phases:
        sample = read.read(message)
        assert math.isclose(sample.phi.angle, ALPHA, abs_tol=1e-9)  # the wheels keep half a step apart
        assert sample.step_difference in (0, -1)
    assert [message.header.stamp for message in phases[:2]] == [joints(bench, k).header.stamp for k in (1, 2)]
    bench.wait(lambda: len(phis) >= len(phases) and len(differences) >= len(phases), 'phi and step_difference')
    strikes = [footfall(message, wheel) for wheel, messages in falls.items() for message in messages]
    for wheel, first in (('rear', ALPHA), ('front', 2 * ALPHA)):
        times = [(fall.stamp_ns - bench.start_ns) / 1e9 for fall in strikes if fall.wheel == wheel]
        expected = [(first + 2 * ALPHA * i) / SPEED for i in range(len(times))]
        assert len(times) >= 3
        assert all(math.isclose(a, b, abs_tol=1e-6) for a, b in zip(times, expected, strict=True))


def test_joint_order_and_company_do_not_matter(bench):
    bench.start('phase_estimator')
    phases, _ = drive(bench, ('coupler', 'rear_wheel', 'hip', 'front_wheel'), count=50)
    assert all(math.isclose(message.position[2], ALPHA, abs_tol=1e-9) for message in phases)


def test_joints_are_mapped_by_parameters(bench):
    bench.start('phase_estimator', front_joint='hinten', rear_joint='vorn')
    bench.start_ns = bench.node.get_clock().now().nanoseconds
    phases = bench.hear(PHASE_STATE)
    publisher = bench.publisher(JOINT_STATES)

    def renamed(now: int) -> JointState:
        message = held(bench, now)
        message.name = ['hinten', 'vorn']
        return message

    bench.wake(publisher, renamed, phases)
    publisher.publish(renamed(bench.start_ns + 10_000_000))
    bench.wait(lambda: phases, 'a phase')
    assert math.isclose(phases[0].position[2], ALPHA, abs_tol=1e-9)


def test_missing_joint_is_named_and_counted(bench):
    bench.start('phase_estimator')
    diagnostics = bench.hear(DIAGNOSTICS)
    publisher = bench.publisher(JOINT_STATES)
    bench.start_ns = bench.node.get_clock().now().nanoseconds

    def counted():
        publisher.publish(joints(bench, 0, ('front_wheel', 'elbow')))
        bench.spin(0.05)
        values = {pair.key: pair.value for message in diagnostics for pair in message.status[0].values}
        return int(values.get('samples refused: unpaired', 0)) > 0

    bench.wait(counted, 'a diagnosis that counts the messages')
    assert 'joint rear_wheel is missing; the message names front_wheel, elbow' in bench.output('phase_estimator')


def test_namespace_and_remapping_work(bench):
    bench.start('phase_estimator', '-r', '__ns:=/lab', '-r', 'joint_states:=/rig/joint_states')
    publisher = bench.publisher(JOINT_STATES._replace(name='/rig/joint_states'))
    phases = bench.hear(PHASE_STATE, '/lab/phase_state')
    bench.start_ns = bench.node.get_clock().now().nanoseconds
    bench.wake(publisher, lambda now: held(bench, now), phases)


def test_wheels_in_messages_of_their_own_are_joined(bench):
    bench.start('phase_estimator')
    bench.start_ns = bench.node.get_clock().now().nanoseconds
    phases = bench.hear(PHASE_STATE)
    publisher = bench.publisher(JOINT_STATES)
    bench.wake(publisher, lambda now: held(bench, now), phases)
    for k in range(1, 101):
        for name in ('front_wheel', 'rear_wheel'):
            publisher.publish(joints(bench, k, (name,)))
            bench.spin(0.001)
    bench.wait(lambda: len(phases) >= 100, '100 phases')
    assert all(math.isclose(message.position[2], ALPHA, abs_tol=1e-9) for message in phases)


def test_a_source_in_degrees_that_falls_downhill_is_mapped(bench):
    bench.start('phase_estimator', unit='deg', front_sign=-1, rear_sign=-1)
    bench.start_ns = bench.node.get_clock().now().nanoseconds
    phases = bench.hear(PHASE_STATE)
    publisher = bench.publisher(JOINT_STATES)

    def turned(message: JointState) -> JointState:
        message.position = [-math.degrees(angle) for angle in message.position]
        message.velocity = [-math.degrees(rate) for rate in message.velocity]
        return message

    bench.wake(publisher, lambda now: turned(held(bench, now)), phases)
    for k in range(1, 51):
        publisher.publish(turned(joints(bench, k)))
        bench.spin(0.002)
    bench.wait(lambda: len(phases) >= 50, '50 phases')
    assert all(math.isclose(message.position[2], ALPHA, abs_tol=1e-9) for message in phases)

"""What holds for every node."""

import ast
import math
import os
import signal
import time
from pathlib import Path

import pytest
import rclpy.node
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import NodeNameNonExistentError
from rclpy.parameter import get_parameter_value, parameter_value_to_python
from sensor_msgs.msg import JointState

from dcdrw.suite.executables import EXECUTABLES, PHASE_ESTIMATOR, SIMULATOR, SYNC_MONITOR, SYNCHRONIZER, Executable
from dcdrw_msgs_py.messages import to_stamp
from dcdrw_msgs_py.quantity import fields
from dcdrw_msgs_py.topics import DIAGNOSTICS, JOINT_STATES, PHASE_STATE, Topic
from tests import ROOT
from tests.bench import Bench

pytestmark = pytest.mark.processes

OF_ROS = {'/rosout', '/parameter_events', '/clock'}
NAMES = [node.name for node in EXECUTABLES]


def attributes(tree: ast.AST) -> set[str]:
    """What objects of a class keep under `self`."""
    return {
        part.attr
        for part in ast.walk(tree)
        if isinstance(part, ast.Attribute)
        and isinstance(part.ctx, ast.Store)
        and isinstance(part.value, ast.Name)
        and part.value.id == 'self'
    }


def test_no_node_keeps_something_of_its_own_where_rclpy_keeps_the_nodes():
    """A recorder that kept `_parameters` had none of its own any more."""
    theirs = attributes(ast.parse(Path(rclpy.node.__file__).read_text()))
    assert {'_parameters', '_clock'} <= theirs
    for file in sorted(ROOT.glob('dcdrw*/**/*_node.py')):
        for part in ast.walk(ast.parse(file.read_text())):
            if isinstance(part, ast.ClassDef) and any(getattr(base, 'id', '') == 'Node' for base in part.bases):
                assert not attributes(part) & theirs, file


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('name', NAMES)
def test_signals_end_it_cleanly(bench, name, number):
    diagnostics = bench.hear(DIAGNOSTICS)
    process = bench.start(name)
    bench.wait(lambda: diagnostics, 'diagnostics: the node runs')
    end = time.monotonic() + 10
    while process.poll() is None:  # a launcher, a terminal and Linux may each send some, one amid another
        assert time.monotonic() < end, 'it lives on'
        os.kill(process.pid, number)
        time.sleep(1e-4)
    assert process.returncode == 0
    assert 'Traceback' not in bench.output(name)


@pytest.mark.parametrize('node', EXECUTABLES, ids=NAMES)
def test_topics_are_those_of_the_tables(bench: Bench, node: Executable):
    parameters = {'publish_clock': True} if node.name == 'simulator' else {}
    bench.start(node.name, **parameters)
    declared = tuple(
        {name(topic) for topic in topics if topic not in node.by_choice} for topics in (node.publishes, node.subscribes)
    )

    def found():
        graph = bench.node
        try:
            published = dict(graph.get_publisher_names_and_types_by_node(node.name, '/'))
            subscribed = dict(graph.get_subscriber_names_and_types_by_node(node.name, '/'))
        except NodeNameNonExistentError:  # not found yet
            return False
        return published.keys() - OF_ROS == declared[0] - OF_ROS and subscribed.keys() - OF_ROS == declared[1] - OF_ROS

    bench.wait(found, f'{node.name} with {declared}')


def name(topic: Topic) -> str:
    return topic.name if topic.name.startswith('/') else f'/{topic.name}'


numbers = st.floats(allow_nan=True, allow_infinity=True, width=64)
messages = st.builds(
    lambda names, positions, velocities, efforts, stamp: (names, positions, velocities, efforts, stamp),
    st.lists(
        st.sampled_from(
            [
                'front_wheel',
                'rear_wheel',
                'coupler',
                'front_stance',
                'rear_stance',
                'phi',
                'step_difference',
                '',
                'x' * 300,
            ]
        ),
        max_size=6,
    ),
    st.lists(numbers, max_size=6),
    st.lists(numbers, max_size=6),
    st.lists(numbers, max_size=6),
    st.integers(0, 2**31 * 10**9 - 1),
)


@pytest.mark.parametrize(
    ('node', 'topic', 'answer'),
    [(PHASE_ESTIMATOR, JOINT_STATES, PHASE_STATE), (SYNC_MONITOR, PHASE_STATE, DIAGNOSTICS)],
    ids=[PHASE_ESTIMATOR.name, SYNC_MONITOR.name],
)
def test_bad_messages_are_survived(bench, node, topic, answer):
    process = bench.start(node.name)
    publisher = bench.publisher(topic)
    diagnostics, answers = bench.hear(DIAGNOSTICS), bench.hear(answer, answer.name)

    @settings(max_examples=1500, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(messages)
    def send(content):
        names, positions, velocities, efforts, stamp = content
        message = JointState(name=names, position=positions, velocity=velocities, effort=efforts)
        message.header.stamp = to_stamp(stamp)
        publisher.publish(message)

    send()
    count = len(diagnostics)
    bench.wait(lambda: len(diagnostics) > count + 1, 'diagnostics after the flood')
    assert process.poll() is None

    now = bench.node.get_clock().now().nanoseconds
    k = 0

    def answered():
        nonlocal k
        for _ in range(10):  # a source that is in order again
            k += 1
            t = k / 100
            message = JointState(
                name=['front_wheel', 'rear_wheel', 'front_stance', 'rear_stance', 'phi', 'step_difference'],
                position=[t, t - 0.2, math.remainder(t, math.pi / 6), math.remainder(t - 0.2, math.pi / 6), 0.2, 0.0],
                velocity=[1.0] * 6,
            )
            message.header.stamp = to_stamp(now + k * 10_000_000)
            publisher.publish(message)
        bench.spin(0.1)
        if node is PHASE_ESTIMATOR:
            return answers[-1].header.stamp == message.header.stamp if answers else False
        return 'sync_monitor' in answers[-1].status[0].name and answers[-1].status[0].level != b'\x03'

    bench.wait(answered, 'an answer to good messages')
    assert 'Traceback' not in bench.output(node.name)


def as_ros2_param_sends(value: ParameterValue) -> ParameterValue:
    """`ros2 param load` reads a dump with PyYAML, makes each value a text and reads that with PyYAML again."""
    return get_parameter_value(str(parameter_value_to_python(value)))


@pytest.mark.parametrize('node', [SIMULATOR, SYNCHRONIZER], ids=lambda node: node.name)
def test_a_dump_of_its_own_is_loaded_again(bench, node):
    bench.start(node.name, S0=1e-5 if node is SIMULATOR else math.nan)
    names = [field.name for params in node.parameters for field in fields(params)]
    asked = GetParameters.Request(names=names)
    dump = bench.call(GetParameters, f'/{node.name}/get_parameters', asked).values
    parameters = [
        Parameter(name=name, value=as_ros2_param_sends(value)) for name, value in zip(names, dump, strict=True)
    ]
    request = SetParameters.Request(parameters=parameters)
    results = bench.call(SetParameters, f'/{node.name}/set_parameters', request).results
    assert [result.reason for result in results if not result.successful] == []


def test_a_misspelt_parameter_is_warned_of_with_the_right_name(bench):
    bench.start('phase_estimator', hysteresis_degree=2.0)
    bench.wait(lambda: 'did you mean hysteresis_deg?' in bench.output('phase_estimator'), 'the warning')

"""Parameter files as ROS nodes take them: rcl_yaml_param_parser is the reference."""

import pytest

from dcdrw.suite.parameter_file import TrialParams, read_parameter_file
from dcdrw_tracker.gait.phase import PhaseParams

OF_ANY = {
    'any node': '/**: {ros__parameters: {max_speed: 1}}',
    'the node in any namespace': '/**/phase_estimator: {ros__parameters: {max_speed: 1}}',
    'the node in one namespace': '/*/phase_estimator: {ros__parameters: {max_speed: 1}}',
    'a namespace in any': '/**/rig_1/phase_estimator: {ros__parameters: {max_speed: 1}}',
    'a name between': '/lab/*/phase_estimator: {ros__parameters: {max_speed: 1}}',
    'of two': '/rig_1/**: {ros__parameters: {max_speed: 1}}\n/lab/rig_1/**: {ros__parameters: {max_speed: 2}}',
    'another node': '/**/sync_monitor: {ros__parameters: {max_speed: 1}}',
}
OF_RIG_1 = {
    'any node of a namespace': '/rig_1/**: {ros__parameters: {max_speed: 1}}',
    'one of a namespace': '/rig_1/*: {ros__parameters: {max_speed: 1}}',
    'without the slash': 'rig_1/**: {ros__parameters: {max_speed: 1}}',
    'nested': 'rig_1: {phase_estimator: {ros__parameters: {max_speed: 1}}}',
    'the last counts': '/rig_1/phase_estimator: {ros__parameters: {max_speed: 2}}\n'
    '/**: {ros__parameters: {max_speed: 1}}',
    'the last counts, too': '/**: {ros__parameters: {max_speed: 2}}\n'
    '/rig_1/phase_estimator: {ros__parameters: {max_speed: 1}}',
}
OF_LAB = {
    'the node in its own': 'lab/rig_1/phase_estimator: {ros__parameters: {max_speed: 1}}',
    'nested twice': '/lab: {rig_1: {"**": {ros__parameters: {max_speed: 1}}}}',
    'any deeper one': '/lab/**: {ros__parameters: {max_speed: 1}}',
}


def of_a_node(path, namespace):
    """What the parameter is for a node in a namespace."""
    rclpy = pytest.importorskip('rclpy')
    from rclpy.context import Context
    from rclpy.node import Node

    context = Context()
    rclpy.init(args=['--ros-args', '--params-file', str(path)], context=context)
    node = Node('phase_estimator', namespace=namespace, context=context)
    node.declare_parameter('max_speed', 20, descriptor=rclpy.node.ParameterDescriptor(dynamic_typing=True))
    value = node.get_parameter('max_speed').value
    node.destroy_node()
    rclpy.shutdown(context=context)
    return value


@pytest.mark.parametrize(
    ('text', 'namespaces'),
    [
        *((text, ('/rig_1', '/lab/rig_1')) for text in OF_ANY.values()),
        *((text, ('/rig_1',)) for text in OF_RIG_1.values()),
        *((text, ('/lab/rig_1',)) for text in OF_LAB.values()),
    ],
    ids=[*OF_ANY, *OF_RIG_1, *OF_LAB],
)
def test_a_section_is_for_the_nodes_that_ros_takes_it_for(text, namespaces, tmp_path):
    path = tmp_path / 'rig.yaml'
    path.write_text(text)
    for namespace in namespaces:
        its = of_a_node(path, namespace)
        assert read_parameter_file(path, TrialParams(), namespace).phase.max_speed == its


def test_of_several_suites_that_asked_for_is_read_and_else_all_are_named(tmp_path):
    path = tmp_path / 'rig.yaml'
    path.write_text(
        '/rig_1/**: {ros__parameters: {k: 7}}\n/rig_2/simulator: {ros__parameters: {k: 9}}\n'
        '/**: {ros__parameters: {b: 80}}\n'
    )
    for namespace, k in (('rig_1', 7.0), ('/rig_2', 9.0), ('/rig_2/', 9.0)):
        rig = read_parameter_file(path, TrialParams(), namespace).rig
        assert (rig.k, rig.b) == (k, 80.0)
    for namespace in ('', 'rig_3'):
        with pytest.raises(ValueError, match=r'several suites: choose one with --namespace /rig_1 or /rig_2'):
            read_parameter_file(path, TrialParams(), namespace)


def test_the_only_namespace_of_a_file_is_taken(tmp_path):
    path = tmp_path / 'rig.yaml'
    for section in ('/rig_1/phase_estimator', 'phase_estimator', '/rig_1/**'):
        path.write_text(f'{section}: {{ros__parameters: {{max_speed: 7}}}}\n')
        for namespace in ('', 'other'):
            assert read_parameter_file(path, TrialParams(), namespace).phase == PhaseParams(max_speed=7.0)


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('phase_estimater: {ros__parameters: {}}', 'phase_estimater, which no trial has; did you mean phase_estimator'),
        ('/rig*/phase: {ros__parameters: {}}', 'which no trial has'),
        ('rig_1: {phase_estimator: {max_speed: 1}}', 'is not a parameter file'),
        ('rig_1: {}', 'is not a parameter file'),
        ('"a\\nb": {ros__parameters: {}}', r'for a\\nb, which no trial has'),
        ('rig_1: {"**": {ros__parameters: {}}}\nrig_1/**: {ros__parameters: {}}', r'has rig_1/\*\* twice'),
        ('/**: {ros__parameters: {hold_steps: 99999999999999999999}}', 'hold_steps must be ≥ 1, ≤ 10000, got 1e'),
        ('/**: {ros__parameters: {a: {b: 1}, a.b: 2}}', r'has a.b twice \(for /\*\*\)'),
    ],
)
def test_what_is_no_parameter_file_is_refused_in_one_line(text, message, tmp_path):
    path = tmp_path / 'rig.yaml'
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as error:
        read_parameter_file(path, TrialParams())
    assert str(path) in str(error.value)
    assert '\n' not in str(error.value)


def test_a_phase_below_one_percent_is_asked_about(tmp_path):
    path = tmp_path / 'trial.yaml'
    path.write_text('simulator: {ros__parameters: {initial_phase_percent: 0.216}}', encoding='utf-8')
    with pytest.raises(ValueError, match=r'0\.216 means 21\.6 %\? Then give 21\.6, else 0\.216% \(.*trial.yaml'):
        read_parameter_file(path, TrialParams())
    for text, value in (('0.216%', 0.216), ('21.6', 21.6), ('0', 0.0)):
        path.write_text(f'simulator: {{ros__parameters: {{initial_phase_percent: {text}}}}}', encoding='utf-8')
        assert read_parameter_file(path, TrialParams()).simulator.initial_phase_percent == value

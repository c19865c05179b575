"""YAML as ROS nodes take it: rcl_yaml_param_parser is the reference."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_msgs_py.text_file import LARGEST_TEXT
from dcdrw_msgs_py.yaml_file import DEEPEST, number, parse_yaml, read_yaml, yaml_text

SCALARS = [
    *('1', '-7', '+3', '0x1F', '010', '08', '9223372036854775807', '9223372036854775808'),
    *('0.5', '.5', '5.', '1e5', '1E-05', '35e-3', '1e-05', '+1.5e+3', '-.25', '.inf', '-.INF', 'inf'),
    *('true', 'yes', 'Off', 'y', 'N', 'tRue', 'Y2'),
    *('1_000', '1:30', '2026-11-25', '0o17', '1e', 'e5', '1.2.3', 'front_wheel', "'1'", '"35e-3"', '-'),
]


@pytest.fixture(scope='module')
def of_a_node(tmp_path_factory):
    """What a ROS node makes of each scalar."""
    rclpy = pytest.importorskip('rclpy')
    from rclpy.context import Context
    from rclpy.node import Node

    path = tmp_path_factory.mktemp('yaml') / 'parameters.yaml'
    lines = ''.join(f'    p{number}: {text}\n' for number, text in enumerate(SCALARS) if text != '-')
    path.write_text(f'/**:\n  ros__parameters:\n{lines}')
    context = Context()
    rclpy.init(args=['--ros-args', '--params-file', str(path)], context=context)
    node = Node('reader', context=context, automatically_declare_parameters_from_overrides=True)
    values = {text: node.get_parameter(f'p{n}').value for n, text in enumerate(SCALARS) if text != '-'}
    node.destroy_node()
    rclpy.shutdown(context=context)
    return values


@pytest.mark.parametrize('text', [text for text in SCALARS if text != '-'])
def test_a_scalar_is_what_a_node_takes_it_for(text, of_a_node):
    mine, its = parse_yaml(f'a: {text}')['a'], of_a_node[text]
    assert (type(mine), mine) == (type(its), its)


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.text(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
        max_leaves=20,
    )
)
def test_what_is_written_is_read(content):
    assert parse_yaml(yaml_text(content)) == content


def test_what_pyyaml_would_write_plainly_is_quoted_where_a_node_would_take_it_for_another_type():
    assert yaml_text({'spoke_axis': 'y', 'name': '1e5', 'k': 1e-05}) == "spoke_axis: 'y'\nname: '1e5'\nk: 1.0e-05\n"
    assert math.isnan(parse_yaml(yaml_text(math.nan)))
    shared = [1, 2]
    assert '&' not in yaml_text([shared, shared])


@pytest.mark.parametrize(
    ('data', 'message'),
    [
        (b'a: [', 'is not YAML: while parsing'),
        (b'a:\n  b:\n\tc: 1', r'is not YAML: .*\(a tab indents a line: use blanks\)'),
        (b'\xff\xfe\xff', 'is UTF-16 text: save it as UTF-8'),
        (b'a: \xb0', 'line 1: byte 0xb0 is not UTF-8 text: save it as UTF-8'),
        (b'a: !!python/object/apply:os.system [ls]', 'is not YAML: could not determine a constructor'),
        (b'K: !!opencv-matrix [1, 2]', 'is not YAML: expected a mapping node, but found sequence'),
        (b'K: !!opencv-matrix 3', 'is not YAML: expected a mapping node, but found scalar'),
        (b'a: !!bool maybe', "is not YAML: 'maybe' is not true or false"),
        (b'a: !!bool [true]', 'is not YAML: expected a scalar node'),
        (b'a: !!int [1]', 'is not YAML: expected a scalar node'),
        (b'a: &x [1]\nb: *x', r'is not YAML: line 2 has the alias \*x: write its value there'),
        (b'[' * 100_000, 'is not YAML'),
        (b'- ' * (DEEPEST + 1) + b'a', f'nested more than {DEEPEST} levels deep'),
        (b'a' * (LARGEST_TEXT + 1), 'is larger than 16 MB: is it the right file'),
    ],
)
def test_what_is_no_yaml_is_refused_in_one_line(data, message, tmp_path):
    path = tmp_path / 'rig.yaml'
    path.write_bytes(data)
    with pytest.raises(ValueError, match=message) as error:
        read_yaml(path)
    assert str(path) in str(error.value)
    assert '\n' not in str(error.value)


def test_a_time_is_text_also_where_a_tag_calls_it_one(tmp_path):
    path = tmp_path / 'camera.yaml'
    path.write_text('a: !!timestamp 2026-11-25\nb: 2026-11-25\n')
    assert read_yaml(path) == {'a': '2026-11-25', 'b': '2026-11-25'}


def test_a_file_by_opencv_is_read(tmp_path):
    path = tmp_path / 'K.yml'
    path.write_text('%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: 1\n   cols: 2\n   dt: d\n   data: [ 1., 1.5e+03 ]\n')
    assert read_yaml(path) == {'K': {'rows': 1, 'cols': 2, 'dt': 'd', 'data': [1.0, 1500.0]}}


@pytest.mark.parametrize('name', ['x', 'y', 'n', 'on', 'no', '1', '1e3', 'null'])
def test_a_name_is_text_whatever_it_looks_like(name, tmp_path):
    path = tmp_path / 'rig.yaml'
    path.write_text(f'rear: {{{name}: [-0.01]}}\n')
    assert read_yaml(path) == {'rear': {name: [-0.01]}}
    path.write_text(yaml_text(read_yaml(path)))
    assert read_yaml(path) == {'rear': {name: [-0.01]}}


def test_an_integer_beyond_every_double_is_infinite():
    assert (number('9' * 400), number('-' + '9' * 400)) == (math.inf, -math.inf)

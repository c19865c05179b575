import math
from array import array
from typing import Annotated, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_msgs_py.quantity import Quantity, build, check, fields, flatten, lookup
from dcdrw_msgs_py.rig import RigParams, WheelParams


class Inner(NamedTuple):
    """A group."""

    size: Annotated[float, Quantity('how large', 'm', above=0.0)] = 1.0
    count: Annotated[int, Quantity('how many', low=1, high=9)] = 3


class Outer(NamedTuple):
    """A set of every kind."""

    left: Inner = Inner()
    right: Inner = Inner(2.0)
    flag: Annotated[bool, Quantity('whether')] = False
    name: Annotated[str, Quantity('what')] = 'x'
    rest: Annotated[float, Quantity('free', 's', derived='from size', live=True)] = math.nan
    ratio: Annotated[float, Quantity('of both', low=-1.0, high=1.0)] = 0.5
    ids: Annotated[tuple[int, ...], Quantity('of many', low=0)] = (0,)
    sizes: Annotated[tuple[float, ...], Quantity('of many', 'm', above=0.0)] = ()


inner = st.builds(Inner, st.floats(0.0, 1e9, exclude_min=True), st.integers(1, 9))
outer = st.builds(
    Outer,
    inner,
    inner,
    st.booleans(),
    st.text(),
    st.floats(allow_nan=False, allow_infinity=False),
    st.floats(-1.0, 1.0),
    st.lists(st.integers(0, 10**9)).map(tuple),
    st.lists(st.floats(1e-9, 1e9)).map(tuple),
)


@given(outer)
def test_flatten_and_build_are_inverse(params):
    assert build(Outer, flatten(params)) == params
    assert check(params) == params


@given(st.dictionaries(st.sampled_from([field.name for field in fields(Outer)]), st.none()))
def test_what_is_absent_takes_its_default(names):
    given_ = {name: value for name, value in flatten(Outer()).items() if name in names}
    assert repr(build(Outer, given_)) == repr(Outer())  # NaN is not equal to itself


def test_fields_come_flat_in_the_order_of_declaration_with_the_defaults_of_their_group():
    assert [(field.name, field.default) for field in fields(Outer)][:5] == [
        ('left.size', 1.0),
        ('left.count', 3),
        ('right.size', 2.0),
        ('right.count', 3),
        ('flag', False),
    ]
    assert next(field for field in fields(Outer) if field.name == 'rest').quantity.live


class Switched(NamedTuple):
    mode: Annotated[str, Quantity('what to do', choices=('off', 'hold'))] = 'hold'
    camera: Annotated[str, Quantity('which camera')] = ''
    rest: Annotated[float, Quantity('free', derived='from size')] = 0.0


def test_what_yaml_takes_for_something_else_is_read_as_it_was_meant():
    assert build(Switched, {'mode': False, 'camera': 0, 'rest': '1e-05'}) == Switched('off', '0', 1e-5)
    assert math.isnan(build(Switched, {'rest': 'nan'}).rest)
    with pytest.raises(ValueError, match='mode must be a string, got True'):
        build(Switched, {'mode': True})


def test_lookup_takes_dotted_names():
    assert lookup(Outer(), 'right.size') == 2.0


def test_whole_numbers_serve_as_numbers_and_whole_floats_as_whole_numbers():
    params = build(Outer, {'left.size': 2, 'right.count': 4.0})
    assert (params.left.size, type(params.left.size)) == (2.0, float)
    assert (params.right.count, type(params.right.count)) == (4, int)


@pytest.mark.parametrize('ids', [[3, 4.0], (3, 4), array('q', [3, 4]), array('d', [3, 4])])
def test_a_list_may_come_as_any_sequence_of_numbers(ids):
    params = build(Outer, {'ids': ids, 'sizes': ids})
    assert params.ids == (3, 4)
    assert [type(value) for value in params.ids + params.sizes] == [int, int, float, float]


def test_a_whole_number_may_be_as_large_as_ros_has_them():
    assert build(Outer, {'ids': [2**63 - 1]}).ids == (2**63 - 1,)


@pytest.mark.parametrize('nothing', [[], (), None])
def test_a_list_may_be_empty(nothing):
    assert build(Outer, {'ids': nothing}).ids == ()


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'ids': 3}, 'ids must be a list, got 3'),
        ({'ids': '34'}, "ids must be a list, got '34'"),
        ({'ids': [3, -1]}, r'ids\[1\] must be ≥ 0, got -1'),
        ({'ids': [3, 0.5]}, r'ids\[1\] must be a whole number, got 0\.5'),
        ({'ids': [2**63]}, r'ids\[0\] must be a whole number of 64 bits, as ROS has them, got 9223372036854775808'),
        ({'ids': [1e20]}, r'ids\[0\] must be a whole number of 64 bits, as ROS has them, got 1e\+20'),
        ({'ids': [True]}, r'ids\[0\] must be a whole number, got True'),
        ({'sizes': [1.0, 'x']}, r"sizes\[1\] must be a number, got 'x'"),
        ({'sizes': [0.0]}, r'sizes\[0\] must be > 0 m, got 0'),
        ({'left.size': 0}, r'left\.size must be > 0 m, got 0'),
        ({'left.size': 'large'}, r"left\.size must be a number, got 'large'"),
        ({'left.size': '1,5'}, r"left\.size must be a number, got '1,5': write 1\.5"),
        ({'left.size': '1_000'}, r"left\.size must be a number, got '1_000': write 1000"),
        ({'left.size': True}, r'left\.size must be a number, got True'),
        ({'left.size': None}, r'left\.size must be a number, got None'),
        ({'left.size': math.nan}, r'left\.size must be > 0 m, got nan'),
        ({'left.size': math.inf}, r'left\.size must be > 0 m, got inf'),
        ({'right.count': 2.5}, r'right\.count must be a whole number, got 2\.5'),
        ({'right.count': 0}, r'right\.count must be ≥ 1, ≤ 9, got 0'),
        ({'right.count': 10}, r'right\.count must be ≥ 1, ≤ 9, got 10'),
        ({'right.count': math.nan}, r'right\.count must be .*, got nan'),
        ({'right.count': math.inf}, r'right\.count must be .*, got inf'),
        ({'left.size': 10**400}, r'left\.size must be > 0 m, got 1000'),
        ({'flag': 1}, 'flag must be true or false, got 1'),
        ({'name': 3.5}, 'name must be a string, got 3.5'),
        ({'name': True}, 'name must be a string, got True'),
        ({'rest': math.inf}, 'rest must be finite s, got inf'),
        ({'ratio': -1.1}, 'ratio must be ≥ -1, ≤ 1, got -1.1'),
        ({'rigth.size': 1.0}, r'rigth\.size is not a parameter \(rig\.yaml\); did you mean right\.size\?'),
        ({'size': 1.0}, r'size is not a parameter \(rig\.yaml\); did you mean left\.size and right\.size\?'),
        ({'Flag': True}, r'Flag is not a parameter \(rig\.yaml\); did you mean flag\?'),
        ({'zzz': 1.0}, r'zzz is not a parameter \(rig\.yaml\); known are left\.size, left\.count'),
    ],
)
def test_a_bad_value_is_refused_by_name(values, message):
    with pytest.raises(ValueError, match=message) as error:
        build(Outer, values, 'rig.yaml')
    assert '(rig.yaml)' in str(error.value)


def test_only_a_derived_default_may_be_nan():
    assert math.isnan(build(Outer, {'rest': math.nan}).rest)


def test_bounds_in_words():
    assert Quantity('', above=0.0, high=2.0).bounds == '> 0, ≤ 2'
    assert Quantity('').bounds == ''


def test_a_set_built_by_hand_is_checked_too():
    with pytest.raises(ValueError, match=r'rear\.mass must be > 0, ≤ 1000 kg, got -1'):
        check(RigParams(rear=WheelParams(mass=-1)))
    assert type(check(RigParams(k=5)).k) is float

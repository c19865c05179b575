import math

import pytest

from dcdrw_msgs_py.quantity import check, fields
from dcdrw_msgs_py.rig import RigParams, WheelParams


def test_the_default_is_the_paper_s_experiment():
    rig = RigParams()
    assert rig.front == rig.rear == WheelParams(0.9652, 10.0, 12.0)
    assert (rig.k, rig.b, rig.gravity) == (5.25, 100.0, 9.81)
    assert math.degrees(rig.slope) == pytest.approx(2.0)


def test_twelve_spokes_are_15_degrees():
    assert math.degrees(WheelParams().alpha) == pytest.approx(15.0)
    assert WheelParams(length=2.0, spokes=6.0).step_length == pytest.approx(2.0)  # a hexagon


def test_derived_defaults_follow_the_front_wheel():
    rig = RigParams(WheelParams(length=0.8), WheelParams(length=1.2)).resolved()
    assert rig.S0 == 0.8
    assert pytest.approx(0.8 + 0.8 * math.sin(math.pi / 12)) == rig.D0
    assert pytest.approx(2.0 + 0.9652 * math.sin(math.pi / 12)) == RigParams(S0=2.0).resolved().D0
    assert RigParams(S0=-2.0).resolved().D0 == 0.0  # a length, even where the rear wheel starts ahead


def test_what_is_given_stays_and_resolving_twice_changes_nothing():
    rig = RigParams(D0=0.7, S0=1.1)
    assert rig.resolved() == rig
    assert RigParams().resolved().resolved() == RigParams().resolved()
    assert check(RigParams().resolved()) == RigParams().resolved()


def test_only_what_does_not_move_the_feet_may_change_while_a_node_runs():
    fixed = {field.name for field in fields(RigParams) if not field.quantity.live}
    wheels = {f'{wheel}.{name}' for wheel in ('front', 'rear') for name in ('length', 'mass', 'spokes')}
    assert fixed == {*wheels, 'S0', 'gravity'}


@pytest.mark.parametrize(
    ('rig', 'message'),
    [
        (RigParams(WheelParams(spokes=3)), r'front\.spokes must be ≥ 4'),
        (RigParams(WheelParams(length=math.nan)), r'front\.length must be > 0, ≤ 10 m'),
        (RigParams(b=-0.1), r'b must be ≥ 0, ≤ 1e\+06 N·s/m'),
        (RigParams(slope=1.0), 'slope must be ≥ -0.785398, ≤ 0.785398 rad'),
        (RigParams(D0=-1.0), 'D0 must be ≥ 0, ≤ 100 m'),
    ],
)
def test_impossible_rigs_are_refused_by_name(rig, message):
    with pytest.raises(ValueError, match=message):
        check(rig)

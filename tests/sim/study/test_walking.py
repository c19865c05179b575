"""What is told of one pair."""

import math

import pytest

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.map.return_map import ReturnMap
from dcdrw_sim.model.presets import preset
from dcdrw_sim.study.walking import limit_cycle, reach, walking

PAPER, SWEEP = RigParams().resolved(), preset('paper-sweep').resolved()


def test_the_limit_cycle_is_that_of_the_return_map_with_its_swing():
    cycle, fixed = limit_cycle(PAPER), ReturnMap(PAPER).fixed_point()
    assert cycle is not None
    assert cycle.theta2 == pytest.approx(fixed.state.theta2, abs=1e-10)
    assert cycle.moduli == pytest.approx(abs(fixed.multipliers), abs=1e-8)
    assert cycle.swing_percent == pytest.approx((47.19, 52.70), abs=0.005)
    assert cycle.in_step
    assert cycle.rear_strike == pytest.approx(0.5, abs=1e-3)


def test_a_limit_cycle_that_swings_beyond_the_band_is_not_in_step():
    cycle = limit_cycle(PAPER._replace(k=41.1, b=14.7))
    assert cycle is not None
    assert cycle.stable
    assert not cycle.in_step
    assert cycle.swing_percent == pytest.approx((43.37, 56.58), abs=0.005)


@pytest.mark.parametrize(('slope_deg', 'there'), [(1.4485, False), (1.4495, True)])
def test_the_gentlest_slope_with_a_limit_cycle(slope_deg, there):
    assert (limit_cycle(PAPER._replace(slope=math.radians(slope_deg))) is not None) == there


def test_a_slow_pair_is_followed_for_long_enough():
    slow = SWEEP._replace(b=30.0, k=1e-3)
    cycle = limit_cycle(slow)
    assert cycle is not None
    assert cycle.moduli[0] > 0.995
    found = reach(slow, cycle)
    assert found is not None
    assert found.lead_there == found.starts


def test_conditions_hold_together_where_a_pair_walks_in_step():
    found = walking(PAPER)
    assert all(found.conditions.values())
    assert math.degrees(found.gentlest_slope) == pytest.approx(1.449, abs=1e-3)
    assert math.isnan(found.stall_band[0])  # on 2° no damper stalls


def test_in_the_stall_band_there_is_no_limit_cycle_to_come_to():
    found = walking(SWEEP._replace(b=0.8))
    assert (found.limit_cycle, found.basin) == (None, None)
    assert not any(found.conditions.values())
    assert found.stall_band[0] < 0.8 < found.stall_band[1]


def test_unequal_wheels_are_refused():
    with pytest.raises(ValueError, match='equal wheels'):
        walking(PAPER._replace(rear=PAPER.rear._replace(mass=8.0)))

"""The order of footfalls, and wheels as legs."""

import math

import pytest

from dcdrw_control.reference.diagnosis import diagnose_reference
from dcdrw_control.reference.joint_table import DEFAULT, read_joint_table
from dcdrw_control.reference.order import Crossings, Fall, Foot, FootfallOrder
from dcdrw_control.reference.params import ReferenceParams
from dcdrw_control.reference.person import WheelGait
from dcdrw_control.reference.reference import LegReference
from dcdrw_msgs_py.diagnosis import Level
from dcdrw_msgs_py.samples import PhaseSample, Turn


def judged(*feet: int) -> FootfallOrder:
    order = FootfallOrder()
    for k, foot in enumerate(feet):
        order.see(Fall(Foot(foot), k * 250_000_000))
    return order


def level(order: FootfallOrder) -> Level:
    status = LegReference(ReferenceParams(), read_joint_table(DEFAULT)).status()
    return diagnose_reference(status._replace(order=order.status()), 0.0, 1.0).level


@pytest.mark.parametrize(
    ('feet', 'wrong', 'said'),
    [
        ((1, 4, 2, 3, 1, 4), 0, Level.OK),
        ((1, 4, 2, 3, 1, 2, 3, 1), 1, Level.WARN),  # the right rear foot is left out
        ((1, 4, 3, 2, 3, 1, 4, 2, 3), 2, Level.OK),  # out of order, and a stride later forgotten
        ((1, 3, 2, 4), 3, Level.ERROR),  # the lateral order
    ],
)
def test_a_wrong_footfall_is_a_warning_and_two_running_are_an_error(feet, wrong, said):
    order = judged(*feet)
    assert order.status().wrong == wrong
    assert level(order) is said


def test_the_robots_lead_is_told_against_the_stride_of_the_same_side():
    order = FootfallOrder()
    assert order.see(Fall(Foot.FRONT_LEFT, 0)) is None
    order.plan(Fall(Foot.REAR_LEFT, 700_000_000))
    order.see(Fall(Foot.REAR_LEFT, 770_000_000))
    assert order.see(Fall(Foot.FRONT_LEFT, 1_000_000_000)) == pytest.approx(0.02)
    assert order.status().late == pytest.approx(0.07)


def test_a_footfall_is_where_the_phase_is_whole():
    crossings = Crossings(Foot.REAR_LEFT)
    assert crossings.update(0, 0.9) is None
    assert crossings.update(100, 1.1) == Fall(Foot.REAR_LEFT, 50)
    assert crossings.update(200, 1.0) is None
    assert crossings.update(300, 5.0) is None  # a leap


def wheels(front: float, rear: float) -> PhaseSample:
    """Both wheels after so many steps."""
    alpha = math.pi / 12.0
    turns = [Turn(2.0 * alpha * (steps % 1.0) - alpha, 1.0) for steps in (front, rear)]
    return PhaseSample(0, *turns, Turn(), 0, 0, int(front // 1), int(rear // 1))


@pytest.mark.parametrize('behind', [0.3, 0.5, 0.7, -0.5, -0.3])
def test_strikes_of_the_wheels_are_of_left_and_right_legs_in_turn(behind):
    gait = WheelGait(math.pi / 12.0, math.pi / 12.0)
    for k in range(30):
        steps = 1.0 + 0.1 * k
        sample = gait.read(wheels(steps, steps - behind))
        assert sample.person == pytest.approx((steps / 2.0, steps / 2.0 - 0.5))
        assert sample.robot is not None
        lead = math.remainder(sample.robot[0] - sample.person[0] - 0.25, 1.0)
        assert lead == pytest.approx(0.5 * math.remainder(0.5 - behind, 1.0))

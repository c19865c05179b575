import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_msgs_py.rig import RigParams, WheelShape
from dcdrw_msgs_py.rolling import (
    hub_offset,
    hub_travel,
    phase,
    phi_pitch,
    regular_stance_distance,
    rotation,
    stance,
    stance_distance,
    stance_distance_by_hubs,
    steps_ahead,
)

FRONT, REAR = WheelShape(0.95, 12.0), WheelShape(1.05, 13.0)
angles = st.floats(-50.0, 50.0)
parts = st.floats(-0.99, 0.99)


@given(angles)
def test_a_rotation_is_its_spoke_and_its_stance_angle(psi):
    spoke, theta = stance(FRONT.alpha, psi)
    assert spoke == int(spoke)
    assert -FRONT.alpha - 1e-12 <= theta <= FRONT.alpha + 1e-12
    assert rotation(FRONT.alpha, spoke, theta) == pytest.approx(psi, abs=1e-12)


def test_a_strike_opens_the_next_stance():
    assert stance(0.25, 0.25) == (1.0, -0.25)
    assert stance(0.25, -0.25) == (0.0, -0.25)
    assert stance(0.25, 0.2499999)[0] == 0.0


@given(angles, angles)
def test_phase_is_the_steps_by_which_the_front_wheel_is_ahead_whole_ones_aside(psi1, psi2):
    p = phase(FRONT, REAR, psi1, psi2)
    assert 0.0 <= p < 1.0
    assert math.remainder(p - steps_ahead(FRONT, REAR, psi1, psi2), 1.0) == pytest.approx(0.0, abs=1e-12)


def test_a_phase_a_hair_below_a_whole_step_wraps_to_zero():
    assert phase(FRONT, FRONT, 0.0, 1e-20) == 0.0


@given(parts, parts)
def test_phi_is_the_paper_s_difference_of_stance_angles(part1, part2):
    wheel = RigParams().front
    theta1, theta2 = part1 * wheel.alpha, part2 * wheel.alpha
    phi = phase(wheel, wheel, theta1, theta2) * phi_pitch(wheel, wheel)
    n = theta1 < theta2
    assert math.remainder(phi - (theta1 - theta2 + 2 * wheel.alpha * n), 2 * wheel.alpha) == pytest.approx(0, abs=1e-12)


def test_numbers_and_arrays_agree():
    psi = np.linspace(-3.0, 3.0, 101)
    spokes, thetas = stance(FRONT.alpha, psi)
    assert [*zip(spokes, thetas, strict=True)] == [stance(FRONT.alpha, float(value)) for value in psi]
    assert phase(FRONT, REAR, psi, 0.3 * psi) == pytest.approx([phase(FRONT, REAR, p, 0.3 * p) for p in psi.tolist()])


@given(angles)
def test_the_hub_travels_without_a_jump_a_step_length_per_spoke(psi):
    assert hub_travel(FRONT, psi + 2 * FRONT.alpha) - hub_travel(FRONT, psi) == pytest.approx(FRONT.step_length)
    assert hub_travel(FRONT, psi + 1e-9) == pytest.approx(hub_travel(FRONT, psi), abs=2e-9)


@given(parts, parts, st.floats(0.3, 2.5), st.sampled_from([-1.0, 1.0]))
def test_the_distance_of_the_hubs_tells_that_of_the_feet_on_the_side_expected(part1, part2, size, side):
    theta1, theta2, S = part1 * FRONT.alpha, part2 * REAR.alpha, 2.0 * side * size
    dx, dy = hub_offset(FRONT, REAR, theta1, theta2)
    D = math.hypot(S + dx, dy)
    assert stance_distance_by_hubs(FRONT, REAR, theta1, theta2, D, side * 3.0) == pytest.approx(S, abs=1e-9)


@pytest.mark.parametrize('D', [math.nan, 0.0, math.inf])
def test_a_distance_that_no_feet_give_leaves_what_is_expected(D):
    assert stance_distance_by_hubs(FRONT, REAR, 0.0, 0.0, D, 1.25) == 1.25


def test_a_regular_gait_has_the_feet_a_step_further_apart_after_a_strike_of_the_front_wheel():
    S0, sigma = 1.0, FRONT.step_length
    assert regular_stance_distance(FRONT, FRONT, S0, FRONT.alpha, 0.0) == S0
    assert regular_stance_distance(FRONT, FRONT, S0, -FRONT.alpha, 0.0) == S0 + sigma
    assert regular_stance_distance(FRONT, FRONT, math.nan, FRONT.alpha, 0.0) == FRONT.length


def test_stance_distance_counts_the_steps_of_each_wheel():
    assert stance_distance(FRONT, REAR, 1.0, 3, 2) == 1.0 + 3 * FRONT.step_length - 2 * REAR.step_length

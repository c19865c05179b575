import math

import numpy as np
import pytest
from hypothesis import given

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.model.dynamics import (
    State,
    accelerations,
    coupler,
    coupler_force,
    damper_power,
    hub_distance,
    mechanical_energy,
    reset,
    resistance_power,
    stance_distance,
    tipping,
)
from dcdrw_sim.model.wheel import gentlest_slope, kinetic_energy, limit_cycle_speed
from dcdrw_sim.motion.ends import BACKWARD, FORWARD
from tests.sim.oracle import paper_rates
from tests.sim.rigs import ALPHA, GENTLE, UNEQUAL, between, rigs, rolling, starts

PAPER = RigParams().resolved()


@given(rigs, starts, between(-2.0, 2.0), between(-100.0, 100.0))
def test_short_form_is_the_paper_s_with_beta(rig, start, S, force):
    state = rolling(rig, *start)
    if hub_distance(rig, state, S) > 0.01:
        rates = paper_rates(rig, S, np.array(state), force)
        assert accelerations(rig, state, S, force) == pytest.approx((rates[1], rates[3]), rel=1e-10, abs=1e-10)


@given(rigs, starts, between(-2.0, 2.0))
def test_coupler_spans_the_hubs(rig, start, S):
    theta1, omega1, theta2, omega2 = state = rolling(rig, *start)
    hub1 = S + rig.front.length * np.exp(1j * (math.pi / 2 - theta1))
    hub2 = rig.rear.length * np.exp(1j * (math.pi / 2 - theta2))
    velocity = rig.front.length * omega1 * np.exp(-1j * theta1) - rig.rear.length * omega2 * np.exp(-1j * theta2)
    span = hub1 - hub2
    assert hub_distance(rig, state, S) == pytest.approx(abs(span), abs=1e-14)
    if abs(span) > 0.01:
        spring = coupler(rig, state, S)
        assert spring.length == hub_distance(rig, state, S)
        assert spring.rate == pytest.approx((velocity * span.conjugate()).real / abs(span), abs=1e-11)


@given(rigs, starts)
def test_arrays_and_numbers_agree(rig, start):
    state = rolling(rig, *start)
    columns = State(*(np.full(3, value) for value in state))
    for of_numbers, of_arrays in zip(
        (*coupler(rig, state, 1.0), *accelerations(rig, state, 1.0)),
        (*coupler(rig, columns, 1.0), *accelerations(rig, columns, 1.0)),
        strict=True,
    ):
        assert of_arrays == pytest.approx([of_numbers] * 3, rel=1e-12, abs=1e-12)


@given(rigs, starts, between(-50.0, 50.0))
def test_energy_leaves_through_coupler_resistance_and_the_external_force_alone(rig, start, force):
    state, S = np.array(rolling(rig, *start)), rig.S0
    acceleration1, acceleration2 = accelerations(rig, State(*state.tolist()), S, force)
    flow = np.array([state[1], acceleration1, state[3], acceleration2])
    h = 1e-5
    ahead, behind = (mechanical_energy(rig, State(*(state + sign * h * flow)), 0, 0) for sign in (1, -1))
    rate = coupler(rig, State(*state), S).rate
    lost = damper_power(rig, rate) + resistance_power(rig, State(*state))
    scale = abs(flow).max() ** 2 * rig.front.mass + rig.k + 1.0
    assert (ahead - behind) / (2 * h) == pytest.approx(-lost - force * rate, abs=1e-7 * scale)


def test_stance_distance_counts_the_steps_of_each_wheel():
    rig = UNEQUAL.resolved()
    assert stance_distance(rig, 3, 2) == rig.S0 + 3 * rig.front.step_length - 2 * rig.rear.step_length


def test_a_step_changes_no_height():
    # ψ goes on through a strike, and the hub with it.
    before = mechanical_energy(PAPER, State(ALPHA, 0.0, 0.1, 0.0), 0, 0)
    after = mechanical_energy(PAPER, State(-ALPHA, 0.0, 0.1, 0.0), 1, 0)
    assert after == pytest.approx(before, abs=1e-12)


def test_coupler_force_is_positive_in_tension():
    assert coupler_force(PAPER, PAPER.D0 + 0.1, 0.02) == pytest.approx(0.525 + 2.0)
    front, rear = accelerations(PAPER, State(-PAPER.slope, 0.0, -PAPER.slope, 0.0), 2.0)
    assert front < 0.0 < rear


def test_kinetic_energy_is_that_of_a_point_mass():
    assert kinetic_energy(WheelParams(2.0, 3.0, 12.0), 0.5) == 1.5


@pytest.mark.parametrize('spokes', [5.0, 8.0, 12.0, 40.0])
def test_limit_cycle_gains_in_a_step_what_the_strike_takes(spokes):
    wheel = WheelParams(spokes=spokes)
    slope = 1.1 * gentlest_slope(wheel)
    after = limit_cycle_speed(wheel, slope, 9.81)
    before = limit_cycle_speed(wheel, slope, 9.81, wheel.alpha)
    assert after == pytest.approx(before * math.cos(2 * wheel.alpha), rel=1e-13)
    assert after == pytest.approx(limit_cycle_speed(wheel, slope, 9.81, -wheel.alpha), rel=1e-13)


@pytest.mark.parametrize('spokes', [4.5, 8.0, 12.0, 40.0])
def test_at_the_gentlest_slope_the_wheel_just_passes_its_apex(spokes):
    wheel = WheelParams(spokes=spokes)
    slope = gentlest_slope(wheel) * (1 + 1e-9)
    assert limit_cycle_speed(wheel, slope, 9.81, -slope) == pytest.approx(0.0, abs=1e-3)


def test_too_gentle_a_slope_has_no_limit_cycle_not_even_beyond_the_apex():
    angles = np.array([-ALPHA, 0.0, ALPHA])
    for slope in (0.99 * gentlest_slope(PAPER.front), 0.0, -0.1):
        assert math.isnan(limit_cycle_speed(PAPER.front, slope, 9.81))
        assert math.isnan(limit_cycle_speed(PAPER.front, slope, 9.81, ALPHA))
        assert np.isnan(limit_cycle_speed(PAPER.front, slope, 9.81, angles)).all()


def test_four_spokes_keep_no_speed_through_a_strike():
    square = WheelParams(spokes=4.0)
    assert gentlest_slope(square) == pytest.approx(square.alpha)
    assert math.isnan(limit_cycle_speed(square, math.radians(40), 9.81))


def test_reset_mirrors():
    assert reset(ALPHA, 0.8, 1.5, FORWARD) == (-ALPHA, pytest.approx(1.2))
    assert reset(ALPHA, 0.8, -1.5, BACKWARD) == (ALPHA, pytest.approx(-1.2))


def at_rest(rig, i):
    return State(-rig.front.alpha, 0.0, 0.0, 0.0) if i == 0 else State(0.0, 0.0, -rig.rear.alpha, 0.0)


@pytest.mark.parametrize('i', [0, 1])
def test_a_wheel_stands_on_a_slope_within_alpha_and_tips_on_a_steeper_one(i):
    for slope, sign in ((0.0, 0), (0.9 * ALPHA, 0), (-0.9 * ALPHA, 0), (1.1 * ALPHA, 1), (-1.1 * ALPHA, -1)):
        rig = RigParams(k=0.0, b=0.0, slope=slope).resolved()
        push = tipping(rig, i, at_rest(rig, i), (0, 0))
        assert (push > 0) - (push < 0) == sign


@pytest.mark.parametrize('i', [0, 1])
def test_a_standing_wheel_tips_towards_the_pull(i):
    rig = GENTLE._replace(k=0.0, b=0.0).resolved()
    towards_rear = -1 if i == 0 else 1
    for force, sign in ((500.0, towards_rear), (-500.0, -towards_rear), (5.0, 0)):
        push = tipping(rig, i, at_rest(rig, i), (0, 0), force)
        assert (push > 0) - (push < 0) == sign


def test_a_wheel_lifted_off_both_spokes_goes_where_it_is_pushed_harder():
    # The front hub stands nearly above the rear one, and is pushed away from it.
    rig = RigParams(WheelParams(2.0), WheelParams(0.9), slope=0.0, k=0.0, b=0.0, S0=2.0 * math.sin(ALPHA)).resolved()
    state = State(-ALPHA, 0.0, -0.001, 0.0)
    assert tipping(rig, 0, state, (0, 0), -1000.0) > 0.0
    assert tipping(rig, 0, state._replace(theta2=0.001), (0, 0), -1000.0) < 0.0

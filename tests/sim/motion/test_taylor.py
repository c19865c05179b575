import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from dcdrw_sim.model.dynamics import NO_TORQUES, State, accelerations, coupler, coupler_force
from dcdrw_sim.motion import taylor
from dcdrw_sim.motion.taylor import LANES, LENGTH, OMEGA1, OMEGA2, ORDER, PULL, THETA1, THETA2, S, work_parameters
from tests.sim.oracle import paper_rates
from tests.sim.rigs import UNEQUAL, between, rigs, rolling, starts

few = settings(max_examples=30, deadline=None)


def expanded(rig, state, external_force=0.0, torques=NO_TORQUES):
    """The work array of one pair."""
    rig = rig.resolved()
    w = [0.0] * taylor.END
    for row, value in work_parameters(rig, external_force, torques).items():
        w[row] = value
    w[S], (w[THETA1], w[OMEGA1], w[THETA2], w[OMEGA2]) = rig.S0, state
    taylor.expand(w, 1, True, True)
    return w


def coefficients(w, series):
    return np.array(w[series : series + (ORDER + 1) * LANES : LANES])


@few
@given(rigs, starts, between(-20.0, 20.0), st.tuples(between(-20.0, 20.0), between(-20.0, 20.0)))
def test_the_first_coefficients_are_speed_and_acceleration(rig, start, force, torques):
    rig, state = rig.resolved(), rolling(rig, *start)
    w = expanded(rig, state, force, torques)
    expected = accelerations(rig, state, rig.S0, force, torques)
    assert [w[THETA1 + LANES], w[THETA2 + LANES]] == [state.omega1, state.omega2]
    assert [w[OMEGA1 + LANES], w[OMEGA2 + LANES]] == pytest.approx(expected, rel=1e-12, abs=1e-12)


@few
@given(rigs, starts)
def test_every_coefficient_of_an_angle_follows_from_its_speed(rig, start):
    w = expanded(rig, rolling(rig, *start))
    for theta, omega in ((THETA1, OMEGA1), (THETA2, OMEGA2)):
        j = np.arange(1, ORDER + 1)
        assert coefficients(w, theta)[1:] * j == pytest.approx(coefficients(w, omega)[:-1], rel=1e-14)


@few
@given(rigs, starts)
def test_the_series_satisfy_the_equations_of_motion_along_the_step(rig, start):
    rig, state = rig.resolved(), rolling(rig, *start)
    w = expanded(rig, state)
    h = 0.5 * taylor.friction_step(w, 0, taylor.step_size(w, 0, 1e-16))
    there = State(*taylor.motion(w, h, h))
    rates = [
        np.polynomial.polynomial.polyval(h, np.polynomial.polynomial.polyder(coefficients(w, omega)))
        for omega in (OMEGA1, OMEGA2)
    ]
    assert rates == pytest.approx(accelerations(rig, there, rig.S0), rel=1e-9, abs=1e-9)


@few
@given(rigs, starts)
def test_the_coupler_s_series_are_its_length_and_its_pull(rig, start):
    rig, state = rig.resolved(), rolling(rig, *start)
    w = expanded(rig, state)
    h = 0.5 * taylor.friction_step(w, 0, taylor.step_size(w, 0, 1e-16))
    spring = coupler(rig, State(*taylor.motion(w, h, h)), rig.S0)
    force = coupler_force(rig, spring.length, spring.rate)
    assert taylor.evaluate(w, LENGTH, 0, h) == pytest.approx(spring.length, rel=1e-12)
    w[PULL + ORDER * LANES] = 0.0  # which is not filled in
    assert taylor.evaluate(w, PULL, 0, h) == pytest.approx(force / spring.length, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize('state', [State(-0.2, 1.3, 0.1, 1.5), State(0.2, -0.4, -0.1, 0.3), State(0.0, 0.0, 0.0, 0.0)])
def test_a_step_is_what_another_integrator_makes_of_the_paper_s_equations(state):
    rig = UNEQUAL.resolved()
    w = expanded(rig, state)
    h = taylor.step_size(w, 0, 1e-16)
    solution = solve_ivp(lambda t, y: paper_rates(rig, rig.S0, y), (0.0, h), state, 'DOP853', rtol=2.3e-14, atol=1e-16)
    assert taylor.motion(w, h, h) == pytest.approx(solution.y[:, -1], abs=1e-13)


def test_motion_takes_a_time_for_each_wheel():
    w = expanded(UNEQUAL, State(-0.2, 1.3, 0.1, 1.5))
    here, there = taylor.motion(w, 0.01, 0.01), taylor.motion(w, 0.02, 0.02)
    assert taylor.motion(w, 0.01, 0.02) == (*here[:2], *there[2:])
    assert here[0] == taylor.evaluate(w, THETA1, 0, 0.01)


def test_the_last_terms_at_the_end_of_a_step_are_the_tolerance():
    w = expanded(UNEQUAL, State(-0.2, 1.3, 0.1, 1.5))
    h = taylor.step_size(w, 0, 1e-14)
    last = abs(coefficients(w, THETA1)[-1]) + abs(coefficients(w, THETA2)[-1])
    assert last * h**ORDER == pytest.approx(1e-14)


@given(between(-math.pi / 4, math.pi / 4))
def test_sine_and_cosine_are_right_to_rounding(x):
    assert taylor.sin_series(x) == pytest.approx(math.sin(x), rel=4e-16, abs=1e-300)
    assert taylor.cos_series(x) == pytest.approx(math.cos(x), rel=4e-16)


def test_all_lanes_of_an_array_give_what_a_list_gives_for_one():
    states = [State(-0.2 + 0.02 * l, 1.0 + 0.05 * l, 0.2 - 0.02 * l, 1.5) for l in range(LANES)]
    w = np.zeros(taylor.END)
    for l, state in enumerate(states):
        for row, value in work_parameters(UNEQUAL.resolved()).items():
            w[row + l] = value
        w[S + l] = UNEQUAL.resolved().S0
        w[[THETA1 + l, OMEGA1 + l, THETA2 + l, OMEGA2 + l]] = state
    taylor.expand(w, LANES, True, True)
    for l, state in enumerate(states):
        alone = expanded(UNEQUAL, state)
        for series in (THETA1, OMEGA1, THETA2, OMEGA2):
            assert w[series + l : series + l + (ORDER + 1) * LANES : LANES] == pytest.approx(
                coefficients(alone, series), rel=1e-11, abs=1e-13
            )

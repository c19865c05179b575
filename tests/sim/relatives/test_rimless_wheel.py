import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.wheel import gentlest_slope, kept, limit_cycle_speed
from dcdrw_sim.motion.ends import BACKWARD, FORWARD
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.relatives.rimless_wheel import (
    Fate,
    fate,
    limit_cycle_period,
    limit_cycle_velocity,
    multiplier,
    next_speed,
    slope_gain,
    speed_to_pass,
    steepest_slope,
    uphill_bands,
)
from tests.sim.rigs import between

WHEEL, GRAVITY = WheelParams(), 9.81
SLOPE = math.radians(2.0)
UNIT = math.sqrt(GRAVITY / WHEEL.length)
quick = settings(deadline=None)
wheels = st.builds(
    WheelParams,
    between(0.5, 1.5),
    st.just(10.0),
    between(6.0, 20.0),
    gyration=st.just(0.0) | between(0.0, 0.8),
    restitution=st.just(0.0) | between(0.0, 0.3),
)


def alone(wheel, slope, theta, omega):
    """The wheel in the project's simulation, a second one beside it without a coupler."""
    return Simulation(
        RigParams(wheel, wheel, k=0.0, b=0.0, slope=slope, gravity=GRAVITY), State(theta, omega, theta, omega)
    )


def strikes_of(simulation, count):
    found = []
    while len(found) < count and not simulation.standing[0]:
        _, strike = simulation.step()
        if strike and strike.wheel == 1:
            found.append(strike)
    return found


def simulated_fate(wheel, slope, theta, omega):
    """Rolls where three forward strikes in a row keep it on its way to the limit cycle; stands where it rests."""
    simulation = alone(wheel, slope, theta, omega)
    for _ in range(2000):
        strike = strikes_of(simulation, 1)
        if not strike:
            return Fate.STANDS
        after = strike[0].state.omega1 * kept(wheel)
        if strike[0].direction == FORWARD and after > 0.999 * limit_cycle_speed(wheel, slope, GRAVITY):
            return Fate.ROLLS
    raise AssertionError('neither rolls nor stands')


@settings(max_examples=20, deadline=None)
@given(wheels, between(0.0, 0.3), between(1.0, 2.0))
def test_step_map_is_that_of_the_simulation(wheel, slope, part):
    omega = part * speed_to_pass(wheel, slope, GRAVITY, -wheel.alpha) + 0.05
    strikes = strikes_of(alone(wheel, slope, -wheel.alpha, omega), 2)
    after = strikes[0].state.omega1 * kept(wheel)
    assert strikes[0].direction == FORWARD
    assert next_speed(wheel, slope, GRAVITY, omega) == pytest.approx(after, rel=1e-10)


def test_step_map_is_that_of_an_integration_by_other_means():
    def struck(t, y):
        return y[0] - WHEEL.alpha

    struck.terminal = True
    leg = solve_ivp(
        lambda t, y: (y[1], GRAVITY / WHEEL.length * math.sin(y[0] + SLOPE)),
        (0.0, 5.0),
        (-WHEEL.alpha, 1.3),
        'DOP853',
        events=struck,
        rtol=1e-12,
        atol=1e-14,
    )
    assert next_speed(WHEEL, SLOPE, GRAVITY, 1.3) == pytest.approx(leg.y[1, -1] * math.cos(2 * WHEEL.alpha), rel=1e-11)


@quick
@given(wheels, between(0.0, 0.7))
def test_limit_cycle_is_the_fixed_point_of_the_step_map(wheel, slope):
    speed = float(limit_cycle_speed(wheel, slope, GRAVITY))
    if slope > gentlest_slope(wheel) * (1 + 1e-9):
        assert next_speed(wheel, slope, GRAVITY, speed) == pytest.approx(speed, rel=1e-12)
    elif slope < gentlest_slope(wheel):
        assert math.isnan(speed)
        assert math.isnan(limit_cycle_period(wheel, slope, GRAVITY))


def test_a_deviation_shrinks_by_the_multiplier():
    speed, h = float(limit_cycle_speed(WHEEL, SLOPE, GRAVITY)), 1e-6
    slope = (next_speed(WHEEL, SLOPE, GRAVITY, speed + h) - next_speed(WHEEL, SLOPE, GRAVITY, speed - h)) / (2 * h)
    assert multiplier(WHEEL) == pytest.approx(0.75)
    assert slope == pytest.approx(multiplier(WHEEL), rel=1e-8)


def test_below_the_speed_to_pass_there_is_no_next_step():
    least = speed_to_pass(WHEEL, SLOPE, GRAVITY, -WHEEL.alpha)
    assert math.isnan(next_speed(WHEEL, SLOPE, GRAVITY, least * (1 - 1e-9)))
    assert next_speed(WHEEL, SLOPE, GRAVITY, least * (1 + 1e-9)) > 0.0
    assert strikes_of(alone(WHEEL, SLOPE, -WHEEL.alpha, least * (1 - 1e-6)), 1)[0].direction == BACKWARD
    assert strikes_of(alone(WHEEL, SLOPE, -WHEEL.alpha, least * (1 + 1e-6)), 1)[0].direction == FORWARD


@quick
@given(wheels, between(0.0, 0.7))
def test_period_is_the_integral_of_the_inverse_speed(wheel, slope):
    assume(slope > gentlest_slope(wheel) * 1.01)
    expected = quad(
        lambda theta: 1.0 / float(limit_cycle_speed(wheel, slope, GRAVITY, theta)),
        -wheel.alpha,
        wheel.alpha,
        points=[max(-slope, -wheel.alpha)],
        epsabs=0.0,
        epsrel=1e-11,
    )[0]
    assert limit_cycle_period(wheel, slope, GRAVITY) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize('slope_deg', [1.1, 2.0, 10.0, 20.0])
def test_period_and_speed_are_those_of_the_simulation(slope_deg):
    slope = math.radians(slope_deg)
    start = float(limit_cycle_speed(WHEEL, slope, GRAVITY))
    strikes = strikes_of(alone(WHEEL, slope, -WHEEL.alpha, start), 3)
    assert strikes[2].t - strikes[1].t == pytest.approx(limit_cycle_period(WHEEL, slope, GRAVITY), rel=1e-9)
    assert limit_cycle_velocity(WHEEL, slope, GRAVITY) == pytest.approx(2 * WHEEL.step_length / strikes[1].t, rel=1e-9)


def test_period_grows_without_bound_towards_the_gentlest_slope():
    least = gentlest_slope(WHEEL)
    periods = [limit_cycle_period(WHEEL, least * (1 + 10.0**-digits), GRAVITY) for digits in (2, 4, 6, 8)]
    growth = np.diff(periods)
    assert growth == pytest.approx(math.log(100) / UNIT, rel=0.02)  # logarithmically, at the rate of the apex


@settings(max_examples=25, deadline=None)
@given(between(-0.999, 0.999), between(-1.2, 0.8), between(0.005, 0.3))
def test_fate_is_that_of_the_simulation(part, scaled, slope):
    theta, omega = part * WHEEL.alpha, scaled * UNIT
    expected = fate(WHEEL, slope, GRAVITY, theta, omega)
    near = {fate(WHEEL, slope, GRAVITY, theta, omega + 1e-4 * sign) for sign in (-1, 1)}
    assume(near == {expected})  # not on a boundary
    assume(abs(slope / gentlest_slope(WHEEL) - 1) > 0.02)
    assert simulated_fate(WHEEL, slope, theta, omega) is expected


def test_wheel_at_rest_stands_unless_the_slope_is_steeper_than_its_spokes():
    for theta in (-WHEEL.alpha, WHEEL.alpha):
        assert fate(WHEEL, WHEEL.alpha * 0.999, GRAVITY, theta, 0.0) is Fate.STANDS
        assert fate(WHEEL, WHEEL.alpha * 1.001, GRAVITY, theta, 0.0) is Fate.ROLLS
    assert alone(WHEEL, WHEEL.alpha * 0.999, -WHEEL.alpha, 0.0).standing[0]
    assert not alone(WHEEL, WHEEL.alpha * 1.001, -WHEEL.alpha, 0.0).standing[0]


def test_on_too_gentle_a_slope_everything_comes_to_stand():
    slope = gentlest_slope(WHEEL) * 0.99
    assert fate(WHEEL, slope, GRAVITY, 0.0, 100.0) is Fate.STANDS
    assert uphill_bands(WHEEL, slope, GRAVITY, 3) == []
    assert fate(WHEEL, slope / 0.98, GRAVITY, 0.0, 100.0) is Fate.ROLLS


def test_uphill_bands_are_where_it_comes_back_to_roll():
    bands = uphill_bands(WHEEL, SLOPE, GRAVITY, 4)
    for steps, (low, high) in enumerate(bands):
        for omega, expected in (
            (low - 1e-6, Fate.STANDS),
            (low + 1e-6, Fate.ROLLS),
            (high - 1e-6, Fate.ROLLS),
            (high + 1e-6, Fate.STANDS),
        ):
            assert fate(WHEEL, SLOPE, GRAVITY, WHEEL.alpha, -omega) is expected
        strikes = strikes_of(alone(WHEEL, SLOPE, WHEEL.alpha, -(low + high) / 2), steps + 3)
        assert [strike.direction for strike in strikes] == [BACKWARD] * steps + [FORWARD] * 3


def test_bands_of_a_slope_steeper_than_the_spokes_leave_no_gap():
    bands = uphill_bands(WHEEL, WHEEL.alpha * 1.1, GRAVITY, 3)
    assert bands[0][0] == 0.0
    assert [low for low, _ in bands[1:]] == pytest.approx([high for _, high in bands[:-1]])


def test_each_band_ends_where_the_wheel_would_pass_its_apex_uphill():
    assert uphill_bands(WHEEL, SLOPE, GRAVITY, 1)[0][1] ** 2 == pytest.approx(
        speed_to_pass(WHEEL, SLOPE, GRAVITY, -WHEEL.alpha) ** 2 + slope_gain(WHEEL, SLOPE, GRAVITY)
    )


@pytest.mark.parametrize('spokes', [6.0, 8.0, 12.0, 20.0])
def test_at_the_steepest_slope_the_foot_presses_no_more_at_the_end_of_a_stance(spokes):
    wheel = WheelParams(spokes=spokes)

    def push(slope, theta):  # along the spoke, per mass
        return (
            GRAVITY * math.cos(theta + slope)
            - wheel.length * float(limit_cycle_speed(wheel, slope, GRAVITY, theta)) ** 2
        )

    slope = steepest_slope(wheel)
    assert push(slope, wheel.alpha) == pytest.approx(0.0, abs=1e-9 * GRAVITY)
    assert push(slope * 0.99, wheel.alpha) > 0.0
    assert all(push(slope, theta) > 0.0 for theta in np.linspace(-wheel.alpha, wheel.alpha * 0.999, 50))


def test_a_slope_uphill_is_told_to_be_mirrored():
    with pytest.raises(ValueError, match='change the signs'):
        fate(WHEEL, -0.1, GRAVITY, 0.0, 1.0)

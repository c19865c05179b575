"""The closed form of evenly spaced strikes, against its own equations and against the exact model."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dcdrw_msgs_py.rig import WheelParams
from dcdrw_sim.map.return_map import ReturnMap
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.wheel import gentlest_slope
from dcdrw_sim.relatives.even_gait import even_gait, even_gait_on, even_stall_band, gentlest_even_gait, worst_damping

ALPHA = math.radians(15.0)
KEPT = math.cos(2.0 * ALPHA)
SLOPE = math.radians(1.75)
COUPLERS = [(0.0, 0.1), (5e-3, 0.15), (1e-2, 0.4), (1e-3, 3.0), (0.05, 10.0), (0.7, 0.2)]


def half_step(k, b, slope, before, period):
    """Independent integration from just before a strike of the front wheel, for half a period."""
    omega1, theta2, omega2 = before

    def rates(t, y):
        theta1, rate1, theta2, rate2 = y
        force = k * (ALPHA + theta1 - theta2) + b * (rate1 - rate2)
        return [rate1, theta1 + slope - force, rate2, theta2 + slope + force]

    return solve_ivp(
        rates,
        (0.0, 0.5 * period),
        [-ALPHA, KEPT * omega1, theta2, omega2],
        'DOP853',
        rtol=1e-12,
        atol=1e-14,
        dense_output=True,
    )


@pytest.mark.parametrize(('k', 'b'), COUPLERS)
def test_half_a_step_swaps_the_wheels(k, b):
    gait = even_gait(ALPHA, k, b, 2.2)
    motion = half_step(k, b, gait.slope, (gait.omega1, gait.theta2, gait.omega2), gait.period)
    assert motion.y[:, -1] == pytest.approx([gait.theta2, gait.omega2, ALPHA, gait.omega1], abs=1e-10)


def test_where_the_spring_balances_the_weight_nothing_is_singular():
    gaits = [even_gait(ALPHA, k, 0.2, 2.2) for k in (0.5 - 1e-5, 0.5, 0.5 + 1e-5)]
    assert [gait.slope for gait in gaits] == pytest.approx([gaits[1].slope] * 3, abs=1e-5)
    assert abs(gaits[0].multipliers) == pytest.approx(abs(gaits[2].multipliers), abs=1e-3)


@pytest.mark.parametrize(('k', 'b'), [(5e-3, 0.15), (1e-3, 3.0)])
def test_multipliers_are_those_of_its_own_map(k, b):
    gait = even_gait_on(ALPHA, k, b, SLOPE)
    state = np.array([gait.omega1, gait.theta2, gait.omega2])

    def half(before):
        motion = half_step(k, b, gait.slope, before, 1.2 * gait.period)
        low, high = 0.4 * gait.period, 0.6 * gait.period
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if motion.sol(middle)[2] < ALPHA else (low, middle)
        return motion.sol(low)[[3, 0, 1]]

    columns = [(half(state + kick) - half(state - kick)) / 2e-6 for kick in 1e-6 * np.eye(3)]
    derivative = np.linalg.matrix_power(np.column_stack(columns), 2)
    assert sorted(abs(np.linalg.eigvals(derivative))) == pytest.approx(sorted(abs(gait.multipliers)), abs=1e-5)


@pytest.mark.parametrize('b', [0.05, 0.15, 1.0, 5.0])
def test_on_the_gentlest_slope_a_multiplier_is_one(b):
    gait = gentlest_even_gait(ALPHA, 5e-3, b)
    assert abs(gait.multipliers[0] - 1.0) < 1e-5
    for factor in (0.99, 1.01):
        assert even_gait(ALPHA, 5e-3, b, factor * gait.period).slope > gait.slope
    assert even_gait_on(ALPHA, 5e-3, b, 0.999 * gait.slope) is None


@pytest.mark.parametrize(('k', 'b'), [(0.0, 0.1), (5e-3, 0.15), (1e-2, 0.2), (1e-3, 3.0), (5e-3, 10.0), (5e-3, 30.0)])
def test_it_comes_near_the_exact_limit_cycle(k, b):
    gait = even_gait_on(ALPHA, k, b, SLOPE)
    exact = ReturnMap(preset('paper-sweep')._replace(k=k, b=b)).fixed_point()
    assert gait.period == pytest.approx(exact.period, rel=0.025)
    assert math.degrees(gait.theta2) == pytest.approx(math.degrees(exact.state.theta2), abs=0.09)
    assert abs(gait.multipliers) == pytest.approx(abs(exact.multipliers), abs=0.009)


def test_without_a_coupler_it_is_the_rimless_wheel():
    gentlest = gentlest_even_gait(ALPHA, 0.0, 1e-6)
    assert gentlest.slope == pytest.approx(gentlest_slope(WheelParams()), rel=0.02)
    gait = even_gait_on(ALPHA, 0.0, 0.0, SLOPE)
    # All that the slope gives, 2 γ · 2 α, is what the strike takes, ω² sin² 2α: in small angles 4 γ α.
    assert gait.omega1**2 * math.sin(2.0 * ALPHA) ** 2 == pytest.approx(4.0 * SLOPE * ALPHA, rel=1e-9)
    assert abs(gait.multipliers) == pytest.approx([1.0, KEPT**2, KEPT**2], abs=1e-9)


def test_band_ends_where_the_gentlest_slope_is_the_slope():
    low, high = even_stall_band(ALPHA, 5e-3, SLOPE)
    for b in (low, high):
        assert gentlest_even_gait(ALPHA, 5e-3, b).slope == pytest.approx(SLOPE, abs=1e-9)
    assert low < worst_damping(ALPHA, 5e-3) < high
    assert even_gait_on(ALPHA, 5e-3, 0.99 * low, SLOPE)
    assert even_gait_on(ALPHA, 5e-3, 1.01 * low, SLOPE) is None
    assert even_stall_band(ALPHA, 5e-3, math.radians(2.0)) is None

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_tracker.gait.rotation import Rotation, Strike, Tolerance

ALPHA = math.pi / 12
DT_NS = 5_000_000
TOLERANCE = Tolerance(math.radians(1.5), 20.0)


def follow(angles: list[float], rate: float = math.nan) -> tuple[Rotation, list[Strike]]:
    """A wheel through these angles at 200 Hz, and its strikes."""
    wheel = Rotation(ALPHA, 0, angles[0], rate, TOLERANCE)
    strikes = []
    for index, angle in enumerate(angles[1:], start=1):
        psi = wheel.continued(angle, DT_NS * 1e-9, TOLERANCE)
        assert psi is not None
        strikes += wheel.advance(index * DT_NS, angle, psi, rate, TOLERANCE)
    return wheel, strikes


def test_a_strike_is_timed_between_the_samples_around_it() -> None:
    _, strikes = follow([ALPHA - 0.05, ALPHA - 0.003, ALPHA + 0.001])
    assert [strike.stamp_ns / DT_NS for strike in strikes] == [pytest.approx(1.75)]


def test_noise_at_a_strike_counts_once() -> None:
    wheel, strikes = follow([ALPHA + past for past in (-0.05, -0.02, 0.001, -0.01, 0.01, -0.02, 0.03)])
    assert [strike.steps for strike in strikes] == [1]
    assert wheel.theta == pytest.approx(-ALPHA + 0.03)


def test_a_wheel_that_rocks_back_strikes_backward_without_lag() -> None:
    _, strikes = follow([0.0, -0.1, -0.2, -ALPHA - 0.001, -0.3])
    assert [strike.stamp_ns / DT_NS for strike in strikes] == [pytest.approx(3.0, abs=0.1)]
    assert strikes[0].steps == -1


def test_noise_at_a_backward_strike_counts_once() -> None:
    _, strikes = follow([-0.2, -ALPHA - 0.001, -ALPHA + 0.01, -ALPHA - 0.01, -ALPHA + 0.02, -0.35])
    assert [strike.steps for strike in strikes] == [-1]


def test_a_wheel_that_stands_on_two_spokes_does_not_step() -> None:
    _, strikes = follow([-ALPHA + 0.004 * (-1) ** sample for sample in range(100)])
    assert strikes == []


@given(st.floats(-0.7, 0.7))
def test_noise_at_the_standard_start_makes_no_footfall(noise_deg: float) -> None:
    noise = math.radians(noise_deg)
    wheel, strikes = follow([-ALPHA + noise, *(-ALPHA + 0.005 * sample for sample in range(1, 20))], rate=1.0)
    assert strikes == []
    assert wheel.steps == 0


@given(st.lists(st.floats(-0.1, 0.1), max_size=300))
def test_theta_and_steps_always_add_up_to_the_rotation(moves: list[float]) -> None:
    angles = [0.0]
    for move in moves:
        angles.append(angles[-1] + move)
    wheel, strikes = follow(angles)
    assert -ALPHA <= wheel.theta < ALPHA
    assert abs(wheel.theta + 2 * ALPHA * wheel.steps - angles[-1]) <= TOLERANCE.hysteresis + 1e-9
    assert wheel.steps == (strikes[-1].steps if strikes else 0)


def test_a_missing_speed_is_the_slope_and_no_strike_smears_it() -> None:
    slow, fast = 0.8, 1.2
    angles = [ALPHA - 0.1 + fast * 0.005 * sample for sample in range(20)]
    angles += [angles[-1] + slow * 0.005 * sample for sample in range(1, 15)]
    assert follow(angles[:15])[0].rate == pytest.approx(fast)
    assert follow([angle + ALPHA - angles[19] for angle in angles])[0].rate == pytest.approx(slow)
    assert math.isnan(follow([0.0])[0].rate)

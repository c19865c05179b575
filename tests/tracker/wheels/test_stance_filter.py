"""The filter of a wheel's speed makes the jumps of strikes."""

import math

import pytest

from dcdrw_msgs_py.rig import RigParams, WheelShape
from dcdrw_tracker.wheels.stance_filter import StanceFilter

RIG, SHAPE = RigParams(), WheelShape()


def near_a_strike(rate):
    return StanceFilter(SHAPE, RIG.slope, RIG.gravity, SHAPE.alpha - 1e-6, rate, 1e-3)


def test_a_strike_leaves_cos_2_alpha_of_the_speed():
    state = near_a_strike(1.2)
    state.predict(1e-5)
    assert state.rate == pytest.approx(1.2 * math.cos(2.0 * SHAPE.alpha), rel=1e-3)


def test_without_a_strike_it_moves_as_a_pendulum_about_the_foot():
    state, dt = StanceFilter(SHAPE, RIG.slope, RIG.gravity, 0.0, 1.0, 1e-3), 0.01
    state.predict(dt)
    acceleration = RIG.gravity / SHAPE.length * math.sin(RIG.slope)
    assert state.psi == pytest.approx(dt + 0.5 * acceleration * dt**2, rel=1e-4)


def test_an_exact_measurement_is_believed():
    state = StanceFilter(SHAPE, RIG.slope, RIG.gravity, 0.0, 1.0, 1e-2)
    state.correct(0.005, 1e-7)
    assert state.psi == pytest.approx(0.005, rel=1e-6)

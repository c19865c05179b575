"""Wheels that are held and wheels that stand, told apart by where they rest."""

import math

import pytest

from dcdrw_msgs_py.samples import PhaseSample, Turn
from dcdrw_tracker.gait.rest import Rest, moves

ALPHA = math.pi / 12
START = 1_000_000_000
STANDING = -ALPHA
"""The stance angle of a wheel on two spokes."""


def phase(seconds: float, front: float, rear: float, rate: float = 0.0) -> PhaseSample:
    return PhaseSample(START + round(seconds * 1e9), Turn(front, rate), Turn(rear, rate), Turn(0.1, 0.0), 0)


def rest_of(*phases: PhaseSample) -> Rest:
    rest = Rest(phases[0], ALPHA, ALPHA)
    for one in phases[1:]:
        rest.update(one)
    return rest


def rolls_and_then_rests(front: float, rear: float, seconds: float = 1.5) -> Rest:
    rolling = [phase(0.01 * i, -0.2 + 0.01 * i, -0.1 + 0.01 * i, 1.0) for i in range(10)]
    return rest_of(*rolling, *(phase(0.1 + 0.01 * i, front, rear) for i in range(round(100 * seconds) + 1)))


def test_wheels_are_held_until_they_move() -> None:
    assert rest_of(phase(0.0, STANDING, 0.1)).held
    assert rest_of(*(phase(0.1 * i, STANDING, STANDING) for i in range(100))).held
    assert not rest_of(phase(0.0, STANDING, 0.1), phase(0.1, STANDING + 0.05, 0.15)).held
    assert not rest_of(phase(0.0, STANDING, 0.1, rate=1.0)).held


@pytest.mark.parametrize('front', [STANDING, math.nextafter(ALPHA, 0.0), 0.0])
def test_a_wheel_at_rest_between_its_spokes_is_held(front: float) -> None:
    assert rolls_and_then_rests(front, 0.1).held
    assert rolls_and_then_rests(0.1, front).held


def test_wheels_on_two_spokes_stand_by_themselves() -> None:
    assert not rolls_and_then_rests(STANDING, STANDING).held
    assert not rolls_and_then_rests(STANDING, math.nextafter(ALPHA, 0.0)).held


def test_a_wheel_that_turns_round_near_its_apex_is_not_held_while_the_other_stands() -> None:
    """θ̈ = (g/ℓ) θ: a wheel that just fails to pass its apex."""
    growth = math.sqrt(9.81 / 0.9652)
    for short_of_it in (0.1, 0.05, 0.02):
        rest = Rest(phase(-2.0, -0.2, STANDING, 1.0), ALPHA, ALPHA)
        for i in range(-100, 101):
            theta = -short_of_it * math.cosh(growth * i / 100)
            rest.update(phase(i / 100, max(theta, -ALPHA), STANDING))
            assert not rest.held


def test_they_are_let_go_once() -> None:
    rest = rolls_and_then_rests(0.0, 0.1)
    assert [rest.update(phase(2.0 + 0.1 * i, 0.1 * i, 0.1 + 0.1 * i)) for i in range(3)] == [False, True, False]


@pytest.mark.parametrize(('rate', 'moving'), [(0.0, False), (-0.05, False), (0.2, True), (math.nan, False)])
def test_wheels_that_tremble_before_a_camera_or_whose_speed_is_unknown_are_not_known_to_move(
    rate: float, moving: bool
) -> None:
    assert moves(phase(0.0, 0.1, 0.1, rate)) is moving

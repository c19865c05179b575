import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_control.legs.half import FASTEST, Half
from dcdrw_control.legs.phase import LegSample

ALPHA = math.radians(15.0)


class Walker:
    """A half that is asked once a second."""

    def __init__(self) -> None:
        self._half, self._seconds = Half(ALPHA), 0

    def update(self, legs):
        self._seconds += 1
        return self._half.update(self._seconds * 10**9, legs)


def leg(strides: float, rate: float = 1.0) -> LegSample:
    return LegSample(strides, rate, math.floor(strides) + 1)


def test_an_even_walk_turns_the_wheel_evenly():
    half = Walker()
    half.update((leg(0.0), None))
    half.update((leg(0.5), leg(0.0)))
    for steps in (1.0, 1.3, 2.0, 2.5, 3.0, 3.75, 4.0):
        turn = half.update((leg(steps / 2.0), leg(steps / 2.0 - 0.5)))
        assert turn.angle == pytest.approx(ALPHA + 2.0 * ALPHA * steps)
        assert turn.rate == pytest.approx(2.0 * ALPHA * 2.0)


def test_each_strike_of_either_leg_is_a_spokes():
    half = Walker()
    half.update((leg(0.0), None))
    half.update((leg(0.4), leg(0.0)))
    turns = [half.update(legs).angle for legs in ((leg(1.0), leg(0.7)), (leg(1.2), leg(1.0)), (leg(2.0), leg(1.6)))]
    assert turns == pytest.approx([ALPHA * (2 * j + 1) for j in (2, 3, 4)])


def test_a_leg_that_hops_takes_a_step_each_time():
    half = Walker()
    half.update((leg(0.4), leg(0.0)))
    standing = leg(0.6, 0.0)
    turns = [half.update((leg(strides), standing)).angle for strides in (1.0, 2.0, 3.0)]
    assert turns == pytest.approx([turns[0] + 2.0 * ALPHA * step for step in range(3)])


def test_a_leg_unknown_leaves_the_wheel_unknown_until_the_next_strike():
    half = Walker()
    half.update((leg(0.5), leg(0.0)))
    assert half.update((leg(0.7), leg(0.2)))
    assert half.update((None, leg(0.3))) is None
    assert half.update((leg(0.9), leg(0.4))) is None
    assert half.update((leg(1.0), leg(0.5))).angle == pytest.approx(ALPHA + 2.0 * ALPHA * 2)


@given(st.lists(st.tuples(st.booleans(), st.floats(0.01, 0.9)), min_size=1, max_size=50))
def test_whatever_the_legs_do_the_wheel_never_turns_back(moves):
    half, legs, before = Walker(), [0.5, 0.0], -math.inf
    for side, moved in moves:
        legs[side] += moved
        turn = half.update((leg(legs[0]), leg(legs[1])))
        if turn:
            assert turn.angle >= before - 1e-9
            assert turn.rate >= 0.0
            before = turn.angle


def test_an_early_strike_is_caught_up_with_no_faster_than_a_wheel_turns():
    half, dt_ns = Half(ALPHA), 5_000_000
    half.update(0, (leg(0.5), leg(0.0)))
    before = half.update(dt_ns, (leg(0.7), leg(0.2))).angle
    for tick in range(2, 20):
        angle = half.update(tick * dt_ns, (leg(1.0), leg(0.5))).angle
        assert angle - before <= FASTEST * dt_ns / 1e9 + 1e-12
        before = angle
    assert before == pytest.approx(ALPHA + 2.0 * ALPHA * 2)

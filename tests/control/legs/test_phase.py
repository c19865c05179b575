import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_control.legs.events import LIFT, STRIKE, Event
from dcdrw_control.legs.phase import MISSED, LegPhase

SWING = 0.4


def ns(seconds: float) -> int:
    return round(seconds * 1e9)


def walked(strikes: int, period: float = 1.0, swing: float = SWING) -> LegPhase:
    """A leg that has walked evenly; its last strike is at (strikes − 1) periods."""
    leg = LegPhase()
    for strike in range(strikes):
        leg.take(Event(LIFT, ns(strike * period - swing)))
        assert leg.take(Event(STRIKE, ns(strike * period)))
    return leg


def test_phase_of_an_even_walk_is_the_share_of_the_stride():
    leg = walked(6)
    for share in (0.0, 0.2, 0.5):
        assert leg.at(ns(5.0 + share)).strides == pytest.approx(5.0 + share, abs=0.003)
    leg.take(Event(LIFT, ns(5.6)))
    for share in (0.6, 0.8, 0.9):
        sample = leg.at(ns(5.0 + share))
        assert sample.strides == pytest.approx(5.0 + share, abs=0.003)
        assert sample.rate == pytest.approx(1.0, abs=0.05)


def test_phase_is_whole_at_a_strike_early_or_late():
    for late in (-0.1, 0.0, 0.1):
        leg = walked(4)
        leg.take(Event(LIFT, ns(3.6)))
        assert leg.at(ns(4.0 + late) - 1).strides < 4.0
        leg.take(Event(STRIKE, ns(4.0 + late)))
        assert leg.at(ns(4.0 + late)).strides == 4.0


def test_nothing_is_known_before_the_first_swing_has_ended_in_a_strike():
    leg = LegPhase()
    assert leg.at(ns(1.0)) is None
    leg.take(Event(STRIKE, ns(1.0)))
    assert leg.at(ns(1.1)) is None
    leg.take(Event(LIFT, ns(1.6)))
    leg.take(Event(STRIKE, ns(2.0)))
    assert leg.at(ns(2.3)).strides == pytest.approx(1.3, abs=0.01)


def test_who_stands_still_rests_at_one_phase_and_walks_on_from_it():
    leg = walked(5)
    resting = leg.at(ns(5.5))
    assert resting.rate == pytest.approx(0.0, abs=1e-6)
    assert leg.at(ns(60.0)).strides == resting.strides < 5.0
    leg.take(Event(LIFT, ns(60.0)))
    moving = leg.at(ns(60.2))
    assert resting.strides < moving.strides < 5.0
    leg.take(Event(STRIKE, ns(60.0 + SWING)))
    assert leg.at(ns(60.0 + SWING)).strides == 5.0
    assert leg.at(ns(60.7)).strides == pytest.approx(5.3, abs=0.01)  # no slower for the pause


@pytest.mark.parametrize('factor', [0.8, 1.25])
def test_a_new_cadence_is_followed_within_three_strides(factor):
    leg = walked(6)
    start = 5.0
    for stride in range(3):
        leg.take(Event(LIFT, ns(start + (stride + 0.6) * factor)))
        leg.take(Event(STRIKE, ns(start + (stride + 1.0) * factor)))
    assert leg.period == pytest.approx(factor, rel=0.07)
    assert leg.at(ns(start + 3.3 * factor)).strides == pytest.approx(8.3, abs=0.03)


def test_a_missed_strike_is_gone_over_once():
    leg = walked(6)
    leg.take(Event(LIFT, ns(5.6)))
    assert leg.at(ns(6.0 + MISSED - 0.01)).strides < 6.0
    assert leg.at(ns(6.3)).strides == pytest.approx(6.3, abs=0.01)
    assert leg.missed == 1
    leg.take(Event(STRIKE, ns(7.0)))
    assert leg.at(ns(7.0)).strides == 7.0
    leg.take(Event(LIFT, ns(7.6)))
    leg.at(ns(8.4))
    assert leg.at(ns(100.0)).strides < 9.0
    assert leg.missed == 2


def test_a_strike_that_comes_late_after_all_is_not_counted_twice():
    leg = walked(6)
    leg.take(Event(LIFT, ns(5.6)))
    leg.at(ns(6.2))
    assert leg.take(Event(STRIKE, ns(6.22)))
    assert (leg.missed, leg.strikes) == (0, 7)
    assert leg.at(ns(6.5)).strides == pytest.approx(6.26, abs=0.02)
    assert leg.period > 1.05  # it tells of the cadence, too


@pytest.mark.parametrize('again', [0.02, 0.15])
def test_a_strike_that_bounces_counts_once(again):
    leg = walked(6)
    leg.take(Event(LIFT, ns(5.0 + 0.5 * again)))
    assert not leg.take(Event(STRIKE, ns(5.0 + again)))
    assert leg.doubled == 1
    assert leg.at(ns(5.3)).strides == pytest.approx(5.3, abs=0.005)


def test_a_foot_that_scuffs_the_ground_in_swing_has_not_struck():
    leg = walked(6)
    for event in (Event(LIFT, ns(5.6)), Event(STRIKE, ns(5.7)), Event(LIFT, ns(5.72))):
        leg.take(event)
    assert leg.take(Event(STRIKE, ns(6.0)))
    assert leg.strikes == 7


def test_after_a_silence_the_phase_is_unknown_until_the_next_strike():
    leg = walked(6)
    leg.lose()
    assert leg.at(ns(5.3)) is None
    leg.take(Event(STRIKE, ns(9.0)))
    assert leg.at(ns(9.5)).strides == pytest.approx(6.5, abs=0.01)


@given(
    st.lists(st.tuples(st.sampled_from([LIFT, STRIKE]), st.integers(1, 800)), max_size=60),
    st.integers(1, 50),
)
def test_whatever_the_events_the_phase_never_falls_and_never_passes_a_strike_unseen(events, look_ms):
    leg, now, before = LegPhase(), 0, -math.inf
    for kind, later_ms in events:
        for when in range(now, now + later_ms, look_ms):
            sample = leg.at(when * 1_000_000)
            if sample:
                assert sample.strides >= before
                assert sample.rate >= 0.0
                assert sample.strikes - 1 <= sample.strides < sample.strikes
                before = sample.strides
        now += later_ms
        leg.take(Event(kind, now * 1_000_000))

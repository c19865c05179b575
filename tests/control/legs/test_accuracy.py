import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_control.legs.accuracy import judge_strikes, phase_error

TRUTH = np.arange(10.0)


def test_strikes_that_are_the_true_ones_are_all_close():
    accuracy = judge_strikes(TRUTH, TRUTH)
    assert accuracy[:4] == (10, 0, 0, 1.0)
    assert (accuracy.mean, accuracy.deviation) == (0.0, 0.0)


@given(st.integers(0, 9), st.floats(0.25, 0.75), st.floats(-0.014, 0.014))
def test_one_missed_one_false_one_doubled_and_all_late_are_told(index, between, late):
    accuracy = judge_strikes(np.delete(TRUTH, index) + late, TRUTH)
    assert (accuracy.found, accuracy.missed, accuracy.false) == (9, 1, 0)
    assert accuracy.mean == pytest.approx(late)
    more = np.sort([*TRUTH, 0.0 + min(index, 8) + between])
    assert (judge_strikes(more, TRUTH).missed, judge_strikes(more, TRUTH).false) == (0, 1)
    doubled = np.sort([*TRUTH, index + 0.1])
    assert (judge_strikes(doubled, TRUTH).missed, judge_strikes(doubled, TRUTH).false) == (0, 1)


def test_nothing_found_is_all_missed():
    assert judge_strikes([], TRUTH)[:4] == (0, 10, 0, 0.0)


@given(st.floats(-0.4, 0.4), st.integers(-5, 5))
def test_phase_error_is_what_was_added_whatever_the_whole_strides(error, whole):
    seconds = np.linspace(0.0, 9.0, 50)
    assert phase_error(seconds, seconds + error + whole, TRUTH) == pytest.approx(error, abs=1e-9)
    assert np.isnan(phase_error([-0.1, 9.1], [0.0, 0.0], TRUTH)).all()

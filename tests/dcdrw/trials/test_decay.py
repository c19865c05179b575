"""The decay of the error from step to step."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw.trials.decay import fit_decay


@given(st.floats(-10, 10), st.floats(5, 50), st.sampled_from([-1, 1]), st.floats(0.3, 0.97), st.integers(8, 60))
def test_geometric_decay_is_found_exactly(limit, size, sign, ratio, count):
    errors = limit + sign * size * ratio ** np.arange(count)
    found = fit_decay(errors)
    assert found.ratio == pytest.approx(ratio, abs=1e-4)
    assert found.limit == pytest.approx(limit, abs=0.05 * size)
    np.testing.assert_allclose(found(np.arange(count)), errors, atol=1e-3 * size)


@pytest.mark.parametrize('errors', [[], [1.0, 2.0], [3.0] * 20, list(np.random.default_rng(1).normal(size=40))])
def test_what_does_not_decay_has_no_ratio(errors):
    assert math.isnan(fit_decay(errors).ratio)


def test_noise_shifts_it_little():
    noise = np.random.default_rng(0).normal(scale=0.3, size=40)
    assert fit_decay(3.0 - 28.0 * 0.94 ** np.arange(40) + noise).ratio == pytest.approx(0.94, abs=0.01)


def test_a_straight_line_tends_to_nothing():
    assert math.isnan(fit_decay([-28.4, -27.3, -26.2, -25.1, -24.0, -22.9]).ratio)

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_tracker.gait.contraction import WINDOW, contraction, fit_decay


@given(st.floats(-0.95, 0.95).filter(lambda ratio: abs(ratio) > 0.05), st.floats(-5.0, 5.0), st.integers(5, 30))
def test_the_ratio_is_found_wherever_the_fixed_point_is(ratio: float, fixed: float, count: int) -> None:
    errors = [fixed + 30.0 * ratio**step for step in range(count)]
    assert contraction(errors) == pytest.approx(ratio, abs=1e-6)


def test_noise_does_not_pull_the_ratio_towards_zero() -> None:
    random = np.random.default_rng(1)
    errors = [2.0 + 30.0 * 0.85 ** np.arange(20) + random.normal(0.0, 0.9, 20) for _ in range(200)]
    ratios = [contraction(list(trial)) for trial in errors]
    assert np.nanmedian(ratios) == pytest.approx(0.85, abs=0.01)


NOISE = np.random.default_rng(3).normal(0.0, 1.0, 24)


@pytest.mark.parametrize('errors', [[], [3.0] * 10, [1.0, 2.0, 3.0], list(NOISE)])
def test_few_or_settled_errors_tell_nothing(errors: list[float]) -> None:
    assert math.isnan(contraction(errors))


@given(st.floats(-10, 10), st.floats(5, 40), st.sampled_from([-1, 1]), st.floats(0.3, 0.95), st.integers(8, 60))
def test_a_decay_tends_to_its_limit(limit: float, size: float, sign: int, ratio: float, count: int) -> None:
    errors = [limit + sign * size * ratio**step for step in range(count)]
    found = fit_decay(errors, ratio)
    assert found.limit == pytest.approx(limit, abs=1e-6 * size)
    later = np.arange(found.first, count)
    assert found.limit + found.start * ratio ** (later - found.first) == pytest.approx(errors[found.first :], abs=1e-3)
    assert len(later) == min(count, WINDOW)


def test_a_straight_line_tends_to_nothing() -> None:
    line = [-28.4, -27.3, -26.2, -25.1, -24.0, -22.9]
    assert math.isnan(fit_decay(line, contraction(line)).limit)
    assert math.isnan(fit_decay(line, math.nan).limit)

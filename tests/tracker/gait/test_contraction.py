import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_tracker.gait.contraction import contraction


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

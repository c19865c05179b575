"""How finely a rotation is told: coarse counts are learned, and nothing else is taken for them."""

import math

import numpy as np
import pytest

from dcdrw_tracker.gait.resolution import Resolution, common_divisor
from tests.tracker.walking import walk


def learned(rotation: np.ndarray, dt: float) -> float:
    resolution = Resolution()
    for moved in np.diff(rotation).tolist():
        resolution.take(moved, dt)
    return resolution.count


@pytest.mark.parametrize('rate', [10, 50, 200, 1000])
@pytest.mark.parametrize('counts', [12, 64, 100, 360, 1000, 4000])
@pytest.mark.parametrize('kind', [np.float64, np.float32])
def test_the_count_of_an_encoder_is_learned_from_a_wheel_that_rolls(counts, rate, kind):
    count = math.tau / counts
    seen = (np.floor(walk(20.0, rate).front / count + 0.3) * count).astype(kind).astype(float)
    assert learned(seen, 1 / rate) == pytest.approx(count, rel=1e-2)


@pytest.mark.parametrize('rate', [10, 50, 200, 1000])
@pytest.mark.parametrize('noise_deg', [0.0, 0.01, 0.3])
@pytest.mark.parametrize('kind', [np.float64, np.float32])
def test_a_wheel_that_is_told_finely_has_none(rate, noise_deg, kind):
    rotation = np.array([sample.front.angle for sample in walk(20.0, rate).samples(noise_deg)])
    assert learned(rotation.astype(kind).astype(float), 1 / rate) == 0.0


@pytest.mark.parametrize('counts', [8192, 1 << 16])
def test_a_fine_encoder_is_none(counts):
    count = math.tau / counts
    assert learned(np.floor(walk(20.0).front / count) * count, 1 / 200) == 0.0


def test_an_even_motion_is_no_encoder():
    assert learned(np.arange(500) * 0.15, 0.1) == 0.0
    resolution = Resolution()
    for lost in [1, 1, 2, 1, 3, 1] * 20:  # of which samples are missing
        resolution.take(0.15 * lost, 0.1 * lost)
    assert resolution.count == 0.0
    resolution = Resolution()
    for dt in [0.001, 0.001, 0.298] * 20:  # stamped in bursts, as its samples arrive
        resolution.take(0.15, dt)
    assert resolution.count == 0.0


def test_a_wheel_that_rests_has_none():
    assert learned(np.zeros(500), 0.01) == 0.0


def test_a_rotation_that_wraps_is_learned_alike():
    count = math.tau / 64
    seen = np.floor(walk(20.0).front / count) * count
    assert learned(seen % math.tau, 1 / 200) == pytest.approx(count)


def test_the_common_divisor_is_that_of_whole_numbers():
    assert common_divisor(1.2, 0.9, 1e-3) == pytest.approx(0.3)
    assert common_divisor(math.inf, 0.9, 1e-3) == 0.9
    assert common_divisor(1.0, math.sqrt(0.5), 1e-3) < 0.01

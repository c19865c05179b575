import math

import numpy as np
import pytest

from dcdrw_control.legs.events import STRIKE
from dcdrw_control.legs.hip import HipDetector

PERIOD, SWING, RATE = 1.1, 0.4, 100.0


def flexion(phase: np.ndarray) -> np.ndarray:
    """A thigh that goes back through the stance and forward through the shorter swing, 0 at the greatest flexion."""
    stance = 1.0 - SWING
    back = 0.35 * np.cos(math.pi * phase / stance)
    forward = -0.35 * np.cos(math.pi * (phase - stance) / SWING)
    return 0.1 + np.where(phase < stance, back, forward)


def strikes(angles: np.ndarray, rate: float = RATE, rates: np.ndarray | None = None) -> list[float]:
    detector = HipDetector()
    given = np.full(len(angles), math.nan) if rates is None else rates
    events = [
        event
        for index, (angle, speed) in enumerate(zip(angles.tolist(), given.tolist(), strict=True))
        for event in detector.update(round(index / rate * 1e9), angle, speed)
    ]
    return [event.stamp_ns / 1e9 for event in events if event.kind == STRIKE]


def walk(rate: float = RATE) -> tuple[np.ndarray, np.ndarray]:
    seconds = np.arange(0.0, 12.0, 1.0 / rate)
    return seconds, flexion((seconds / PERIOD) % 1.0)


@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize('rate', [50.0, 100.0, 500.0])
def test_the_greatest_flexion_is_found_whichever_way_round(rate, sign):
    _, angles = walk(rate)
    found = strikes(sign * angles, rate)
    expected = PERIOD * np.arange(1, 11)
    assert len(found) == len(expected)
    assert found == pytest.approx(expected, abs=0.02)


def test_a_rate_that_is_given_is_used():
    seconds, angles = walk()
    assert strikes(0.0 * angles, rates=np.gradient(angles, seconds)) == pytest.approx(
        PERIOD * np.arange(1, 11), abs=0.015
    )


def test_a_hip_that_swings_evenly_counts_flexion_positive():
    seconds = np.arange(0.0, 12.0, 1.0 / RATE)
    found = strikes(0.35 * np.cos(math.tau * seconds / PERIOD))
    assert found[-3:] == pytest.approx(PERIOD * np.arange(8, 11), abs=0.02)


def test_noise_counts_nothing_twice():
    _, angles = walk()
    noisy = angles + np.random.default_rng(5).normal(0.0, math.radians(0.5), len(angles))
    assert strikes(noisy) == pytest.approx(PERIOD * np.arange(1, 11), abs=0.04)

import math

import numpy as np
import pytest

from dcdrw_control.legs.events import LIFT, STRIKE, Event
from dcdrw_control.legs.swing import SwingDetector

RATE = 200.0
PUSH, SWING, REST = 0.25, 0.4, 0.35
"""How long a foot pushes off, swings and rests in each stride [s]."""
PERIOD = PUSH + SWING + REST


def foot(seconds: np.ndarray) -> np.ndarray:
    """Angular rate of a foot that turns as far back in push-off as forward in swing [rad/s]."""
    within = seconds % PERIOD
    push = -1.1 / PUSH * 0.5 * math.pi * np.sin(math.pi * within / PUSH)
    swing = 1.1 / SWING * 0.5 * math.pi * np.sin(math.pi * (within - PUSH) / SWING)
    return np.where(within < PUSH, push, np.where(within < PUSH + SWING, swing, 0.0))


def events(rates: np.ndarray) -> list[Event]:
    detector = SwingDetector()
    return [
        event for index, rate in enumerate(rates.tolist()) for event in detector.update(round(index / RATE * 1e9), rate)
    ]


def seconds_of(found: list[Event], kind: str) -> list[float]:
    return [event.stamp_ns / 1e9 for event in found if event.kind == kind]


SECONDS = np.arange(0.0, 6.0, 1.0 / RATE)
LIFTS = [PUSH + stride * PERIOD for stride in range(6)]
STRIKES = [PUSH + SWING + stride * PERIOD for stride in range(5)]


def test_a_swing_begins_and_ends_where_the_rate_turns_round():
    found = events(foot(SECONDS))
    assert [event.kind for event in found[:10]] == [LIFT, STRIKE] * 5
    assert seconds_of(found, LIFT)[:5] == pytest.approx(LIFTS[:5], abs=0.006)
    assert seconds_of(found, STRIKE)[:5] == pytest.approx(STRIKES, abs=0.006)


def test_noise_and_offset_count_nothing():
    noise = np.random.default_rng(1).normal(0.05, 0.08, len(SECONDS))
    found = events(foot(SECONDS) + noise)
    assert seconds_of(found, STRIKE)[:5] == pytest.approx(STRIKES, abs=0.08)
    assert events(noise) == []


def test_a_dip_within_a_swing_does_not_end_it():
    within = SECONDS % PERIOD
    dip = np.abs(within - PUSH - 0.12) < 0.006
    found = events(np.where(dip, -0.05, foot(SECONDS)))
    assert seconds_of(found, STRIKE)[:5] == pytest.approx(STRIKES, abs=0.006)


def test_a_foot_that_comes_down_flat_has_struck():
    """Its rate fades, and never turns round."""
    rates = np.where(SECONDS % PERIOD < PUSH + SWING, foot(SECONDS), 0.05)
    assert seconds_of(events(rates), STRIKE)[:5] == pytest.approx(STRIKES, abs=0.03)


def test_small_steps_count_once_they_are_usual():
    assert len(seconds_of(events(0.3 * foot(SECONDS)), STRIKE)) >= 5

import numpy as np
import pytest

from dcdrw_control.legs.contact import ContactDetector, ForceDetector
from dcdrw_control.legs.events import LIFT, STRIKE, Event

RATE, PERIOD, STANCE = 100.0, 1.0, 0.6


def force(seconds: np.ndarray, weight: float = 700.0) -> np.ndarray:
    """A foot that is loaded within 40 ms, and unloaded likewise [N]."""
    within = seconds % PERIOD
    return weight * np.clip(np.minimum(within, STANCE - within) / 0.04, 0.0, 1.0)


def events(forces: np.ndarray) -> list[Event]:
    detector = ForceDetector()
    return [
        event for index, one in enumerate(forces.tolist()) for event in detector.update(round(index / RATE * 1e9), one)
    ]


def strikes(found: list[Event]) -> list[float]:
    return [event.stamp_ns / 1e9 for event in found if event.kind == STRIKE]


SECONDS = np.arange(0.3, 8.3, 1.0 / RATE) - 0.3


def test_each_change_of_a_contact_is_an_event_and_its_first_sample_is_none():
    detector = ContactDetector()
    touches = [True, True, False, False, True]
    found = [event for index, one in enumerate(touches) for event in detector.update(index, one)]
    assert found == [Event(LIFT, 2), Event(STRIKE, 4)]


@pytest.mark.parametrize('change', [1.0, -1.0, 0.4, 2.0], ids=['', 'downward', 'a child', 'heavy'])
def test_the_threshold_goes_with_the_weight(change):
    found = strikes(events(change * force(SECONDS + 0.3)))
    assert found == pytest.approx([0.7 + stride for stride in range(8)], abs=0.006)


def test_an_offset_and_noise_count_nothing():
    noisy = force(SECONDS + 0.3) + 25.0 + np.random.default_rng(2).normal(0.0, 3.0, len(SECONDS))
    assert strikes(events(noisy)) == pytest.approx([0.7 + stride for stride in range(8)], abs=0.02)


def test_who_sits_or_stands_does_not_walk():
    noise = np.random.default_rng(3).normal(0.0, 4.0, 2000)
    assert events(noise) == []
    assert events(400.0 + 20.0 * noise / 4.0) == []

"""Wheels in messages of their own, against the walk that they were cut from."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import JointSample, LoneWheel, Turn
from dcdrw_tracker.gait.pairing import WheelPairs
from tests.tracker.walking import START_NS, walk


def lone(samples: list[JointSample], delay_ns: int = 0) -> list[LoneWheel]:
    """Each wheel by itself; the rear one is sampled `delay_ns` later, at its speed."""
    wheels = []
    for sample in samples:
        wheels.append(LoneWheel(sample.stamp_ns, FRONT, sample.front))
        angle, rate = sample.rear
        wheels.append(LoneWheel(sample.stamp_ns + delay_ns, REAR, Turn(angle + rate * delay_ns * 1e-9, rate)))
    return wheels


def joined(wheels: list[LoneWheel]) -> tuple[list[JointSample], int]:
    pairs = WheelPairs()
    return [sample for wheel in wheels for sample in pairs.take(wheel)], pairs.unpaired


def test_wheels_of_equal_stamps_are_joined_as_they_are() -> None:
    samples = walk(3.0).samples()
    assert joined(lone(samples)) == (samples, 0)


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 4_999_999))
def test_the_rear_wheel_is_interpolated(delay_ns: int) -> None:
    samples = walk(3.0).samples()
    found, unpaired = joined(lone(samples, delay_ns))
    assert unpaired == 0
    assert [sample.stamp_ns for sample in found] == [sample.stamp_ns for sample in samples]
    for sample, truth in zip(found, samples, strict=True):
        assert sample.front == truth.front
        # A strike bends the line between two samples by at most (1 − cos 2α) ω T.
        assert sample.rear.angle == pytest.approx(truth.rear.angle, abs=1e-3)


def test_a_wheel_that_stays_away_leaves_a_gap() -> None:
    wheels = [
        wheel
        for wheel in lone(walk(4.0).samples())
        if wheel.wheel == FRONT or not 1e9 < wheel.stamp_ns - START_NS < 2e9
    ]
    found, unpaired = joined(wheels)
    gaps = [later.stamp_ns - earlier.stamp_ns for earlier, later in pairwise(found)]
    assert max(gaps) == pytest.approx(1e9, abs=2e7)
    assert len(found) + unpaired == 800


def test_a_wrap_between_two_messages_is_not_smeared() -> None:
    samples = walk(8.0).samples()
    wrapped = [
        wheel._replace(turn=Turn(math.remainder(wheel.turn.angle, math.tau), wheel.turn.rate))
        for wheel in lone(samples, 2_000_000)
    ]
    for sample, truth in zip(joined(wrapped)[0], samples, strict=True):
        assert math.remainder(sample.rear.angle - truth.rear.angle, math.tau) == pytest.approx(0.0, abs=0.02)


def test_a_stream_that_starts_anew_is_joined_on() -> None:
    samples = walk(2.0).samples()
    found, _ = joined(lone(samples) + lone(samples))
    assert len(found) > 2 * len(samples) - 30


@pytest.mark.parametrize('wheel', [FRONT, REAR])
def test_a_wheel_whose_other_one_never_comes_is_counted_and_not_kept(wheel: str) -> None:
    pairs = WheelPairs()
    alone = [one for one in lone(walk(4.0).samples()) if one.wheel == wheel]
    assert not [sample for one in alone for sample in pairs.take(one)]
    assert pairs.unpaired > len(alone) - 30

"""When frames are due, and what they show."""

import math

import pytest

from dcdrw_msgs_py.samples import JointSample, Turn
from dcdrw_sim.camera.shutter import Shutter, ShutterParams, between

SECOND = 1_000_000_000


def sample(t: float, run: int = 0) -> JointSample:
    return JointSample(round(t * SECOND), Turn(2.0 * t, 2.0), Turn(math.sin(t), math.nan), run=run)


def test_frames_come_at_their_rate_with_the_state_of_their_stamps():
    shutter, frames = Shutter(60.0), []
    for k in range(1001):
        shutter.take(sample(5.0 + k / 1000))
        frame = shutter.release()
        if frame:
            frames.append(frame)
    assert [frame.stamp_ns for frame in frames] == [round((5.0 + k / 60) * SECOND) for k in range(61)]
    for frame in frames:
        t = frame.stamp_ns / SECOND
        assert frame.front == pytest.approx((2.0 * t, 2.0), abs=1e-9)
        assert frame.rear.angle == pytest.approx(math.sin(t), abs=1e-6)
    assert frames[30].rear.rate == pytest.approx(math.cos(5.5), abs=1e-3), 'from the rotations, where none is told'
    assert (shutter.taken, shutter.dropped) == (61, 0)


def test_one_frame_waits_at_most_and_what_it_displaces_is_counted():
    shutter = Shutter(50.0)
    for k in range(1001):
        shutter.take(sample(k / 1000))
    assert shutter.release().stamp_ns == SECOND
    assert shutter.release() is None
    assert (shutter.taken, shutter.dropped) == (1, 50)


def test_rare_samples_make_as_many_frames():
    shutter = Shutter(60.0)
    for k in range(31):
        shutter.take(sample(k / 30))
        assert shutter.release()
    assert (shutter.taken, shutter.dropped) == (31, 30)


def test_a_source_that_starts_anew_is_told_and_a_pause_is_not():
    shutter = Shutter(60.0)
    assert shutter.take(sample(5.0))
    assert not shutter.take(sample(5.001))
    assert not shutter.take(sample(5.001))
    assert not shutter.take(sample(95.0))
    assert shutter.release() == sample(95.0)
    assert shutter.dropped == 1
    assert shutter.take(sample(1.0)), 'stamps went back'
    assert shutter.take(sample(1.1, run=1))


def test_between_two_samples_the_joints_lie_between():
    assert between(sample(1.0), sample(1.2), round(1.05 * SECOND)).front == pytest.approx((2.1, 2.0))


def test_an_encoding_that_is_not_drawn_is_refused():
    with pytest.raises(ValueError, match="encoding must be mono8 or bgr8, got 'rgb8'"):
        ShutterParams(encoding='rgb8').check_encoding()

"""Wheels in messages of their own, whose clocks may disagree."""

import numpy as np
import pytest

from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.suite.parameter_file import TrialParams
from dcdrw.trials.analysis import analyze
from dcdrw.trials.summary import Summary, summarize
from dcdrw_msgs_py.samples import SECOND, JointSample
from dcdrw_msgs_py.topics import FRONT_WHEEL, REAR_WHEEL
from tests.tracker.walking import walk

TRUTH = walk(20.0, 100.0)


def lone(samples: list[JointSample], place: int, name: str, stamp_ns: int, log_ns: int) -> JointBatch:
    """Messages of one wheel, stamped and recorded so much later than it was there."""
    turns = np.array([sample[place] for sample in samples])
    when = np.array([sample.stamp_ns for sample in samples], np.int64)
    nothing = np.full((len(samples), 1), np.nan)
    return JointBatch('', (name,), when + stamp_ns, turns[:, :1], turns[:, 1:], nothing, log_ns=when + log_ns)


def judged(stamp_ns: int, log_ns: int = 0) -> Summary:
    """A trial whose rear wheel's messages are stamped and recorded so much later."""
    samples = TRUTH.samples()
    parts = [samples[begin : begin + 5] for begin in range(0, len(samples), 5)]
    wheels = ((1, FRONT_WHEEL, 0, 0), (2, REAR_WHEEL, stamp_ns, log_ns))
    return summarize(analyze([lone(part, *wheel) for part in parts for wheel in wheels], TrialParams()))


def test_wheels_whose_clocks_agree_are_judged_as_those_of_one_message():
    summary = judged(0)
    outside = TRUTH.time[np.flatnonzero(abs(TRUTH.phase() - 0.5) > 0.06)[-1]]
    steps = int((TRUTH.front_strikes < outside).sum()) + 1
    assert (summary.remarks, summary.complete, summary.steps_to_synchronization) == ((), True, steps)


@pytest.mark.parametrize('offset', [-0.09, -0.04, 0.04, 0.09])
def test_a_clock_of_one_wheel_that_is_off_is_said(offset):
    summary = judged(round(offset * SECOND))
    assert not summary.complete
    assert f'recorded {-1000 * offset:+.0f} ms later' in summary.sentence
    assert 'the clocks disagree' in summary.sentence


def test_a_wheel_that_is_recorded_a_little_later_than_the_other_is_no_matter():
    assert judged(0, log_ns=10_000_000).complete


def test_stamps_that_never_meet_are_told():
    summary = judged(3600 * SECOND)
    assert summary.reason == (
        'no joint state could be read: the stamps of rear_wheel and front_wheel lie 3.6e+03 s apart: '
        'do their clocks agree?'
    )

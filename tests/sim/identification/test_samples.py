"""Which samples of a trial are taken."""

import numpy as np
import pytest

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.identification.samples import RATE_ENOUGH, free_rolling
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.trajectory import run

RIG = RigParams()


def rotations(rate, seconds=4.0):
    motion = run(*start(RIG, 0.216), seconds)
    times = np.arange(0.0, seconds, 1.0 / rate)
    at = motion.at(times)
    return times, np.column_stack([at.rotation1, at.rotation2])


@pytest.mark.parametrize(('rate', 'together'), [(60.0, 1), (200.0, 1), (500.0, 5), (1000.0, 9), (2000.0, 19)])
def test_neighbours_of_fast_trials_are_taken_together_and_stay_true(rate, together):
    times, psi = rotations(rate)
    samples = free_rolling(RIG, times, psi)
    assert len(samples.seconds) == pytest.approx(len(times) / together, rel=0.02)
    where = np.searchsorted(times, samples.seconds + samples.begins - 1e-9)
    taken = psi[where] - psi[where[0]] + samples.rotations[0]
    assert samples.rotations == pytest.approx(taken, abs=1e-12)


def test_samples_on_both_sides_of_a_gap_are_not_taken_together():
    times, psi = rotations(1000.0)
    kept = (times < 1.003) | (times > 1.5)
    samples = free_rolling(RIG, times[kept], psi[kept])
    at = samples.seconds + samples.begins
    assert not ((at > 1.003) & (at < 1.5)).any()
    motion = np.interp(at, times, psi[:, 0])
    assert samples.rotations[:, 0] - samples.rotations[0, 0] == pytest.approx(motion - motion[0], abs=1e-5)


def test_readings_that_are_wrong_now_and_then_are_left_out():
    times, psi = rotations(1000.0)
    spoiled = psi.copy()
    spoiled[::4] += 1.0
    clean, other = free_rolling(RIG, times, psi), free_rolling(RIG, times, spoiled)
    assert np.diff(other.seconds)[10] == pytest.approx(0.9 / RATE_ENOUGH)
    middle = slice(5, -5)
    assert np.diff(other.rotations[middle], axis=0) == pytest.approx(np.diff(clean.rotations[middle], axis=0), abs=8e-3)

"""The estimator on noisy, lossy data (issue: 0.2° and 5 % at 200 Hz, 100 trials of 30 s)."""

import math

import numpy as np
import pytest
from walking import PITCH, START_NS, keep, walk

from dcdrw_msgs_py.rig import FRONT
from dcdrw_msgs_py.samples import Footfall
from dcdrw_tracker.phase import PhaseEstimator, PhaseParams

TRIALS = 100


@pytest.mark.parametrize('rates', [True, False])
def test_noise_and_loss_never_spoil_the_steps_and_hardly_the_phase(rates: bool) -> None:
    phi_errors, strike_errors = [], []
    falls: list[Footfall]
    for trial in range(TRIALS // 2):
        truth = walk(30.0, p0=0.1 + 0.8 * trial / (TRIALS // 2), settle=1.0 + trial % 4)
        estimator = PhaseEstimator(PhaseParams())
        stamps, phi, n, falls = [], [], [], []
        for sample in keep(truth.samples(0.2, trial, rates), 0.05, trial):
            update = estimator.update(sample)
            assert update is not None
            stamps.append(sample.stamp_ns)
            phi.append(update.phase.phi.angle)
            n.append(update.phase.step_difference)
            falls += update.footfalls
        time = (np.array(stamps) - START_NS) * 1e-9
        kept = np.isin(np.round(truth.time * 1e9), np.round(time * 1e9))
        all_strikes = np.sort(np.concatenate((truth.front_strikes, truth.rear_strikes)))
        after = np.searchsorted(all_strikes, time)
        since, until = time - np.append(-9.0, all_strikes)[after], np.append(all_strikes, 99.0)[after] - time
        away = np.minimum(since, until) > 0.015
        n1, n2 = truth.steps()
        assert np.array_equal(np.array(n)[away], (n1 - n2)[kept][away])
        phi_errors.append((np.array(phi) - truth.phase()[kept] * PITCH + PITCH / 2) % PITCH - PITCH / 2)
        for fall in falls:
            strikes = truth.front_strikes if fall.wheel == FRONT else truth.rear_strikes
            strike_errors.append((fall.stamp_ns - START_NS) * 1e-9 - strikes[fall.steps - 1])
        assert len(falls) == pytest.approx(all_strikes.size, abs=1)
    phi_rms = math.degrees(float(np.sqrt(np.mean(np.concatenate(phi_errors) ** 2))))
    strike_rms = float(np.sqrt(np.mean(np.square(strike_errors))))
    assert phi_rms < 0.5
    assert strike_rms < 0.005

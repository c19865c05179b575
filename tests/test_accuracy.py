"""The estimator against the simulation: noise of 0.2°, 5 % of the samples lost, 200 Hz, 12 s a trial."""

import math

import numpy as np

from dcdrw_msgs_py.rig import FRONT, REAR, RigParams
from dcdrw_msgs_py.samples import JointSample, Turn
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.rig.simulator import SimulatorParams
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams

TRIALS, SECONDS, RATE = 50, 12.0, 200.0
NOISE, LOST = math.radians(0.2), 0.05
NEAR_STRIKE = 0.015
"""Nobody can tell on which side of a strike a sample lies that is nearer to it than its noise [s]."""


def test_noisy_lossy_trials_are_followed():
    random = np.random.default_rng(20240824)
    phase_errors, strike_errors = [], []
    for trial_number in range(TRIALS):
        speeds_given = trial_number % 2 == 0
        rig = RigParams(
            k=random.uniform(2.0, 60.0), b=random.uniform(30.0, 120.0), slope=math.radians(random.uniform(1.8, 3.0))
        )
        start = SimulatorParams(initial_phase_percent=random.uniform(7.0, 93.0)).start(rig)
        trial = run(*start, seconds=SECONDS)
        times = np.arange(0.0, trial.duration, 1.0 / RATE)
        times = times[random.random(times.size) >= LOST]
        truth = trial.at(times)
        noisy = [rotation + random.normal(0.0, NOISE, times.size) for rotation in (truth.rotation1, truth.rotation2)]
        estimator, falls, estimates = PhaseEstimator(PhaseParams()), [], []
        speeds = (truth.omega1, truth.omega2) if speeds_given else (np.full(times.size, math.nan),) * 2
        for t, psi1, psi2, omega1, omega2 in zip(times, *noisy, *speeds, strict=True):
            update = estimator.update(JointSample(round(t * 1e9) + 1, Turn(psi1, omega1), Turn(psi2, omega2)))
            assert update is not None
            estimates.append(update.phase)
            falls.extend(update.footfalls)

        pitch = 2.0 * rig.front.alpha
        strikes = {
            wheel: np.array([strike.t for strike in trial.strikes if strike.wheel == i])
            for i, wheel in ((1, FRONT), (2, REAR))
        }
        every = np.sort(np.concatenate(list(strikes.values())))
        distance = np.min(np.abs(times[:, None] - every[None, :]), axis=1)
        differences = np.array([estimate.step_difference for estimate in estimates])
        away = distance > NEAR_STRIKE
        np.testing.assert_array_equal(differences[away], (truth.steps1 - truth.steps2)[away])

        true_phase = (truth.rotation1 - truth.rotation2) / pitch
        errors = np.array([estimate.phi.angle for estimate in estimates]) / pitch - true_phase
        phase_errors.append(np.degrees((errors - np.round(errors)) * pitch))
        for wheel, times_of in strikes.items():
            found = np.array([fall.stamp_ns * 1e-9 for fall in falls if fall.wheel == wheel])
            # The last strike may be told only by samples after the end.
            assert len(times_of) - len(found) in (0, 1)
            strike_errors.append(found - times_of[: len(found)])
    phase_rms = math.sqrt(np.mean(np.concatenate(phase_errors) ** 2))
    strike_rms = math.sqrt(np.mean(np.concatenate(strike_errors) ** 2))
    print(f'φ {phase_rms:.3f}° rms, strikes {1e3 * strike_rms:.2f} ms rms')
    assert phase_rms < 0.5
    assert strike_rms < 0.005

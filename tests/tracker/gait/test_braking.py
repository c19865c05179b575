"""A wheel is braked where it strikes, and nowhere else: so a wrong zero, or other spokes, are told."""

import math

import numpy as np
import pytest

from dcdrw_tracker.gait.braking import doubt
from dcdrw_tracker.gait.phase import PhaseParams
from tests.tracker.gait.test_phase import run
from tests.tracker.walking import ALPHA, PITCH, rotation, walk


def rolled(rate: float, seconds: float, noise_deg: float, seed: int = 0):
    time = np.arange(round(rate * seconds)) / rate
    noise = math.radians(noise_deg) * np.random.default_rng(seed).standard_normal(time.size)
    return time, np.maximum.accumulate(rotation(time) + noise)


@pytest.mark.parametrize(('rate', 'noise_deg', 'seconds'), [(60.0, 0.0, 5.0), (60.0, 0.1, 12.0), (200.0, 0.05, 5.0)])
@pytest.mark.parametrize('off_deg', [0.0, 1.0, -1.0, 7.0, -7.0, 15.0, 24.0])
def test_a_zero_that_is_off_is_told_by_what_mends_it_and_a_right_one_is_not(rate, noise_deg, seconds, off_deg):
    off = math.radians(off_deg)
    time, psi = rolled(rate, seconds, noise_deg)
    told = doubt(time, psi + off, ALPHA)
    if abs(off_deg) <= 1.0:
        assert told is None
    else:
        assert math.isnan(told.spokes)
        assert abs(math.remainder(told.zero - off, PITCH)) < math.radians(2.5)


@pytest.mark.parametrize('gear', [2.0, 3.0, 1.2])
def test_spokes_that_are_not_the_rigs_are_told_by_their_number(gear):
    time, psi = rolled(100.0, 24.0, 0.02)
    assert doubt(time, gear * psi, ALPHA).spokes == pytest.approx(12.0 / gear)


@pytest.mark.parametrize('seed', range(4))
def test_nothing_is_said_of_a_wheel_that_is_driven(seed):
    """It goes faster and slower with its steps, but does not strike."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 12.0, 0.01)
    even = 0.9 * time
    swing = sum(random.normal(0.0, 0.01) * np.sin(12.0 * k * even + random.uniform(0.0, math.tau)) for k in (1, 2))
    psi = even + swing + math.radians(0.05) * random.standard_normal(time.size)
    assert doubt(time, np.maximum.accumulate(psi), ALPHA) is None


@pytest.mark.parametrize(
    ('counts', 'rate', 'step'), [(500, 200.0, 0.6), (1000, 50.0, 0.55), (2000, 200.0, 0.55), (4096, 100.0, 0.7)]
)
def test_the_counts_of_an_encoder_that_turns_evenly_are_no_strikes(counts, rate, step):
    time = np.arange(0.0, 20.0, 1.0 / rate)
    count = math.tau / counts
    for part in (0.0, 0.3, 0.6):
        assert doubt(time, count * np.floor(PITCH * time / step / count + part), ALPHA) is None


@pytest.mark.parametrize('counts', [2000, 4096])
def test_a_wrong_zero_is_told_by_counts_too(counts):
    time, psi = rolled(200.0, 10.0, 0.0)
    count = math.tau / counts
    told = doubt(time, count * np.floor((psi + 0.2) / count), ALPHA)
    assert abs(math.remainder(told.zero - 0.2, PITCH)) < math.radians(2.5)


def test_too_few_strikes_tell_nothing():
    time, psi = rolled(200.0, 2.5, 0.0)
    assert doubt(time, psi + 0.2, ALPHA) is None
    assert doubt(time[:0], psi[:0], ALPHA) is None


def test_the_zeros_of_a_rig_file_make_of_any_source_what_is_measured_from_a_spoke():
    samples = walk(4.0).samples()
    off = [
        sample._replace(
            front=sample.front._replace(angle=math.remainder(-(sample.front.angle + 0.3), math.tau)),
            rear=sample.rear._replace(angle=sample.rear.angle - 0.1),
        )
        for sample in samples
    ]
    off = [sample._replace(front=sample.front._replace(rate=-sample.front.rate)) for sample in off]
    phases, falls, status = run(off, PhaseParams(front_sign=-1, front_zero=0.3, rear_zero=-0.1))
    expected, same_falls, _ = run(samples)
    assert [(fall.wheel, fall.steps) for fall in falls] == [(fall.wheel, fall.steps) for fall in same_falls]
    assert [phase.phi.angle for phase in phases] == pytest.approx([phase.phi.angle for phase in expected], abs=1e-9)
    assert status.hints == ()

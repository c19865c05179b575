import itertools
import math
import random
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.rig.person import Person, PersonParams, Walk, natural_cadence, recorded_steps, varied_steps
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams

PAPER = preset('paper')
ALPHA = PAPER.front.alpha
PITCH = 2.0 * ALPHA
PERSON = PersonParams(walks=True)
UNEVEN = [0.6, 0.5, 0.55, 0.7]


def walked(person=PERSON, rig=PAPER, seconds=20.0, **others):
    """Samples at 100 Hz of a rig whose front wheel is a person."""
    simulated = SimulatedRig(rig, SimulatorParams(person=person, **others))
    times = np.arange(0.0, seconds, 0.01)
    return times, [simulated.read(t, round(t * 1e9)) for t in times]


def test_a_walk_is_even_from_heel_strike_to_heel_strike():
    walk, strikes = Walk(iter(UNEVEN)), np.cumsum([0.0, *UNEVEN])
    for j, duration in enumerate(UNEVEN[:-1]):
        for part in (0.0, 0.3, 0.9):
            assert walk.at(strikes[j] + part * duration) == pytest.approx((j + part, 1.0 / duration))


def test_strides_vary_by_what_is_asked_for():
    steps = np.array(list(itertools.islice(varied_steps(1.8, 0.027, 0.0, seed=4), 20_000)))
    strides = steps.reshape(-1, 2).sum(axis=1)
    assert strides.mean() == pytest.approx(2.0 / 1.8, rel=2e-3)
    assert strides.std() / strides.mean() == pytest.approx(0.027, rel=0.03)
    assert list(itertools.islice(varied_steps(1.8, 0.027, 0.0, seed=4), 9)) == steps[:9].tolist()


def test_the_cadence_drifts_as_asked_for():
    steps = np.cumsum(list(itertools.islice(varied_steps(2.0, 0.0, 0.1 / 60.0, seed=0), 200)))
    assert 1.0 / np.diff(steps)[np.searchsorted(steps, 60.0)] == pytest.approx(2.0 * 1.1, rel=2e-3)


def test_recorded_heel_strikes_are_walked_in_a_circle(tmp_path):
    file = tmp_path / 'strikes.csv'
    file.write_text('# left and right in turn\n12.0\n12.6\n13.1\n')
    assert list(itertools.islice(recorded_steps(file), 5)) == pytest.approx([0.6, 0.5, 0.6, 0.5, 0.6])


@pytest.mark.parametrize('text', ['', '1.0\n', '1.0\n0.9\n', 'left\n', '1.0\nnan\n2.0\n'])
@pytest.mark.filterwarnings('ignore:loadtxt')
def test_a_file_without_heel_strikes_in_order_is_refused_by_name(tmp_path, text):
    file = tmp_path / 'strikes.csv'
    file.write_text(text)
    with pytest.raises(ValueError, match=r'strikes\.csv \(person\.heel_strikes\) must hold'):
        recorded_steps(file)
    with pytest.raises(ValueError, match=r'absent\.csv \(person\.heel_strikes\)'):
        recorded_steps(tmp_path / 'absent.csv')


def test_the_natural_cadence_is_that_of_the_wheel_alone():
    rig = PAPER._replace(k=0.0, b=0.0)
    strikes = [strike.t for strike in Simulation(*start(rig, 0.5)).advance_to(20.0).strikes if strike.wheel == 1]
    assert natural_cadence(PAPER) == pytest.approx(1.0 / np.diff(strikes)[-1], rel=1e-9)


def test_the_wheel_stays_within_a_hundredth_of_a_step_of_the_person_s_walk():
    times, samples = walked()
    person = Person(PersonParams(walks=True), PAPER, -ALPHA, seed=0)
    away = np.array([sample.front.angle - person.reference(t)[0] for t, sample in zip(times, samples, strict=True)])
    assert np.abs(away).max() < 0.012 * PITCH


def test_a_person_can_be_pushed_only_a_little():
    force, away = 10.0, []
    for push in (0.0, force):
        rig = SimulatedRig(PAPER._replace(k=0.0, b=0.0, S0=90.0), SimulatorParams(person=PERSON))
        rig.simulation.external_force = push
        away.append(np.array([rig.read(t, 0).front.angle for t in np.arange(3.0, 6.0, 0.01)]))
    given_way = (away[0] - away[1]) * PAPER.front.length
    # In tension the coupler pulls the person back: by F ℓ / K at the hub, as a spring of that stiffness gives way.
    assert given_way.mean() == pytest.approx(force * PAPER.front.length**2 / PersonParams().stiffness, rel=0.15)


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 1000))
def test_samples_do_not_depend_on_when_one_looks(seed):
    random_times = sorted(random.Random(seed).uniform(0.0, 3.0) for _ in range(40))
    params = SimulatorParams(person=PersonParams(walks=True), seed=seed)
    often, seldom = SimulatedRig(PAPER, params), SimulatedRig(PAPER, params)
    for t, following in pairwise((*random_times, 4.0)):
        often.read(t, 0)
        often.prepare(following)
    assert often.read(4.0, 0).front == pytest.approx(seldom.read(4.0, 0).front, abs=1e-9)


def test_a_servo_too_fast_to_be_sampled_is_refused():
    with pytest.raises(ValueError, match=r'person\.damping must be ≤'):
        SimulatedRig(PAPER, SimulatorParams(person=PersonParams(walks=True, damping=5000.0)))


def test_a_person_walks_where_no_wheel_rolls_by_itself():
    state = {'theta1': -ALPHA, 'omega1': 1.0, 'theta2': 0.0, 'omega2': 0.0}
    params = SimulatorParams(person=PersonParams(walks=True, cadence=2.0, variability_percent=0.0), **state)
    rig = SimulatedRig(PAPER._replace(slope=0.0), params)
    assert rig.read(10.0, 0).front.angle + ALPHA == pytest.approx(20.0 * PITCH, abs=0.02 * PITCH)
    with pytest.raises(ValueError, match='too gentle'):
        SimulatedRig(PAPER._replace(slope=0.0), params._replace(person=PersonParams(walks=True)))


def test_the_rear_hub_is_driven():
    driven, alone = (SimulatedRig(PAPER, SimulatorParams(person=PersonParams(walks=True))) for _ in range(2))
    driven.rear_torque = 5.0
    assert driven.read(0.1, 0).rear.rate > alone.read(0.1, 0).rear.rate
    assert math.isclose(driven.rear_torque, 5.0)

"""The goals of `benchmarks/legs.py`: recorded people, against motion capture and a force plate."""

import math

import numpy as np
import pytest
from legs import (
    DATA,
    FORCES,
    SEEN_OTHERWISE,
    SIDES,
    STEADY_GOAL,
    STRIKES_GOAL,
    TURN_GOAL,
    foot,
    judge,
    person,
    treadmill,
    truth,
)
from scipy.spatial.transform import Rotation

from dcdrw_control.legs.accuracy import judge_strikes
from dcdrw_control.legs.samples import ImuReading, Leg
from dcdrw_control.legs.walk import follow


def test_there_are_goals_for_what_was_promised():
    assert (STRIKES_GOAL, STEADY_GOAL, TURN_GOAL) == (0.9, 2.0, 5.0)


@pytest.mark.parametrize('side', SIDES)
@pytest.mark.parametrize('name', ['IMU', *SEEN_OTHERWISE])
def test_every_heel_strike_is_found_and_the_phase_followed_however_the_sensor_is_mounted(name, side):
    score = judge(foot(side, name))
    assert (score.strikes.missed, score.strikes.false) == (0, 0)
    assert score.strikes.close >= STRIKES_GOAL
    assert score.steady <= STEADY_GOAL
    assert score.turning <= TURN_GOAL


def sideways(case, strikes):
    """The walk, turned by a quarter about the vertical until shortly after so many heel strikes."""
    until = 1e9 * (case.truth[strikes - 1] + 0.2)
    upwards = np.mean([one.reading.acceleration for one in case.readings[:100]], axis=0)
    turned = Rotation.from_rotvec(0.5 * math.pi * upwards / np.linalg.norm(upwards))
    return [
        one._replace(reading=ImuReading(*(tuple(turned.apply(vector).tolist()) for vector in one.reading)))
        if one.stamp_ns < until
        else one
        for one in case.readings
    ]


@pytest.mark.parametrize('side', SIDES)
@pytest.mark.parametrize('steps', [1, 2])
def test_steps_to_the_side_before_the_walk_cost_none_of_its_strikes(side, steps):
    case = foot(side, 'IMU')
    found, later = follow(sideways(case, steps)).strike_seconds(case.leg), case.truth[steps:]
    accuracy = judge_strikes(found[found > later[0] - 0.2], later)
    assert (accuracy.missed, accuracy.false) == (0, 0)
    assert accuracy.close >= STRIKES_GOAL


@pytest.mark.parametrize('side', SIDES)
def test_a_sensor_that_slips_leaves_a_gap_and_is_followed_again(side):
    case = foot(side, 'IMU')
    walk = follow(sideways(case, 10))
    found, later = walk.strike_seconds(case.leg), case.truth[20:]
    accuracy = judge_strikes(found[found > later[0] - 0.2], later)
    assert (accuracy.missed, accuracy.false) == (0, 0)
    assert walk.status.legs[case.leg].gaps == 1
    assert max(np.diff(walk.phase(case.leg)[0])) > 0.1


@pytest.mark.parametrize('name', FORCES)
def test_every_strike_on_a_force_plate_is_found_whatever_its_sign_offset_and_the_weight(name):
    score = judge(treadmill(name))
    assert (score.strikes.found, score.strikes.missed, score.strikes.false) == (46, 0, 0)
    assert score.strikes.close == 1.0
    assert score.steady <= STEADY_GOAL


@pytest.fixture(scope='module')
def followed():
    return follow(person())


@pytest.mark.parametrize('side', SIDES)
def test_heel_strikes_are_known_when_they_happen(followed, side):
    leg = Leg('front', side)
    mounting_known = truth(side)[2]  # learned in the first strides
    known = np.array([s.known_ns for s in followed.strikes if s.leg == leg]) / 1e9
    later = truth(side)[truth(side) >= mounting_known]
    accuracy = judge_strikes(known[known > mounting_known - 0.1], later)
    assert (accuracy.missed, accuracy.false) == (0, 0)
    assert accuracy.close >= 0.9


def test_the_step_that_the_events_leave_out_is_a_step():
    """Motion capture sees the left foot fly and land within its stride 13: the list of events has no strike there."""
    table = np.genfromtxt(DATA / 'mocap_turn.csv', delimiter=',', skip_header=2)
    seconds, marker = table[:, 0] / 100.0, table[:, 1:4] / 1000.0
    speed = np.linalg.norm(np.diff(marker, axis=0), axis=1) * 100.0
    pivot = truth('left')[14]

    def within(start: float, end: float):
        return speed[(seconds[1:] > pivot + start) & (seconds[1:] < pivot + end)]

    assert within(-0.3, 0.0).max() > 1.5
    assert within(0.1, 0.5).max() < 0.3


def test_steps_alternate_from_left_to_right(followed):
    turns = [(update.stamp_ns, update.wheels['front_wheel'].angle) for update in followed.updates if update.wheels]
    seconds, psi = np.array(turns).T * [[1e-9], [1.0]]
    assert (np.diff(psi) >= 0.0).all()
    alpha = math.pi / 12.0
    both = np.sort(np.concatenate([truth(side) for side in SIDES]))
    both = both[(both > seconds[0]) & (both < seconds[-1])]
    struck = [seconds[np.searchsorted(psi, alpha * (2 * j + 1))] for j in range(3, len(both))]
    late = np.abs(np.array(struck)[:, None] - both).min(axis=1)
    assert np.mean(late < 0.02) >= 0.9
    assert np.mean(np.diff(struck)) == pytest.approx(np.mean(np.diff(both)), rel=0.02)

"""Recorded people, held against motion capture and a force plate; and as other sensors would have seen them."""

import math

import numpy as np
import pytest

from dcdrw_control.legs.accuracy import judge_strikes
from dcdrw_control.legs.csv_file import read_legs
from dcdrw_control.legs.samples import ContactReading, Leg, LegReading, WrenchReading
from dcdrw_control.legs.walk import follow
from tests.control.legs.gait import (
    DATA,
    SIDES,
    TURN,
    Change,
    Signals,
    person,
    phase_rms_percent,
    readings,
    signals,
    steady_rms_percent,
    truth,
)

LEFT = Leg('front', 'left')


@pytest.fixture(scope='module')
def followed():
    return follow(person())


@pytest.mark.parametrize('side', SIDES)
def test_every_heel_strike_of_a_walk_with_a_turn_is_found(followed, side):
    accuracy = judge_strikes(followed.strike_seconds(Leg('front', side)), truth(side))
    assert (accuracy.missed, accuracy.false) == (0, 0)
    assert accuracy.close >= 0.9


@pytest.mark.parametrize('side', SIDES)
def test_heel_strikes_are_known_when_they_happen(followed, side):
    leg = Leg('front', side)
    mounting_known = truth(side)[2]  # learned in the first strides
    known = np.array([s.known_ns for s in followed.strikes if s.leg == leg]) / 1e9
    later = truth(side)[truth(side) >= mounting_known]
    accuracy = judge_strikes(known[known > mounting_known - 0.1], later)
    assert (accuracy.missed, accuracy.false) == (0, 0)
    assert accuracy.close >= 0.9


@pytest.mark.parametrize('side', SIDES)
def test_phase_follows_steady_walking_and_the_turn(followed, side):
    leg = Leg('front', side)
    assert steady_rms_percent(followed, leg, truth(side), TURN) <= 2.0
    assert phase_rms_percent(followed, leg, truth(side), *TURN) <= 5.0


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


def interpolated(rate: float) -> Change:
    def change(signals: Signals) -> Signals:
        seconds = np.arange(signals[0][0], signals[0][-1], 1.0 / rate)
        rates, accelerations = (
            np.stack([np.interp(seconds, signals[0], column) for column in table.T], axis=1) for table in signals[1:]
        )
        return seconds, rates, accelerations

    return change


def turned(*rows: tuple[float, float, float]) -> Change:
    matrix = np.array(rows)
    return lambda signals: (signals[0], signals[1] @ matrix, signals[2] @ matrix)


def noisy(rate_deg: float, acceleration: float) -> Change:
    def change(signals: Signals) -> Signals:
        random = np.random.default_rng(3)
        return (
            signals[0],
            signals[1] + random.normal(0.0, math.radians(rate_deg), signals[1].shape),
            signals[2] + random.normal(0.0, acceleration, signals[2].shape),
        )

    return change


def without(share: float) -> Change:
    def change(signals: Signals) -> Signals:
        kept = np.random.default_rng(4).random(len(signals[0])) >= share
        return signals[0][kept], signals[1][kept], signals[2][kept]

    return change


def stretched(factor: float) -> Change:
    return lambda signals: (signals[0] * factor, signals[1] / factor, signals[2])


def offset(rate_deg: tuple[float, float, float], acceleration: tuple[float, float, float]) -> Change:
    return lambda signals: (signals[0], signals[1] + np.radians(rate_deg), signals[2] + acceleration)


SEEN_OTHERWISE: dict[str, Change] = {
    'at 50 Hz': interpolated(50.0),
    'at 100 Hz': interpolated(100.0),
    'at 500 Hz': interpolated(500.0),
    'acceleration in g': lambda signals: (signals[0], signals[1], signals[2] / 9.81),
    'upside down': turned((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    'the other way round': turned((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
    'axes changed': turned((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    'aslant': turned((0.36, 0.48, -0.8), (-0.8, 0.6, 0.0), (0.48, 0.64, 0.6)),
    'noise': noisy(5.0, 0.5),
    'offsets': offset((5.0, -5.0, 5.0), (1.0, -2.0, 0.5)),
    'a tenth of the samples lost': without(0.1),
    'a fifth faster': stretched(0.8),
    'a fifth slower': stretched(1.2),
}


@pytest.mark.parametrize('side', SIDES)
@pytest.mark.parametrize('name', SEEN_OTHERWISE)
def test_no_mounting_rate_unit_or_cadence_matters(name, side):
    scale = {'a fifth faster': 0.8, 'a fifth slower': 1.2}.get(name, 1.0)
    leg, true = Leg('front', side), truth(side) * scale
    followed = follow(readings(SEEN_OTHERWISE[name](signals(side)), side))
    accuracy = judge_strikes(followed.strike_seconds(leg) / scale, truth(side))
    assert (accuracy.missed, accuracy.false) == (0, 0)
    assert accuracy.close >= 0.9
    turn = (TURN[0] * scale, TURN[1] * scale)
    assert steady_rms_percent(followed, leg, true, turn) <= 2.0
    assert phase_rms_percent(followed, leg, true, *turn) <= 5.0


@pytest.fixture(scope='module')
def plate() -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and vertical force [N] of a foot on a treadmill."""
    table = np.loadtxt(DATA / 'example_vertical_grf.csv', delimiter=',')
    return table[:, 0], table[:, 1]


def at_50_newtons(seconds: np.ndarray, force: np.ndarray) -> np.ndarray:
    """When the force of a foot rises through 50 N, as gait laboratories tell a heel strike [s]."""
    before = np.flatnonzero((force[:-1] < 50.0) & (force[1:] >= 50.0))
    share = (50.0 - force[before]) / (force[before + 1] - force[before])
    return seconds[before] + share * (seconds[before + 1] - seconds[before])


def test_every_strike_on_a_force_plate_is_found(plate):
    followed = follow(read_legs(DATA / 'example_vertical_grf.csv').readings)
    true = at_50_newtons(*plate)
    assert len(true) == len(followed.strikes) == 46
    accuracy = judge_strikes(followed.strike_seconds(LEFT), true)
    assert (accuracy.found, accuracy.missed, accuracy.false, accuracy.close) == (46, 0, 0, 1.0)
    assert phase_rms_percent(followed, LEFT, true) <= 2.0


@pytest.mark.parametrize(
    'change',
    [lambda force: -force, lambda force: force + 30.0, lambda force: 0.35 * force, lambda force: 2.0 * force],
    ids=['downward', 'offset', 'a child', 'heavy'],
)
def test_no_sign_offset_or_weight_matters(plate, change):
    seconds, force = plate
    followed = follow(
        LegReading(round(t * 1e9), LEFT, WrenchReading(f))
        for t, f in zip(seconds.tolist(), change(force).tolist(), strict=True)
    )
    accuracy = judge_strikes(followed.strike_seconds(LEFT), at_50_newtons(seconds, force))
    assert (accuracy.found, accuracy.false) == (46, 0)
    assert accuracy.close >= 0.95


def test_a_contact_switch_tells_the_same(plate):
    seconds, force = plate
    followed = follow(
        LegReading(round(t * 1e9), LEFT, ContactReading(f >= 50.0))
        for t, f in zip(seconds.tolist(), force.tolist(), strict=True)
    )
    assert len(followed.strikes) == 46
    assert phase_rms_percent(followed, LEFT, at_50_newtons(seconds, force)) <= 2.0

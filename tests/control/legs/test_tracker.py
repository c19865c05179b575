import math

import pytest

from dcdrw_control.legs.params import LegParams
from dcdrw_control.legs.samples import (
    LEGS,
    ContactReading,
    HipReading,
    ImuReading,
    Leg,
    LegReading,
    WrenchReading,
)
from dcdrw_control.legs.tracker import LegTracker
from dcdrw_control.legs.walk import follow

LEFT, RIGHT = Leg('front', 'left'), Leg('front', 'right')
OFFSETS = dict(zip(LEGS, (0.0, 0.5, 0.75, 0.25), strict=True))
"""How far each leg is ahead of the front left one in its stride: the rear legs by a quarter stride."""
PERIOD, STANCE, RATE = 1.0, 0.6, 100.0


def contacts(legs=LEGS, start: float = 0.0, end: float = 12.0) -> list[LegReading]:
    """Contacts of legs that walk evenly; the front left one strikes at whole seconds."""
    return [
        LegReading(round(index / RATE * 1e9), leg, ContactReading((index / RATE + OFFSETS[leg]) % PERIOD < STANCE))
        for index in range(round(start * RATE), round(end * RATE))
        for leg in legs
    ]


def between(readings: list[LegReading], start: float, end: float) -> list[LegReading]:
    return [reading for reading in readings if start <= reading.stamp_ns / 1e9 < end]


def test_four_legs_turn_two_wheels_half_a_step_apart():
    """A quarter of a stride between the halves is half a step between the wheels."""
    pitch = math.radians(30.0)
    for update in follow(contacts()).updates[-200:]:
        front, rear = update.wheels['front_wheel'], update.wheels['rear_wheel']
        assert (front.angle - rear.angle) / pitch % 1.0 == pytest.approx(0.5, abs=0.04)
        assert front.rate == pytest.approx(2.0 * pitch, rel=0.2)


def test_phases_are_two_pi_a_stride_and_zero_at_heel_strike():
    last = follow(contacts()).updates[-1]
    for leg, turn in last.legs.items():
        expected = math.tau * ((last.stamp_ns / 1e9 + OFFSETS[leg]) % PERIOD)
        assert turn.angle % math.tau == pytest.approx(expected, abs=math.tau * 0.015)
        assert turn.rate == pytest.approx(math.tau, rel=0.1)


def test_one_half_alone_is_told_and_the_other_left_open():
    wheels = [update.wheels for update in follow(contacts((LEFT, RIGHT))).updates]
    assert wheels[-1].keys() == {'front_wheel'}
    assert not any('rear_wheel' in known for known in wheels)


def test_a_silent_sensor_leaves_a_gap_and_never_a_guess():
    silent = [r for r in contacts() if not (r.leg == LEFT and 5.3 <= r.stamp_ns / 1e9 < 8.5)]
    followed = follow(silent)
    silence = LegParams().silence
    for update in followed.updates:
        seconds = update.stamp_ns / 1e9
        if 5.3 + silence < seconds < 9.0:  # until it strikes again
            assert LEFT not in update.legs
            assert RIGHT in update.legs
            assert update.wheels.keys() == {'rear_wheel'}
    assert followed.status.legs[LEFT].gaps == 1
    assert LEFT in followed.updates[-1].legs
    assert 'front_wheel' in followed.updates[-1].wheels


def test_a_recording_that_starts_again_is_followed_again():
    readings = contacts()
    followed = follow([*readings, *readings])
    assert followed.status.refused['reversed'] == 0
    assert followed.updates[-1].legs.keys() == set(LEGS)


@pytest.mark.parametrize(
    ('reading', 'why'),
    [
        (LegReading(3_000_000_000, LEFT, WrenchReading(math.nan)), 'not finite'),
        (LegReading(3_000_000_000, LEFT, ImuReading((0.0, math.inf, 0.0), (0.0, 0.0, 9.8))), 'not finite'),
        (LegReading(3_000_000_000, LEFT, HipReading(math.nan)), 'not finite'),
        (LegReading(3_000_000_000, LEFT, WrenchReading(500.0)), 'another sensor'),
        (LegReading(2_990_000_000, LEFT, ContactReading(True)), 'repeated'),
        (LegReading(2_500_000_000, LEFT, ContactReading(True)), 'reversed'),
        (LegReading(9_000_000_000, LEFT, ContactReading(True)), 'future'),
    ],
)
def test_a_reading_that_cannot_be_is_refused_and_counted(reading, why):
    tracker = LegTracker(LegParams())
    for good in contacts(end=3.0):
        tracker.update(good)
    before = tracker.status()
    assert tracker.update(reading, now_ns=3_100_000_000) is None
    after = tracker.status()
    assert after.refused == {**before.refused, why: 1}
    assert after.legs == before.legs


def test_another_sensor_takes_over_once_the_first_is_silent():
    wrenches = [r._replace(reading=WrenchReading(700.0 * r.reading.touches)) for r in contacts(start=6.0)]
    followed = follow([*contacts(end=5.0), *wrenches])
    assert all(status.sensor == 'wrench' for status in followed.status.legs.values())
    assert followed.updates[-1].legs.keys() == set(LEGS)


def test_no_more_is_published_than_the_rate_allows_but_every_strike_is():
    followed = follow(contacts(), LegParams(rate=10.0))
    stamps = [update.stamp_ns for update in followed.updates]
    strikes = {strike.known_ns for strike in followed.strikes}
    assert len(stamps) <= 10 * 12 + len(strikes)
    assert strikes <= {0, *stamps} | set(sorted(strikes)[:4])


def test_a_hip_that_is_flexed_before_the_heel_strikes_is_told_by_hip_lead():
    lead, rate = 0.12, 100.0
    seconds = [index / rate for index in range(1500)]
    readings = [
        LegReading(round(t * 1e9), LEFT, HipReading(0.35 * math.cos(math.tau * (t / PERIOD + lead)))) for t in seconds
    ]
    last = follow(readings, LegParams(hip_lead=lead)).updates[-1]
    assert last.legs[LEFT].angle / math.tau % 1.0 == pytest.approx(last.stamp_ns / 1e9 / PERIOD % 1.0, abs=0.03)


@pytest.mark.parametrize('burst', [3, 10, 15])
def test_sensors_that_come_in_bursts_change_nothing(burst):
    """Each leg's readings come many at once, as over a busy network: the phases are those of readings in order."""
    in_order, size = contacts(), burst * len(LEGS)
    parts = [in_order[start : start + size] for start in range(0, len(in_order), size)]
    bursts = [reading for part in parts for leg in LEGS for reading in part if reading.leg == leg]
    expected = {update.stamp_ns: update for update in follow(in_order).updates}
    updates = follow(bursts).updates
    assert len(updates) > 0.9 * len(expected)
    for update in updates:
        same = expected[update.stamp_ns]
        assert update.legs.keys() == same.legs.keys()
        for leg, turn in update.legs.items():
            assert turn.angle == pytest.approx(same.legs[leg].angle, abs=1e-9)

"""How well the leg tracker finds heel strikes and phase of recorded people, and of copies as other sensors see them.

    PYTHONPATH=. python benchmarks/legs.py

The recordings are those in tests/data/gait: IMUs on both feet against motion capture, and one foot on a force plate.
The first rows are what was recorded; the others are copies with what their name tells: another rate, unit, mounting or
cadence, noise (5 deg/s and 0.5 m/s²), offsets (5 deg/s and 2 m/s²), samples lost.

Read the table from left to right: true heel strikes; missed, and false (goal: none); share found within ±15 ms of the
true ones (goal: 90 %); how late they are told to be, mean and standard deviation [ms]; how long after its own time a
strike is known, median [ms]; error of the phase, root mean square, of a stride: in steady walking from the third stride
on (goal: 2 %), and through the turn (goal: 5 %); processor time per reading [µs]. `!` marks a goal that is missed.
"""

import csv
import math
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_control.legs.accuracy import StrikeAccuracy, judge_strikes, phase_error
from dcdrw_control.legs.csv_file import read_legs
from dcdrw_control.legs.samples import ContactReading, ImuReading, Leg, LegReading, WrenchReading
from dcdrw_control.legs.walk import Walk, follow

DATA = Path(__file__).parent.parent / 'tests' / 'data' / 'gait'
RATE = 204.8
SIDES = ('left', 'right')
LEFT = Leg('front', 'left')
PIVOT = 3530 / RATE
"""The left foot's step on the spot, which the list of events leaves out: the turn of its stride 13 [s]."""
TURN = (3308 / RATE, 3895 / RATE)
"""From the left foot's last heel strike before the turn to the right foot's first after it [s]."""
STRIKES_GOAL, STEADY_GOAL, TURN_GOAL = 0.9, 2.0, 5.0
"""Share of heel strikes within 15 ms; phase in steady walking and through the turn [% of a stride]."""

Floats = NDArray[np.float64]
Signals = tuple[Floats, Floats, Floats]
"""Times [s], (N,); angular rates [rad/s] and accelerations [m/s²], (N, 3)."""
Change = Callable[[Signals], Signals]


class Case(NamedTuple):
    """One foot, by one sensor."""

    name: str
    leg: Leg
    readings: list[LegReading]
    truth: Floats
    """True heel strikes [s]."""
    turn: tuple[float, float] = (math.inf, math.inf)
    """From and to when it turns [s]."""
    slower: float = 1.0
    """How many times slower than recorded: strikes are judged in recorded time, for their error is stretched, too."""


class Score(NamedTuple):
    """What the tracker made of it."""

    strikes: StrikeAccuracy
    known_after: float
    """Median time from a heel strike until it is known [s]."""
    steady: float
    """Error of the phase, root mean square [% of a stride]."""
    turning: float
    """The same through the turn; NaN where there is none."""
    seconds: float
    """Processor time per reading [s]."""


def judge(case: Case) -> Score:
    """Follow the foot, and hold the result against the truth."""
    start = time.process_time()
    walk = follow(case.readings)
    seconds = (time.process_time() - start) / len(case.readings)
    before, after = ((case.truth[3], case.turn[0]), (case.turn[1], case.truth[-1]))
    strikes = walk.strikes_of(case.leg)
    return Score(
        judge_strikes(walk.strike_seconds(case.leg) / case.slower, case.truth / case.slower),
        float(np.median([strike.known_ns - strike.stamp_ns for strike in strikes])) / 1e9,
        _phase_percent(walk, case, before, after),
        _phase_percent(walk, case, case.turn),
        seconds,
    )


def _phase_percent(walk: Walk, case: Case, *spans: tuple[float, float]) -> float:
    seconds, strides = walk.phase(case.leg)
    error = phase_error(seconds, strides, case.truth)
    there = [error[(seconds >= start) & (seconds <= end)] for start, end in spans]
    errors = np.concatenate(there)
    return 100.0 * float(np.sqrt(np.nanmean(errors**2))) if len(errors) else math.nan


@cache
def person() -> tuple[LegReading, ...]:
    """Both feet of a person who walks 20 m, turns, and walks back."""
    return tuple(read_legs(DATA / 'imu_sample.csv', RATE).readings)


@cache
def truth(side: str) -> Floats:
    """Heel strikes as motion capture tells them, with the pivot step of the turn [s]."""
    with (DATA / 'stride_events_sample.csv').open() as file:
        events = [event for event in csv.DictReader(file) if event['foot'] == side]
    listed = {float(event[name]) / RATE for event in events for name in ('ic', 'pre_ic')}
    return np.array(sorted(listed | ({PIVOT} if side == 'left' else set())))


def foot(side: str, name: str = 'IMU') -> Case:
    """One foot of the person; `name` is of SEEN_OTHERWISE, or the recording itself."""
    mine = [reading for reading in person() if reading.leg.side == side]
    imus = [reading.reading for reading in mine if isinstance(reading.reading, ImuReading)]
    signals = (
        np.array([reading.stamp_ns for reading in mine]) / 1e9,
        np.array([imu.rate for imu in imus]),
        np.array([imu.acceleration for imu in imus]),
    )
    if name in SEEN_OTHERWISE:
        signals = SEEN_OTHERWISE[name](signals)
    leg, slower = Leg('front', side), CADENCES.get(name, 1.0)
    rows = zip(*(column.tolist() for column in signals), strict=True)
    readings = [LegReading(round(t * 1e9), leg, ImuReading(tuple(rate), tuple(pull))) for t, rate, pull in rows]
    return Case(f'{name}, {side}', leg, readings, truth(side) * slower, (TURN[0] * slower, TURN[1] * slower), slower)


@cache
def plate() -> tuple[Floats, Floats]:
    """Times [s] and vertical force [N] of a foot on a treadmill."""
    seconds, force = np.loadtxt(DATA / 'example_vertical_grf.csv', delimiter=',').T
    return seconds, force


def at_50_newtons(seconds: np.ndarray, force: np.ndarray) -> np.ndarray:
    """When the force of a foot rises through 50 N, as gait laboratories tell a heel strike [s]."""
    before = np.flatnonzero((force[:-1] < 50.0) & (force[1:] >= 50.0))
    share = (50.0 - force[before]) / (force[before + 1] - force[before])
    return seconds[before] + share * (seconds[before + 1] - seconds[before])


def treadmill(name: str) -> Case:
    """The foot on the treadmill; `name` is of FORCES."""
    seconds, force = plate()
    rows = zip(seconds.tolist(), FORCES[name](force).tolist(), strict=True)
    readings = [
        LegReading(round(t * 1e9), LEFT, ContactReading(bool(f)) if name == 'contact' else WrenchReading(f))
        for t, f in rows
    ]
    return Case(name, LEFT, readings, at_50_newtons(seconds, force))


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

CADENCES = {'a fifth faster': 0.8, 'a fifth slower': 1.2}
FORCES: dict[str, Callable[[Floats], Floats]] = {
    'force plate': lambda force: force,
    'force downward': lambda force: -force,
    'force with an offset of 30 N': lambda force: force + 30.0,
    'force of a child': lambda force: 0.35 * force,
    'contact': lambda force: force >= 50.0,
}


def cases() -> Iterator[Case]:
    """Every row of the table."""
    for name in ('IMU', *SEEN_OTHERWISE):
        for side in SIDES:
            yield foot(side, name)
    yield from map(treadmill, FORCES)


def main() -> None:
    print(f'{"":38}strikes  missed   false  ±15 ms      late [ms]  known  steady    turn  reading')
    for case in cases():
        score = judge(case)
        strikes = score.strikes
        print(
            f'{case.name:38}{len(case.truth):7}{_mark(strikes.missed, 0):>8}{_mark(strikes.false, 0):>8}'
            f'{100 * strikes.close:6.0f} %{"!" if strikes.close < STRIKES_GOAL else " "}'
            f'{1e3 * strikes.mean:+7.1f} ± {1e3 * strikes.deviation:4.1f}{1e3 * score.known_after:7.1f}'
            f'{_mark(score.steady, STEADY_GOAL, ".2f"):>8}{_mark(score.turning, TURN_GOAL, ".2f"):>8}'
            f'{1e6 * score.seconds:6.0f} µs',
            flush=True,
        )


def _mark(value: float, goal: float, form: str = '') -> str:
    return '' if math.isnan(value) else f'{value:{form}}{"!" if value > goal else ""}'


if __name__ == '__main__':
    main()

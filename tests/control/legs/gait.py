"""Recorded people, the truth about them, and copies of them as other sensors would have seen them."""

import csv
import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dcdrw_control.legs.accuracy import phase_error
from dcdrw_control.legs.csv_file import read_legs
from dcdrw_control.legs.samples import ImuReading, Leg, LegReading
from dcdrw_control.legs.walk import Walk
from tests import ROOT

DATA = ROOT / 'tests' / 'data' / 'gait'
RATE = 204.8
SIDES = ('left', 'right')
PIVOT = 3530 / RATE
"""The left foot's step on the spot, which the list of events leaves out: the turn of its stride 13 [s]."""
TURN = (3308 / RATE, 3895 / RATE)
"""From the left foot's last heel strike before the turn to the right foot's first after it [s]."""

Floats = NDArray[np.float64]
Signals = tuple[Floats, Floats, Floats]
"""Times [s], (N,); angular rates [rad/s] and accelerations [m/s²], (N, 3)."""
Change = Callable[[Signals], Signals]


@cache
def person() -> tuple[LegReading, ...]:
    """Both feet of a person who walks 20 m, turns, and walks back."""
    return tuple(read_legs(DATA / 'imu_sample.csv', RATE).readings)


def signals(side: str) -> Signals:
    mine = [reading for reading in person() if reading.leg.side == side]
    readings = [reading.reading for reading in mine]
    assert all(isinstance(reading, ImuReading) for reading in readings)
    return (
        np.array([reading.stamp_ns for reading in mine]) / 1e9,
        np.array([reading.rate for reading in readings]),
        np.array([reading.acceleration for reading in readings]),
    )


def readings(signals: Signals, side: str) -> list[LegReading]:
    seconds, rates, accelerations = signals
    return [
        LegReading(round(t * 1e9), Leg('front', side), ImuReading(tuple(rate), tuple(acceleration)))
        for t, rate, acceleration in zip(seconds.tolist(), rates.tolist(), accelerations.tolist(), strict=True)
    ]


@cache
def truth(side: str) -> Floats:
    """Heel strikes as motion capture tells them, with the pivot step of the turn [s]."""
    with (DATA / 'stride_events_sample.csv').open() as file:
        events = [event for event in csv.DictReader(file) if event['foot'] == side]
    listed = {float(event[name]) / RATE for event in events for name in ('ic', 'pre_ic')}
    return np.array(sorted(listed | ({PIVOT} if side == 'left' else set())))


def phase_rms_percent(walk: Walk, leg: Leg, truth: Floats, start: float = -math.inf, end: float = math.inf):
    """Error of the phase from the third stride on, between two times [s], root mean square [% of a stride]."""
    seconds, strides = walk.phase(leg)
    part = (seconds >= max(start, truth[3])) & (seconds <= min(end, truth[-1]))
    return 100.0 * float(np.sqrt(np.mean(phase_error(seconds[part], strides[part], truth) ** 2)))


def steady_rms_percent(walk: Walk, leg: Leg, truth: Floats, turn: tuple[float, float]) -> float:
    """The same in steady walking, before and after the turn."""
    before, after = (phase_rms_percent(walk, leg, truth, *span) for span in ((0.0, turn[0]), (turn[1], math.inf)))
    return math.sqrt(0.5 * (before**2 + after**2))

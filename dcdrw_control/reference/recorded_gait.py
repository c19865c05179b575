"""The default joint angles over a stride, from the heels of a person as motion capture saw them.

The robot's feet go as the person's heels do, seen from a hip that goes along evenly at one height, midway between the
heels on a stride's average. Thigh and shank are of one length, and the leg is stretched to 98 % where it reaches
furthest: so the knee is bent more than a person's, whose hips rise and turn. Hip and knee follow by the law of cosines,
averaged over the strides of both legs, and smoothed by a Fourier series.

    python -m dcdrw_control.reference.recorded_gait HEELS.csv EVENTS.csv > dcdrw_control/reference/gait.csv

makes the table from mocap_heels.csv and stride_events_sample.csv in tests/data/gait; a test holds it to them.
"""

import csv
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dcdrw_msgs_py.topics import SIDES
from dcdrw_msgs_py.values import Floats

LEG = 0.9
"""From the hip to the heel of a leg that is stretched [m]."""
STRETCHED = 0.98
"""Share of it that is used at most: the knee then turns smoothly."""
HEELS_RATE, EVENTS_RATE = 100.0, 204.8
"""Samples per second of the heels, and of the numbers by which events are told [Hz]."""
POINTS = 40
"""Rows of the table."""
HARMONICS = 6
USUAL = 0.1
"""A stride that takes a tenth more or less than the median, or goes less far, is left out: at start, turn and end."""


def table(heels: Path, events: Path) -> str:
    """The table as CSV: share of a stride since the heel strike, hip and knee [rad], flexion positive."""
    strides = np.array(list(_strides(heels, events)))
    hip, knee = (_smooth(curve) for curve in joint_angles(*strides.mean(axis=0)))
    rows = zip(np.arange(POINTS) / POINTS, hip, knee, strict=True)
    return 'stride,hip,knee\n' + ''.join(f'{share:g},{one:.4f},{other:.4f}\n' for share, one, other in rows)


def joint_angles(ahead: Floats, above: Floats) -> tuple[Floats, Floats]:
    """Flexion of hip and knee [rad] that brings a heel where it is.

    Args:
        ahead: of the hip [m].
        above: the ground [m].

    """
    height = float((above + np.sqrt((STRETCHED * LEG) ** 2 - ahead**2)).min())
    knee = 2.0 * np.arccos(np.hypot(ahead, height - above) / LEG)
    return np.arctan2(ahead, height - above) + 0.5 * knee, knee


def _strides(heels: Path, events: Path) -> Iterator[tuple[Floats, Floats]]:
    """Where the heel is in each usual stride: ahead of the hip, and above the ground [m], POINTS times evenly."""
    columns = np.genfromtxt(heels, delimiter=',', names=True)
    times = columns['sample'] / HEELS_RATE
    place = {side: columns[f'{side}_x'] / 1000.0 for side in SIDES}
    middle = 0.5 * (place['left'] + place['right'])
    with events.open(encoding='utf-8') as file:
        told = list(csv.DictReader(file))
    for side in SIDES:
        numbers = {float(event[name]) for event in told if event['foot'] == side for name in ('ic', 'pre_ic')}
        strikes = np.array(sorted(numbers)) / EVENTS_RATE
        lengths, seconds = np.diff(np.interp(strikes, times, place[side])), np.diff(strikes)
        usual = np.abs(seconds / np.median(seconds) - 1.0) < USUAL
        usual &= np.abs(lengths) > (1.0 - USUAL) * np.median(np.abs(lengths))
        for start, length, duration in zip(strikes[:-1][usual], lengths[usual], seconds[usual], strict=True):
            share = np.arange(POINTS) / POINTS
            when = start + share * duration
            between = np.interp(when, times, middle)
            speed = np.interp(start + duration, times, middle) - np.interp(start, times, middle)
            hip = between.mean() + speed * (share - share.mean())
            ahead = np.sign(length) * (np.interp(when, times, place[side]) - hip)
            yield ahead, np.interp(when, times, columns[f'{side}_z'] / 1000.0)


def _smooth(curve: Floats) -> Floats:
    """A periodic curve by its first harmonics."""
    spectrum = np.fft.rfft(curve)
    spectrum[HARMONICS + 1 :] = 0.0
    return np.asarray(np.fft.irfft(spectrum, len(curve)))


def main() -> int:
    """Print the table."""
    sys.stdout.write(table(*map(Path, sys.argv[1:3])))
    return 0


if __name__ == '__main__':
    sys.exit(main())

"""Readings of the sensors on the legs from a CSV file, as laboratories keep them."""

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from difflib import get_close_matches
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dcdrw_control.legs.samples import (
    ContactReading,
    HipReading,
    ImuReading,
    Leg,
    LegReading,
    Reading,
    WrenchReading,
)
from dcdrw_msgs_py.columns import check_pace, heading, number, size
from dcdrw_msgs_py.rig import FRONT
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.text_file import one_line, read_rows
from dcdrw_msgs_py.topics import SIDES
from dcdrw_msgs_py.values import Floats
from dcdrw_msgs_py.words import counted

FASTEST = 35.0
"""No leg turns faster [rad/s], and gyroscopes end at 2000 degrees per second: a file with larger rates is in deg/s."""
_COLUMN = re.compile(r'(?:(front|rear)_)?(?:(left|right)_)?(acc_[xyz]|gyr_[xyz]|contact|force|hip|hip_rate)')
_UNITS = {'acc': 'm/s²', 'gyr': 'rad/s', 'force': 'N', 'hip': 'rad', 'hip_rate': 'rad/s'}
"""Of quantities, where the heading names none."""
_WORDS = ('front', 'rear', 'left', 'right', 'acc', 'gyr', 'contact', 'force', 'hip', 'rate', 'x', 'y', 'z')
"""Words of columns' names, in the order in which they stand there."""
LATEST = 9e9
"""A later time is none that a stamp can tell [s]."""
_TIMES = {'time': 's', 'time_s': 's', 'stamp_ns': 'ns'}
"""Units, where the heading names none."""


class LegTable(NamedTuple):
    """What a file holds."""

    readings: list[LegReading]
    """The readings in the order of time."""
    rate: float
    """Samples per second [Hz]."""
    degrees: bool
    """Whether its angular rates, whose unit it does not name, are taken to be in degrees per second."""


def read_legs(path: Path, rate: float = math.nan) -> LegTable:
    """Read a CSV file.

    The columns are named, in one row or in two (sensor, axis): a first column `time` [s], `stamp_ns` or the sample's
    number, then for each leg `left_acc_x`, …, `left_gyr_z`, `left_contact` (0 or 1), `left_force` [N], `left_hip`
    [rad] or `left_hip_rate` [rad/s], with `front_` or `rear_` before it where there are two halves, and without the
    side where there is one leg. A unit in brackets behind a name counts. Columns of other names are passed over, but
    for one that is misspelt. A file of two columns without names is the time [s] and the left foot's vertical force
    [N].

    Args:
        path: the file.
        rate: samples per second [Hz], in the place of the file's own times.

    Raises:
        ValueError: there is no column that is known, a value is not a number, or the time is unknown or does not grow.
        OSError: the file cannot be read.

    """
    headings, table = _read(path)
    names = [name for name, _ in headings]
    seconds = _seconds(path, *headings[0], table[:, 0], rate)
    stamps = np.round(seconds * SECOND).astype(np.int64).tolist()
    columns: dict[Leg, dict[str, Floats]] = defaultdict(dict)
    turning: list[Floats] = []
    for (name, unit), column in zip(headings, table.T, strict=True):
        found = _COLUMN.fullmatch(name)
        if not found:
            if (meant := _meant(name)) and meant not in names:
                raise ValueError(f'{path}: the column {one_line(name)} is none that is known; did you mean {meant}?')
            continue
        if np.isnan(column).all():
            raise ValueError(f'{path}: the column {name} has no number: leave it out')
        columns[Leg(found[1] or FRONT, found[2] or SIDES[0])][found[3]] = column
        if unit and (wanted := _UNITS.get(re.sub('_[xyz]$', '', found[3]))):
            column *= size(path, name, unit, wanted)
        elif found[3][:3] == 'gyr':
            turning.append(column)
    degrees = any((np.abs(column) > FASTEST).any() for column in turning)
    for column in turning if degrees else ():
        column *= math.radians(1.0)
    parts = [
        [LegReading(stamp, leg, reading) for stamp, reading in zip(stamps, made, strict=True) if reading]
        for leg, quantities in columns.items()
        for made in _readings(path, leg, quantities)
    ]
    if not parts:
        raise ValueError(
            f'{path} has no column of a leg, as left_gyr_x, left_force or left_contact: {", ".join(names)}'
        )
    if math.isnan(rate):
        check_pace(path, seconds)
    readings = sorted(chain.from_iterable(parts), key=lambda reading: reading.stamp_ns)
    return LegTable(readings, (len(seconds) - 1) / float(seconds[-1] - seconds[0]), degrees)


def _meant(name: str) -> str:
    """The column that a name means, but for the spelling and order of its words; empty where it means another thing."""
    near = [get_close_matches(word, _WORDS, n=1, cutoff=0.75) for word in re.split(r'[^a-z0-9]+', name)]
    meant = '_'.join(sorted((words[0] for words in near if words), key=_WORDS.index))
    return meant if all(near) and _COLUMN.fullmatch(meant) else ''


def _read(path: Path) -> tuple[list[tuple[str, str]], Floats]:
    """Names of columns with units, and numbers."""
    lines = list(read_rows(path))
    rows = [row for _, row in lines]
    heads = [row for row in rows[:2] if not any(map(_is_number, row))]
    if len(heads) == 2:
        headings = [(f'{sensor.removesuffix("_sensor")}_{axis}', '') for sensor, axis in zip(*heads, strict=False)]
        headings[0] = 'sample', ''
    elif heads:
        headings = [heading(text) for text in heads[0]]
    elif rows and len(rows[0]) == 2:
        headings = [('time', ''), ('left_force', '')]
    else:
        raise ValueError(f'{path} names no columns: its first row should be time,left_gyr_x,…')
    names = [name for name, _ in headings]
    twice = next((name for place, name in enumerate(names) if name in names[:place]), None)
    if twice is not None:
        raise ValueError(f'{path} has two columns {twice}')
    table: list[list[float]] = []
    for line, row in lines[len(heads) :]:
        if len(row) != len(names):
            raise ValueError(f'{path}, line {line}: {counted(len(row), "cell")}, not {len(names)} as in the first row')
        try:
            table.append([number(cell) for cell in row])
        except ValueError as error:
            raise ValueError(f'{path}, line {line}: {error}') from None
    if len(table) < 2:
        raise ValueError(f'{path}: every row should have {len(names)} numbers, and there should be some')
    return headings, np.array(table)


def _seconds(path: Path, name: str, unit: str, first: Floats, rate: float) -> Floats:
    if not math.isnan(rate):
        seconds = np.arange(len(first)) / rate
    elif name in _TIMES:
        seconds = first * size(path, name, unit or _TIMES[name], 's')
    else:
        raise ValueError(f'{path} has no column time or stamp_ns: tell how many samples a second it has (--rate)')
    if not (np.abs(seconds) < LATEST).all():
        raise ValueError(f'{path}: a time in column {name} is none, or beyond {LATEST:g} s')
    if not (np.diff(seconds) > 0.0).all():
        raise ValueError(f'{path}: the time in column {name} must grow from row to row')
    return seconds


def _readings(path: Path, leg: Leg, quantities: dict[str, Floats]) -> Iterator[Sequence[Reading | None]]:
    """The readings of each sensor of a leg; None where a contact is unknown."""
    if any(name[:3] in ('gyr', 'acc') for name in quantities):
        missing = [name for kind in ('gyr', 'acc') for name in (f'{kind}_{axis}' for axis in 'xyz')]
        missing = [name for name in missing if name not in quantities]
        if missing:
            raise ValueError(f'{path}: the {leg.side} leg has no column {leg.side}_{missing[0]}')
        turning, pulling = (
            np.stack([quantities[f'{kind}_{axis}'] for axis in 'xyz'], axis=1) for kind in ('gyr', 'acc')
        )
        yield [ImuReading(tuple(r), tuple(a)) for r, a in zip(turning.tolist(), pulling.tolist(), strict=True)]
    if 'contact' in quantities:
        contacts = quantities['contact'].tolist()
        yield [None if math.isnan(contact) else ContactReading(contact > 0.5) for contact in contacts]
    if 'force' in quantities:
        yield _each(WrenchReading, quantities['force'])
    if 'hip' in quantities:
        yield _each(
            HipReading, quantities['hip'], quantities.get('hip_rate', np.full(len(quantities['hip']), math.nan))
        )


def _each(make: Callable[..., Reading], *columns: Floats) -> list[Reading]:
    return [make(*row) for row in zip(*(column.tolist() for column in columns), strict=True)]


def _is_number(cell: str) -> bool:
    try:
        number(cell)
    except ValueError:
        return False
    return bool(cell.strip())

"""Columns of strangers' tables: names, units and numbers, as they stand in headings and cells."""

import math
import re
from pathlib import Path

import numpy as np

from dcdrw_msgs_py.values import Floats

_HEADING = re.compile(r'\s*(.*?)\s*(?:[\[(]\s*(.*?)\s*[\])]\s*)?')
_DEGREE = math.radians(1.0)
SIZES = {
    's': {'s': 1.0, 'sec': 1.0, 'ms': 1e-3, 'us': 1e-6, 'µs': 1e-6, 'μs': 1e-6, 'ns': 1e-9},
    'rad': {'rad': 1.0, 'deg': _DEGREE, '°': _DEGREE},
    'rad/s': {'rad/s': 1.0, 'deg/s': _DEGREE, '°/s': _DEGREE, 'dps': _DEGREE},
    'm/s²': {'m/s²': 1.0, 'm/s^2': 1.0, 'm/s2': 1.0, 'm/s/s': 1.0, 'g': 9.80665},
    'N': {'N': 1.0, 'kN': 1e3},
}
"""Units that a heading may name, with their sizes, by the unit in SI."""
CLOSEST, WIDEST = 1e-5, 1.0
"""Samples of a moving leg or wheel come no closer than the one, and closer than the other [s]."""


def heading(text: str) -> tuple[str, str]:
    """A column's name in lower case, and the unit that stands behind it in brackets; empty where none does."""
    match = _HEADING.fullmatch(text)
    return (match[1].lower(), match[2] or '') if match else (text.strip().lower(), '')


def size(path: Path, name: str, unit: str, wanted: str) -> float:
    """The size of the unit of a file's column in the one that is wanted, of SI.

    Raises:
        ValueError: it is none of that kind; names the file and the column.

    """
    if unit not in SIZES[wanted]:
        known = ', '.join(SIZES[wanted])
        raise ValueError(f'{path}, column {name}: {unit!r} is not a unit like {wanted}; known are {known}')
    return SIZES[wanted][unit]


def number(cell: str) -> float:
    """The number in a cell, NaN where it is empty.

    Raises:
        ValueError: it is none, or infinite.

    """
    try:
        value = float(cell.strip() or 'nan')
    except ValueError:
        value = math.inf
    if math.isinf(value) or '_' in cell:
        raise ValueError(f'{cell.strip()!r} is not a number')
    return value


def check_pace(path: Path, seconds: Floats, mend: str = 'Name it then, as time [ms]') -> None:
    """Refuse times that grow as those of no leg or wheel: they are in another unit.

    Raises:
        ValueError: they do; names the file.

    """
    pace = float(np.median(np.diff(seconds))) if len(seconds) > 1 else CLOSEST
    if not CLOSEST <= pace < WIDEST:
        raise ValueError(
            f'{path}: {pace:.3g} s lie between one sample and the next: is the time in another unit? {mend}'
        )

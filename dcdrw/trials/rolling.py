"""The part of a recorded trial in which both wheels roll by themselves, as samples to identify a rig from."""

import math
from pathlib import Path

import numpy as np

from dcdrw.trials.analysis import Analysis
from dcdrw.trials.motion import MotionTable
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.text_file import read_rows
from dcdrw_sim.identification.samples import Samples, free_rolling


def rolling_samples(
    trial: Analysis, motion: MotionTable, rig: RigParams, begin: float = 0.0, end: float = math.inf
) -> Samples:
    """The samples of the last run of a trial, from one time to another, as far as both wheels roll.

    Args:
        trial: as it was analyzed.
        motion: all its samples.
        rig: whose wheels they are.
        begin: time in the trial [s].
        end: likewise.

    Raises:
        ValueError: there are too few.

    """
    if trial.resumed:
        motion = motion.rows(motion.row >= trial.resumed.row)
    if not len(motion.stamp_ns):
        raise ValueError(trial.why_not_run or 'there are no joint states')
    seconds = motion.seconds
    chosen = (motion.restarts == motion.restarts[-1]) & (seconds >= begin) & (seconds <= end)
    return free_rolling(rig, seconds[chosen], np.column_stack([motion.rotation1, motion.rotation2])[chosen])


UNITS = {'': 1.0, '_deg': math.radians(1.0)}
"""Endings of a column's name, with sizes in rad."""


def table_samples(path: Path, rig: RigParams, begin: float = 0.0, end: float = math.inf) -> Samples:
    """The same of a table of encoders: columns `time` [s] or `stamp_ns`, psi1 and psi2 [rad], or psi1_deg and psi2_deg.

    Args:
        path: of a CSV file; other columns are left alone, and empty cells are gaps.
        rig: whose wheels they are.
        begin: time from the first sample on [s].
        end: likewise.

    Raises:
        ValueError: it is no such table, or too little is left of it.
        OSError: it cannot be read.

    """
    rows = read_rows(path)
    _, heading = next(rows, (0, []))
    names = [name.strip().lower() for name in heading]
    times = [(names.index(name), size) for name, size in (('time', 1.0), ('stamp_ns', 1.0 / SECOND)) if name in names]
    wheels = [
        [(names.index(wheel + ending), size) for ending, size in UNITS.items() if wheel + ending in names]
        for wheel in ('psi1', 'psi2')
    ]
    for name in ('time', 'psi1', 'psi2'):
        if names.count(name) > 1:
            raise ValueError(f'{path} has the column {name} {names.count(name)} times')
    if not times or not all(wheels):
        raise ValueError(f'{path} must have columns time, psi1, psi2 (or stamp_ns, psi1_deg, psi2_deg), got {names}')
    columns = (times[0], *(found[0] for found in wheels))
    table = np.array([[_number(path, line, row, place) for place, _ in columns] for line, row in rows])
    if not len(table):
        raise ValueError(f'{path} has no samples')
    seconds, *psi = (table * [size for _, size in columns]).T
    seconds = seconds - seconds[0]
    if not (np.diff(seconds) > 0.0).all():
        raise ValueError(f'{path}, line {int(np.argmin(np.diff(seconds) > 0.0)) + 3}: time must go on from row to row')
    chosen = (seconds >= begin) & (seconds <= end)
    return free_rolling(rig, seconds[chosen], np.column_stack(psi)[chosen])


def _number(path: Path, line: int, row: list[str], place: int) -> float:
    cell = row[place].strip() if place < len(row) else ''
    try:
        number = float(cell or 'nan')
    except ValueError:
        number = math.inf
    if math.isinf(number) or '_' in cell:
        raise ValueError(f'{path}, line {line}: {cell!r} is not a number')
    return number

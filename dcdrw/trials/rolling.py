"""The part of a recorded trial in which both wheels roll by themselves, as samples to identify a rig from."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.ndimage import median_filter

from dcdrw.trials.analysis import Analysis
from dcdrw.trials.motion import MotionTable
from dcdrw_msgs_py.columns import check_pace, heading, number, size
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.text_file import read_rows
from dcdrw_sim.identification.samples import Samples, free_rolling
from dcdrw_tracker.gait.phase import PhaseParams


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


WHEELS = 'psi1', 'psi2'
TIMES = {'time': 's', 'stamp_ns': 'ns'}
TURNS = {'': 'rad', '_deg': 'deg'}
"""Columns of time, and endings of those of a wheel, with their units where the heading names none."""


def table_samples(path: Path, rig: RigParams, begin: float = 0.0, end: float = math.inf) -> Samples:
    """The same of a table of encoders: columns `time` [s] or `stamp_ns`, psi1 and psi2 [rad], or psi1_deg and psi2_deg.

    Args:
        path: of a CSV file; other columns are left alone, empty cells are gaps, and a unit in brackets behind a
            column's name counts.
        rig: whose wheels they are.
        begin: time from the first sample on [s].
        end: likewise.

    Raises:
        ValueError: it is no such table, or too little is left of it.
        OSError: it cannot be read.

    """
    rows = read_rows(path)
    _, first = next(rows, (0, []))
    headings = [heading(text) for text in first]
    columns = [
        _column(path, headings, TIMES, 's'),
        *(_column(path, headings, {wheel + ending: unit for ending, unit in TURNS.items()}, 'rad') for wheel in WHEELS),
    ]
    table: list[list[float]] = []
    last = -math.inf
    for line, row in rows:
        try:
            table.append([number(row[place] if place < len(row) else '') * size for place, size in columns])
        except ValueError as error:
            raise ValueError(f'{path}, line {line}: {error}') from None
        if not table[-1][0] > last:
            raise ValueError(f'{path}, line {line}: time must go on from row to row')
        last = table[-1][0]
    if not table:
        raise ValueError(f'{path} has no samples')
    seconds, *psi = np.array(table).T
    check_pace(path, seconds)
    seconds = seconds - seconds[0]
    rotations, fastest = np.column_stack(psi), PhaseParams().max_speed
    for name, turns in zip(WHEELS, psi, strict=True):
        seen = np.isfinite(turns)
        passed, turned = np.diff(seconds[seen]), np.diff(median_filter(turns[seen], 5, mode='mirror'))  # none is wild
        speed = float(np.median(np.abs(turned) / passed)) if turned.size else 0.0
        if speed > fastest:
            raise ValueError(
                f'{path}: no wheel rolls at {speed:.3g} rad/s: are psi1 and psi2 in degrees? Then name them '
                'psi1_deg and psi2_deg'
            )
        if np.round(turned[passed < math.pi / fastest] / math.tau).sum():
            raise ValueError(
                f'{path}: {name} jumps by whole turns, as an encoder that begins anew with each: unwrap it'
            )
    chosen = (seconds >= begin) & (seconds <= end)
    try:
        return free_rolling(rig, seconds[chosen], rotations[chosen])
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from None


def _column(
    path: Path, headings: Sequence[tuple[str, str]], names: Mapping[str, str], wanted: str
) -> tuple[int, float]:
    """Where the one column of several names is, and the size of its unit."""
    found = [(place, name, unit) for place, (name, unit) in enumerate(headings) if name in names]
    if not found:
        raise ValueError(
            f'{path} must have columns time, psi1, psi2 (or stamp_ns, psi1_deg, psi2_deg), got '
            f'{[name for name, _ in headings]}'
        )
    if len(found) > 1:
        raise ValueError(f'{path} has the columns {" and ".join(name for _, name, _ in found)}: leave one')
    ((place, name, unit),) = found
    return place, size(path, name, unit or names[name], wanted)

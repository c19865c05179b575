"""The joint angles of a leg over a stride, from a table."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dcdrw_msgs_py.text_file import read_rows
from dcdrw_msgs_py.values import Floats

DEFAULT = Path(__file__).with_name('gait.csv')
"""Hip and knee of a recorded person: see `recorded_gait`."""
FEWEST_ROWS = 4
STRIDE = 'stride'


class JointTable:
    """Periodic cubic splines through the rows of a table."""

    def __init__(self, names: tuple[str, ...], strides: ArrayLike, angles: ArrayLike) -> None:
        """Take the rows.

        Args:
            names: of the joints, (J,).
            strides: shares of a stride since the heel strike, growing within [0, 1), (N,).
            angles: [rad], (N, J).

        """
        from scipy.interpolate import CubicSpline  # twice a node's start-up, and of no use to the others

        strides, angles = np.asarray(strides, float), np.asarray(angles, float)
        self.names = names
        self._angles: Any = CubicSpline(
            np.append(strides, strides[0] + 1.0), np.vstack([angles, angles[:1]]), bc_type='periodic'
        )
        self._slopes = self._angles.derivative()

    def angles(self, strides: ArrayLike) -> Floats:
        """The joints at phases in strides, (…, J) [rad]."""
        return np.asarray(self._angles(strides))

    def slopes(self, strides: ArrayLike) -> Floats:
        """How fast they change, (…, J) [rad per stride]."""
        return np.asarray(self._slopes(strides))


def read_joint_table(path: Path) -> JointTable:
    """Read a table: a column `stride`, the share of a stride since the heel strike, and a column for each joint [rad].

    Raises:
        ValueError: there is no such column, no joint, or too few rows; a value is no number; strides do not grow within
            [0, 1).
        OSError: the file cannot be read.

    """
    rows = list(read_rows(path))
    names = [name.strip() for name in rows[0][1]] if rows else []
    if len(names) < 2 or names[0] != STRIDE or len(set(names)) < len(names):
        raise ValueError(f'{path}: the first row should be {STRIDE},hip,knee or the like, each name its own')
    values = []
    for line, row in rows[1:]:
        try:
            numbers = [float(cell) for cell in row]
        except ValueError as error:
            raise ValueError(f'{path}, line {line}: {error}') from None
        if len(numbers) != len(names) or not np.isfinite(numbers).all():
            raise ValueError(f'{path}, line {line}: there should be {len(names)} finite numbers')
        values.append(numbers)
    if len(values) < FEWEST_ROWS:
        raise ValueError(f'{path} should have at least {FEWEST_ROWS} rows of numbers, got {len(values)}')
    strides, angles = np.array(values)[:, 0], np.array(values)[:, 1:]
    if strides[0] < 0.0 or strides[-1] >= 1.0 or not (np.diff(strides) > 0.0).all():
        raise ValueError(f'{path}: the column {STRIDE} should grow from 0 to less than 1')
    return JointTable(tuple(names[1:]), strides, angles)

"""A sweep: a rig judged over any two of its parameters, from several starts at each point.

Points are computed in blocks, each by itself: the result of a point depends neither on its block nor on the others.
"""

import json
import math
from difflib import get_close_matches
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.in_step import BAND_PERCENT
from dcdrw_msgs_py.quantity import build, flatten
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams, WheelParams
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.map.regression import TRIAL_PHASES
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.rigs import Rigs
from dcdrw_sim.model.scaling import nondimensional
from dcdrw_sim.motion.compiled import AVAILABLE
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.study.points import judge_points, section_room
from dcdrw_sim.study.verdict import BAND

Block = tuple[slice, slice]
"""Some points: which along x, which along y."""

POINTS = 50
"""Along each axis."""
RANGES = {'k': (1e-4, 1e-2), 'b': (1e-1, 1e1)}
"""The paper's, without dimensions."""
TIME = 200.0
"""How long to simulate, in √(ℓ/g): the paper's."""
BLOCK_WORK = 200_000.0 if AVAILABLE else 1000.0
"""Time units of all motions of a block: some tenths of a second on one core, and memory that stays in reach."""
_OF_COUPLER = {'k', 'b', 'D0', 'S0'}


class Axis(NamedTuple):
    """A parameter that varies.

    It is a parameter of a rig by its (dotted) name; `mass`, `length` or `spokes` of both wheels; or `slope_deg`.
    """

    name: str
    values: tuple[float, ...]

    @classmethod
    def parse(cls, text: str) -> 'Axis':
        """An axis from NAME:LOW:HIGH:COUNT, evenly spaced, or with :log behind it, evenly in the logarithm.

        Raises:
            ValueError: another form, an unknown parameter, or a range that cannot be.

        """
        name, *parts = text.split(':')
        spacing = parts.pop() if parts and parts[-1] in ('lin', 'log') else 'lin'
        try:
            low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
        except (ValueError, IndexError):
            count = 0
        if len(parts) != 3 or count < 1 or not (math.isfinite(low) and math.isfinite(high)):
            raise ValueError(f'an axis is NAME:LOW:HIGH:COUNT or NAME:LOW:HIGH:COUNT:log, got {text!r}')
        if spacing == 'log' and not min(low, high) > 0.0:
            raise ValueError(f'a logarithmic axis needs LOW and HIGH > 0, got {text!r}')
        values = (np.geomspace if spacing == 'log' else np.linspace)(low, high, count)
        targets(name)
        return cls(name, tuple(values.tolist()))


class Sweep(NamedTuple):
    """Everything that a sweep's result depends on."""

    rig: RigParams
    """What all points share."""
    x: Axis
    y: Axis
    seconds: float
    """How long to simulate."""
    phases: tuple[float, ...] = TRIAL_PHASES
    """Starts, in steps: as `ReturnMap.at_phase`."""
    band_percent: float = BAND_PERCENT
    """In step is within ± this [% of a step]."""
    theta2_band: float = BAND
    """The paper's condition: |θ2| at the section is to be within this [rad]."""
    trajectories: bool = True
    """Whether to keep all states at the section."""

    @property
    def shape(self) -> tuple[int, int]:
        """Number of points along x and y."""
        return len(self.x.values), len(self.y.values)

    def rig_at(self, i: int, j: int) -> RigParams:
        """The rig of point [i, j], as its parameters are given: derived defaults are left."""
        values = {name: float(value[0]) for name, value in _columns(self, (slice(i, i + 1), slice(j, j + 1))).items()}
        return build(RigParams, flatten(self.rig) | values)

    def to_json(self) -> str:
        """Everything exactly, as text."""
        return json.dumps(self._asdict() | {'rig': flatten(self.rig), 'x': self.x._asdict(), 'y': self.y._asdict()})

    @classmethod
    def from_json(cls, text: str) -> 'Sweep':
        """The inverse of `to_json`."""
        values = json.loads(text)
        axes = {name: Axis(values[name]['name'], tuple(values[name]['values'])) for name in ('x', 'y')}
        return cls(**values | axes | {'rig': build(RigParams, values['rig']), 'phases': tuple(values['phases'])})


def papers_sweep() -> Sweep:
    """The paper's: k̂ and b̂ on 50 × 50 logarithmic steps, nine starts, 200 time units, γ = 1.75°."""
    rig = preset('paper-sweep')
    return Sweep(rig, default_axis('k', rig), default_axis('b', rig), default_seconds(rig))


def default_axis(name: str, rig: RigParams) -> Axis:
    """The paper's range of k or b, in the units of a rig."""
    scales = nondimensional(rig)[1]
    unit = {'k': scales.stiffness, 'b': scales.damping}[name]
    low, high = RANGES[name]
    return Axis(name, tuple((unit * np.geomspace(low, high, POINTS)).tolist()))


def default_seconds(rig: RigParams) -> float:
    """TIME in the units of a rig [s]."""
    return TIME * nondimensional(rig)[1].time


def targets(name: str) -> tuple[tuple[str, ...], float]:
    """The parameters of a rig that an axis sets, and the factor from its unit to theirs.

    Raises:
        ValueError: no parameter has this name.

    """
    known: dict[str, tuple[tuple[str, ...], float]] = {one: ((one,), 1.0) for one in flatten(RigParams())}
    known |= {part: ((f'{FRONT}.{part}', f'{REAR}.{part}'), 1.0) for part in WheelParams._fields}
    known['slope_deg'] = (('slope',), math.radians(1.0))
    if name not in known:
        near = get_close_matches(name, known, n=1)
        raise ValueError(
            f'{name!r} is not a parameter of a rig; '
            + (f'did you mean {near[0]}?' if near else f'there are {", ".join(known)}')
        )
    return known[name]


def check_sweep(sweep: Sweep) -> None:
    """Make sure that every point can be computed.

    Raises:
        ValueError: one cannot, or the sweep makes no sense: the message says where and why.

    """
    for name in ('seconds', 'theta2_band'):
        if not 0.0 < getattr(sweep, name) < math.inf:
            raise ValueError(f'{name} must be > 0 and finite, got {getattr(sweep, name)}')
    if not 0.0 < sweep.band_percent < 50.0:
        raise ValueError(f'band_percent must be > 0 and < 50, got {sweep.band_percent}')
    if not sweep.phases or not all(0.0 <= phase < 1.0 for phase in sweep.phases):
        raise ValueError(f'phases must be in [0, 1), at least one, got {sweep.phases}')
    if both := set(targets(sweep.x.name)[0]) & set(targets(sweep.y.name)[0]):
        raise ValueError(f'both axes set {", ".join(sorted(both))}: {sweep.x.name} and {sweep.y.name}')
    for axis in (sweep.x, sweep.y):
        if not axis.values or not np.isfinite(axis.values).all():
            raise ValueError(f'{axis.name} must have values, all finite, got {axis.values}')
        if len(set(axis.values)) < len(axis.values):
            raise ValueError(f'{axis.name} has a value twice')
    # Every bound is met everywhere where it is met at the corners.
    rigs_of(sweep._replace(x=_ends(sweep.x), y=_ends(sweep.y)), (slice(0, 2), slice(0, 2)))
    room(sweep)


@lru_cache(maxsize=8)
def room(sweep: Sweep) -> int:
    """`section_room` of all points, row by row; what concerns the coupler alone is passed over."""
    x, y = (
        axis if set(targets(axis.name)[0]) - _OF_COUPLER else axis._replace(values=axis.values[:1])
        for axis in (sweep.x, sweep.y)
    )
    some = sweep._replace(x=x, y=y)
    return max(
        section_room(rigs_of(some, (slice(i, i + 1), slice(0, len(y.values)))), sweep.seconds)
        for i in range(len(x.values))
    )


def blocks(sweep: Sweep, size: int) -> list[Block]:
    """All points in blocks of at most `size`: whole rows, or parts of one."""
    along_x, along_y = sweep.shape
    rows, width = max(1, size // along_y), min(size, along_y)
    return [
        (slice(i, min(i + rows, along_x)), slice(j, min(j + width, along_y)))
        for i in range(0, along_x, rows)
        for j in range(0, along_y, width)
    ]


def block_size(sweep: Sweep) -> int:
    """Points of a block that takes a fraction of a second."""
    units = sweep.seconds / nondimensional(sweep.rig)[1].time
    return max(1, round(BLOCK_WORK / (len(sweep.phases) * units)))


def rigs_of(sweep: Sweep, block: Block) -> Rigs:
    """The rigs of the points of a block, y running fastest."""
    count = math.prod(part.stop - part.start for part in block)
    return spread(sweep.rig, count, _columns(sweep, block))


def compute(sweep: Sweep, block: Block) -> dict[str, NDArray[Any]]:
    """All variables (`dcdrw_sim.study.sweep_dataset`) of the points of a block, each of shape (X, Y, ...)."""
    shape = tuple(part.stop - part.start for part in block)
    variables = judge_points(
        rigs_of(sweep, block), sweep.seconds, sweep.phases, sweep.band_percent, sweep.theta2_band, room(sweep)
    )
    return {
        name: value.reshape(*shape, *value.shape[1:])
        for name, value in variables.items()
        if sweep.trajectories or not name.startswith('section_')
    }


def _columns(sweep: Sweep, block: Block) -> dict[str, Floats]:
    """The parameters that differ, at every point of a block, shape (N,)."""
    x, y = np.meshgrid(sweep.x.values[block[0]], sweep.y.values[block[1]], indexing='ij')
    return {
        name: factor * grid.ravel()
        for axis, grid in ((sweep.x, x), (sweep.y, y))
        for names, factor in (targets(axis.name),)
        for name in names
    }


def _ends(axis: Axis) -> Axis:
    return axis._replace(values=(min(axis.values), max(axis.values)))

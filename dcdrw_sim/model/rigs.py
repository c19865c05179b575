"""The rigs of N pairs in one: every parameter of a `RigParams` as an array of shape (N,), by its name."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.quantity import fields
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams, WheelParams
from dcdrw_msgs_py.rolling import step_length
from dcdrw_msgs_py.values import Floats

FIELDS = tuple(fields(RigParams))
Choice = NDArray[np.intp] | NDArray[np.bool_] | slice
"""Some of N pairs."""


class Wheels(NamedTuple):
    """The front or the rear wheels of N pairs, each column of shape (N,): as `WheelParams`."""

    length: Floats
    mass: Floats
    spokes: Floats
    gyration: Floats
    restitution: Floats

    @property
    def alpha(self) -> Floats:
        """Half the angles between two spokes, α [rad]."""
        return math.pi / self.spokes

    @property
    def step_length(self) -> Floats:
        """Distances between two footholds, σ [m]."""
        return step_length(self.length, self.alpha)


class Rigs(NamedTuple):
    """N rigs, derived defaults filled in, each column of shape (N,): as `RigParams`."""

    front: Wheels
    rear: Wheels
    k: Floats
    b: Floats
    D0: Floats
    S0: Floats
    slope: Floats
    gravity: Floats
    coupler_friction: Floats
    rolling_resistance: Floats
    friction_speed: Floats

    def with_column(self, name: str, values: Floats) -> 'Rigs':
        """The same rigs but for one parameter of the coupler or the slope."""
        return self._replace(**{name: values})  # type: ignore[arg-type]  # no wheel goes by that name


for _declared, _known in ((WheelParams, Wheels), (RigParams, Rigs)):
    if _strange := set(_declared._fields) ^ set(_known._fields):
        raise TypeError(
            f'{_declared.__name__} declares, or lacks, {", ".join(sorted(_strange))}, which no equation knows: '
            f'name it in {_known.__name__} ({__name__}), and use it in model, motion and map'
        )


def take(rigs: Rigs, which: Choice) -> Rigs:
    """Some of the rigs of `spread`, by an array of indices or a mask."""
    return rigs._replace(
        **{name: column[which] for name, column in rigs._asdict().items() if name not in (FRONT, REAR)},
        front=Wheels(*(column[which] for column in rigs.front)),
        rear=Wheels(*(column[which] for column in rigs.rear)),
    )


def rig_at(rigs: Rigs, index: int) -> RigParams:
    """One of the rigs of `spread`."""
    values = {name: float(column[index]) for name, column in rigs._asdict().items() if name not in (FRONT, REAR)}
    front, rear = (
        WheelParams(**{name: float(column[index]) for name, column in wheel._asdict().items()})
        for wheel in (rigs.front, rigs.rear)
    )
    return RigParams(front=front, rear=rear, **values)

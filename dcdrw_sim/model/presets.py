"""Rigs by name."""

import math
from typing import NamedTuple

from dcdrw_msgs_py.rig import RigParams, WheelParams


class Preset(NamedTuple):
    """A rig, and where it comes from."""

    doc: str
    rig: RigParams


_UNIT_WHEEL = WheelParams(length=1.0, mass=1.0)

PRESETS = {
    'paper': Preset("the paper's experiment: two wheels of 12 spokes on 2°, 5.25 N/m, 100 N·s/m", RigParams()),
    'paper-sweep': Preset(
        "the paper's sweep, without dimensions: m = ℓ = g = 1 on 1.75°, k̂ = 0.005, b̂ = 0.15",
        RigParams(_UNIT_WHEEL, _UNIT_WHEEL, k=5e-3, b=0.15, slope=math.radians(1.75), gravity=1.0),
    ),
}


def preset(name: str) -> RigParams:
    """The rig of a preset.

    Raises:
        ValueError: no preset has this name; the message lists those that there are.

    """
    if name not in PRESETS:
        raise ValueError(f'no preset is named {name!r}; there are {", ".join(PRESETS)}')
    return PRESETS[name].rig

"""The nondimensional form: lengths in ℓ, masses in m and times in √(ℓ/g) of the front wheel.

It makes ℓ1 = m1 = g = 1, k̂ = k ℓ/(m g) and b̂ = (b/m) √(ℓ/g) (the paper's τ and k̂ are misprinted: errata 1, 2).
"""

import math
from collections.abc import Callable
from operator import mul, truediv
from typing import NamedTuple

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.dynamics import State


class Scales(NamedTuple):
    """The units of a nondimensional rig, and the sizes that follow from them."""

    length: float
    """ℓ [m]"""
    mass: float
    """m [kg]"""
    gravity: float
    """g [m/s²]"""

    @property
    def time(self) -> float:
        """√(ℓ/g) [s]: τ = t / time."""
        return math.sqrt(self.length / self.gravity)

    @property
    def speed(self) -> float:
        """√(g ℓ) [m/s]."""
        return self.length / self.time

    @property
    def force(self) -> float:
        """m g [N]."""
        return self.mass * self.gravity

    @property
    def energy(self) -> float:
        """m g ℓ [J]."""
        return self.force * self.length

    @property
    def stiffness(self) -> float:
        """m g/ℓ [N/m]."""
        return self.force / self.length

    @property
    def damping(self) -> float:
        """m √(g/ℓ) [N·s/m]."""
        return self.mass / self.time

    def reduce(self, state: State) -> State:
        """A state without dimensions."""
        return state._replace(omega1=state.omega1 * self.time, omega2=state.omega2 * self.time)

    def restore(self, state: State) -> State:
        """A state in SI units: the inverse of `reduce`."""
        return state._replace(omega1=state.omega1 / self.time, omega2=state.omega2 / self.time)


def nondimensional(rig: RigParams) -> tuple[RigParams, Scales]:
    """The same rig without dimensions, and the scales that lead back; derived defaults stay derived."""
    scales = Scales(rig.front.length, rig.front.mass, rig.gravity)
    return _convert(rig, scales, truediv), scales


def dimensional(rig: RigParams, scales: Scales) -> RigParams:
    """A nondimensional rig in the units of `scales`: the inverse of `nondimensional`."""
    return _convert(rig, scales, mul)


def _convert(rig: RigParams, scales: Scales, convert: Callable[[float, float], float]) -> RigParams:
    front, rear = (
        wheel._replace(length=convert(wheel.length, scales.length), mass=convert(wheel.mass, scales.mass))
        for wheel in (rig.front, rig.rear)
    )
    return rig._replace(
        front=front,
        rear=rear,
        k=convert(rig.k, scales.stiffness),
        b=convert(rig.b, scales.damping),
        D0=convert(rig.D0, scales.length),
        S0=convert(rig.S0, scales.length),
        gravity=convert(rig.gravity, scales.gravity),
        coupler_friction=convert(rig.coupler_friction, scales.force),
        friction_speed=convert(rig.friction_speed, scales.speed),
    )

"""How far a motion is followed, by both steppers: the limits of a step and of a rig, and how a run ends."""

import math
from enum import IntEnum
from typing import NamedTuple

from dcdrw_msgs_py.quantity import check
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.dynamics import State

FORWARD, NONE, BACKWARD = 1, 0, -1


class End(IntEnum):
    """Why a run ended."""

    TIME = 0
    STRIKES = 1
    STANDING = 2
    FALLEN = 3
    STALLED = 4
    HUBS_MET = 5

    @property
    def meaning(self) -> str:
        """The reason in words."""
        return _MEANINGS[self]


_MEANINGS = {
    End.TIME: 'the time asked for is over',
    End.STRIKES: 'as many strikes as asked for',
    End.STANDING: 'a wheel did not pass its apex, rocked, and stands still on two spokes',
    End.FALLEN: 'a wheel was pushed over: it passed its apex backwards and rolls uphill',
    End.STALLED: 'a wheel hangs: no strike for longer than it could balance on its apex',
    End.HUBS_MET: 'the hubs met: the coupler has no length and no direction left',
}

STANDING_SPEED = 1e-6
"""A wheel that leaves a strike slower than this, in √(g/ℓ), and is pressed on both spokes, stands."""
STALL_TIME = 50.0
"""No strike for this long, in √(ℓ/g): from rounding error alone a wheel leaves its apex in about 36."""
MIN_COUPLER_LENGTH = 1e-6
"""Coupler length, in ℓ, at which the hubs count as met."""
LONGEST_STEP = 1.0
"""Longest step, in √(ℓ/g): a series whose last terms happen to vanish looks better than it is."""
SHORTEST_STEP = 1e-9
"""Shortest step that is followed, in √(ℓ/g)."""
STIFFEST = 1e5
"""Fastest rate of the coupler that is accepted, in √(g/ℓ): the steps are about the inverse of this rate."""
LEAVING_SPEED = 1e-12
"""Speed at which a standing wheel leaves, in √(g/ℓ), so that it never falls back at the same instant."""
MANY_STEPS, LEAST_TIME = 100, 1e-6
"""So many steps take at least this long, in √(ℓ/g): strikes and releases at one instant are few."""


class MotionError(ValueError):
    """The motion cannot be followed any further."""


class HubsMetError(MotionError):
    """The coupler has no length, and so no direction."""


class Strike(NamedTuple):
    """One strike, as the reference files hold it."""

    wheel: int
    """1 the front, 2 the rear."""
    t: float
    """[s]"""
    state: State
    """Just before."""
    direction: int
    """FORWARD, or BACKWARD where the wheel rocks or rolls uphill."""


def accept(rig: RigParams) -> RigParams:
    """The rig with its derived defaults.

    Raises:
        ValueError: an impossible parameter, or a coupler too stiff to follow.

    """
    rig = check(rig).resolved()
    fastest = STIFFEST * math.sqrt(rig.gravity / rig.front.length)
    mass = 1.0 / (1.0 / rig.front.mass + 1.0 / rig.rear.mass)
    rub, roll = (value / rig.friction_speed for value in (rig.coupler_friction, rig.rolling_resistance))
    for name, value, most in (
        ('k', rig.k, mass * fastest**2),
        ('b', rig.b, mass * fastest),
        ('coupler_friction / friction_speed', rub, mass * fastest),
        ('rolling_resistance / friction_speed', roll, fastest / rig.gravity),
    ):
        if value > most:
            raise ValueError(
                f'{name} must be ≤ {most:.3g} with these wheels, got {value:g}: a stiffer coupler is a '
                'rod, whose motion takes too many steps to follow'
            )
    return rig

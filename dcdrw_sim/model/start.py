"""Starts: rig and state together, with both wheels on their uncoupled limit cycles, a given phase apart."""

import math
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike

from dcdrw_msgs_py.quantity import check
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams, WheelParams
from dcdrw_msgs_py.values import Floats, Real
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.wheel import gentlest_slope, limit_cycle_speed


class Start(NamedTuple):
    """All that a motion follows from: ``run(*start)``."""

    rig: RigParams
    """Derived defaults filled in; its S0 is the distance of the stance feet at this start."""
    state: State


def start(rig: RigParams, phase: float) -> Start:
    """The front wheel just after a strike, the rear one where the phase difference is `phase`.

    Each has the speed of its uncoupled limit cycle there (contract §1): θ1 = −α1, θ2 = α2 (1 − 2 p0). The strike has
    put the front foot one step further: the feet of this start are S0 + σ1 apart.

    Args:
        rig: the rig.
        phase: p0 in [0, 1); 0.5 is the goal.

    Raises:
        ValueError: p0 out of range, an impossible rig, or as `require_rolling`.

    """
    if not 0.0 <= phase < 1.0:
        raise ValueError(f'phase must be in [0, 1), got {phase}')
    rig = check(rig).resolved()
    require_rolling(rig)
    theta1, theta2 = -rig.front.alpha, rig.rear.alpha * (1.0 - 2.0 * phase)
    state = State(
        theta1,
        uncoupled_speed(rig, rig.front, theta1),
        theta2,
        uncoupled_speed(rig, rig.rear, theta2),
    )
    return Start(rig._replace(S0=rig.S0 + rig.front.step_length), state)


def starts(rig: RigParams, phases: ArrayLike, speeds: ArrayLike = 1.0) -> Floats:
    """States at the section, of the rig as it is: the front wheel about to strike, the feet S0 apart; shape (..., 4).

    Args:
        rig: the rig, on a slope on which its wheels roll by themselves.
        phases: p in [0, 1), in steps: θ2 = α2 (1 − 2 p).
        speeds: of both wheels, as fractions of those of their uncoupled limit cycles; broadcast against the phases.

    Raises:
        ValueError: as `require_rolling`.

    """
    require_rolling(rig)
    front, rear = rig.front, rig.rear
    phase, speed = np.broadcast_arrays(np.asarray(phases, float), np.asarray(speeds, float))
    theta2 = rear.alpha * (1.0 - 2.0 * phase)
    omega1, omega2 = uncoupled_speed(rig, front, front.alpha), uncoupled_speed(rig, rear, theta2)
    return np.stack([np.full_like(theta2, front.alpha), omega1 * speed, theta2, omega2 * speed], axis=-1)


@overload
def uncoupled_speed(rig: RigParams, wheel: WheelParams, theta: float) -> float: ...
@overload
def uncoupled_speed(rig: RigParams, wheel: WheelParams, theta: Floats) -> Floats: ...
def uncoupled_speed(rig: RigParams, wheel: WheelParams, theta: Real) -> Real:
    """Speed of one of the rig's wheels on its own limit cycle at an angle θ [rad/s]: `limit_cycle_speed`."""
    return limit_cycle_speed(wheel, rig.slope, rig.gravity, theta, rig.rolling_resistance)


def require_rolling(rig: RigParams) -> None:
    """Refuse a rig whose wheels do not roll by themselves, so that no phase tells how to start.

    Raises:
        ValueError: the slope is too gentle for a limit cycle of one of the wheels.

    """
    for name, wheel in ((FRONT, rig.front), (REAR, rig.rear)):
        least = gentlest_slope(wheel, rig.rolling_resistance)
        if not rig.slope > least:
            raise ValueError(
                f'slope {rig.slope:.6g} rad ({math.degrees(rig.slope):.4g}°) is too gentle for the {name} wheel to '
                f'roll by itself; make it steeper than {least:.6g} rad ({math.degrees(least):.4g}°), or give the '
                'angles and speeds of the start instead of a phase'
            )

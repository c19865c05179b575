"""The start of a trial: two wheels on their limit cycles, a given phase apart."""

import math

from dcdrw_msgs_py.quantity import check
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams
from dcdrw_sim.model.dynamics import State, gentlest_slope, limit_cycle_speed


def start_state(rig: RigParams, initial_phase: float) -> State:
    """The front wheel just after a strike, the rear one where the phase difference is `initial_phase`.

    Each has the speed of its uncoupled limit cycle there (contract §1): θ1 = −α1, θ2 = α2 (1 − 2 p0).

    Args:
        rig: the rig.
        initial_phase: p0 in [0, 1); 0.5 is the goal.

    Raises:
        ValueError: p0 out of range, an impossible rig, or a slope too gentle for a limit cycle.

    """
    if not 0.0 <= initial_phase < 1.0:
        raise ValueError(f'initial_phase must be in [0, 1), got {initial_phase}')
    rig = check(rig)
    for name, wheel in ((FRONT, rig.front), (REAR, rig.rear)):
        least = gentlest_slope(wheel)
        if not rig.slope > least:
            raise ValueError(
                f'slope {rig.slope:.6g} rad ({math.degrees(rig.slope):.4g}°) is too gentle for the {name} wheel to '
                f'roll by itself; make it steeper than {least:.6g} rad ({math.degrees(least):.4g}°), or give the '
                'angles and speeds of the start instead of a phase'
            )
    theta1, theta2 = -rig.front.alpha, rig.rear.alpha * (1.0 - 2.0 * initial_phase)
    return State(
        theta1,
        float(limit_cycle_speed(rig.front, rig.slope, rig.gravity)),
        theta2,
        float(limit_cycle_speed(rig.rear, rig.slope, rig.gravity, theta2)),
    )

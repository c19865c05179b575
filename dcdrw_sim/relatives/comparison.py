"""The single wheel, the rigidly coupled pair and the coupled pair, side by side on one rig's slope."""

import math
from typing import Any

from dcdrw_msgs_py.quantity import flatten
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams, WheelParams
from dcdrw_sim.map.return_map import ReturnMap
from dcdrw_sim.model.wheel import gentlest_slope, limit_cycle_speed
from dcdrw_sim.relatives import rigid_pair, rimless_wheel
from dcdrw_sim.relatives.footfall_order import order, rear_lead, steady_contacts
from dcdrw_sim.relatives.rigid_pair import NEAR_TOGETHER, RigidPair

RIGID_PAIR_PHASES = (0.0, NEAR_TOGETHER, 0.25, 0.5, 0.75)
"""At which the rigid pair is looked at."""
GAITS = (0.0, 0.25, 0.5, 0.75)
"""Phases of which the order of footfalls is told."""
BANDS = 3
"""How many of the wheel's bands of uphill speeds are told."""


def compare(rig: RigParams) -> dict[str, Any]:
    """Each model's gait on a rig's slope, in SI units and radians; None where there is no such thing.

    Args:
        rig: the rig, its derived defaults filled in.

    """
    return {
        'parameters': flatten(rig),
        'wheels': {name: _wheel(wheel, rig) for name, wheel in ((FRONT, rig.front), (REAR, rig.rear))},
        'rigid_pair': _told(_rigid_pair, rig),
        'coupled_pair': _told(_coupled_pair, rig),
        'footfalls': [
            {'phase': phase, 'order': order(steady_contacts(phase)), 'rear_lead': rear_lead(phase)} for phase in GAITS
        ],
    }


def _told(model: Any, rig: RigParams) -> dict[str, Any]:
    """What a model comes to, or why it comes to nothing."""
    try:
        found: dict[str, Any] = model(rig)
    except ValueError as error:
        return {'trouble': str(error)}
    return found


def _wheel(wheel: WheelParams, rig: RigParams) -> dict[str, Any]:
    slope, gravity = rig.slope, rig.gravity
    after = float(limit_cycle_speed(wheel, slope, gravity))
    rolls = not math.isnan(after)
    return {
        'omega_after_strike': _known(after),
        'omega_before_strike': _known(float(limit_cycle_speed(wheel, slope, gravity, wheel.alpha))),
        'period': _known(rimless_wheel.limit_cycle_period(wheel, slope, gravity)),
        'velocity': _known(rimless_wheel.limit_cycle_velocity(wheel, slope, gravity)),
        'energy_per_metre': wheel.mass * gravity * math.sin(slope) if rolls else None,
        'multiplier': rimless_wheel.multiplier(wheel),
        'gentlest_slope': gentlest_slope(wheel),
        'slope_without_standing': wheel.alpha,
        'slope_of_lift_off': rimless_wheel.steepest_slope(wheel),
        'omega_to_pass': rimless_wheel.speed_to_pass(wheel, slope, gravity, -wheel.alpha),
        'uphill_bands': rimless_wheel.uphill_bands(wheel, slope, gravity, BANDS),
    }


def _rigid_pair(rig: RigParams) -> dict[str, Any]:
    velocity = RigidPair(rig, 0.5).gait().velocity
    found: dict[str, Any] = {
        'bar': rig.D0,
        'phases': [_rigid_gait(rig, phase, velocity) for phase in RIGID_PAIR_PHASES],
    }
    if any(gait['velocity'] for gait in found['phases']):
        phase = rigid_pair.fastest_phase(rig)
        found['fastest'] = {'phase': phase, 'velocity': RigidPair(rig, phase).gait().velocity}
    return found


def _rigid_gait(rig: RigParams, phase: float, velocity: float) -> dict[str, Any]:
    pair = RigidPair(rig, phase)
    gait = pair.gait()
    rolls = not math.isnan(gait.velocity)
    slope = math.nan if math.isnan(velocity) else rigid_pair.slope_for_velocity(rig, phase, velocity)
    feet = [impulse for impact in pair.impacts() for impulse in (impact.front_foot, impact.rear_foot)] if rolls else []
    return {
        'phase': phase,
        'velocity': _known(gait.velocity),
        'period': _known(gait.period),
        'multiplier': pair.multiplier,
        'gentlest_slope': _known(rigid_pair.gentlest_slope_at_phase(rig, phase)),
        'slope_at_velocity_of_50_percent': _known(slope),
        'energy_per_metre_at_velocity_of_50_percent': _known(rigid_pair.energy_per_metre(rig._replace(slope=slope))),
        'pull': max(0.0, -min(feet) / max(feet)) if feet else None,
    }


def _coupled_pair(rig: RigParams) -> dict[str, Any]:
    return_map = ReturnMap(rig)
    fixed = return_map.fixed_point()
    return {
        'phase': float(return_map.phase(fixed.state)),
        'period': fixed.period,
        'velocity': rig.front.step_length / fixed.period,
        'stable': fixed.stable,
    }


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value

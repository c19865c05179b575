"""Gains of the law `rear` for a rig, by its own figures."""

import math

import numpy as np

from dcdrw_control.sync.rear import HubGains
from dcdrw_control.sync.safety import Limits
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.start import require_rolling, uncoupled_speed
from dcdrw_sim.model.wheel import inertia
from dcdrw_tracker.gait.sync import SyncParams

ANGLES = 33
"""Number of angles at which the free gait is told."""


def hub_gains(
    rig: RigParams,
    delay: float = 0.0,
    max_torque: float = Limits().max_torque,
    band_percent: float = SyncParams().band_percent,
) -> HubGains:
    """The whole torque at the edge of the band, critically damped: K = T / (band · 2α), C = 2 √(K I).

    Args:
        rig: the rig.
        delay: from a sample to the torque that answers it [s].
        max_torque: the largest torque [N·m].
        band_percent: in which the pair is in step [% of a step].

    Raises:
        ValueError: the rear wheel has no gait of its own on this slope.

    """
    require_rolling(rig)
    wheel = rig.rear
    stiffness = max_torque / (band_percent / 100.0 * 2.0 * wheel.alpha)
    speeds = uncoupled_speed(rig, wheel, np.linspace(-wheel.alpha, wheel.alpha, ANGLES))
    return HubGains(
        stiffness, 2.0 * math.sqrt(stiffness * inertia(wheel)), tuple(speeds.tolist()), inertia(wheel), delay
    )

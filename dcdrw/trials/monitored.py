"""What the monitor says of a simulated motion, without nodes: its own core, fed with samples of the exact motion."""

import math

import numpy as np

from dcdrw_msgs_py.rig import RigParams, WheelPitch
from dcdrw_msgs_py.samples import SECOND, PhaseSample, Turn
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.motion.trajectory import run
from dcdrw_tracker.gait.sync import SyncMonitor, SyncParams, SyncStatus

RATE = 250
"""Samples per second: more change no verdict on an exact motion (`tests/test_in_step.py`), and take their time."""


def monitored(rig: RigParams, state: State, seconds: float, params: SyncParams | None = None) -> SyncStatus:
    """The monitor's status after a motion.

    Args:
        rig: the rig; derived defaults are filled in.
        state: at the start; the front wheel just after a strike, or just before it, with the feet apart accordingly.
        seconds: how long.
        params: of the monitor, but for its wheels, which are the rig's.

    Raises:
        ValueError: as `dcdrw_sim.motion.trajectory.run`.

    """
    motion = run(rig, state, seconds)
    pitch1, pitch2 = 2.0 * rig.front.alpha, 2.0 * rig.rear.alpha
    seen = motion.at(np.arange(math.floor(RATE * motion.duration) + 1) / RATE)
    scale = rig.front.alpha + rig.rear.alpha
    phi = (seen.rotation1 / pitch1 - seen.rotation2 / pitch2) % 1.0 * scale
    rate = (seen.omega1 / pitch1 - seen.omega2 / pitch2) * scale
    n = (seen.steps1 - seen.steps2).astype(int)
    front, rear = WheelPitch(rig.front.spokes), WheelPitch(rig.rear.spokes)
    monitor = SyncMonitor((params or SyncParams())._replace(front=front, rear=rear))
    columns = (seen.theta1, seen.omega1, seen.theta2, seen.omega2, phi, rate, n)
    rows = zip(*(column.tolist() for column in columns), strict=True)
    for index, (theta1, omega1, theta2, omega2, angle, speed, difference) in enumerate(rows):
        stamp_ns = 1 + index * SECOND // RATE
        turns = Turn(theta1, omega1), Turn(theta2, omega2), Turn(angle, speed)
        monitor.update(PhaseSample(stamp_ns, *turns, difference))
    return monitor.status()

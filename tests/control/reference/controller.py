"""joint_trajectory_controller as its documentation tells: what it accepts, and what it makes the joints do.

With `interpolate_from_desired_state`, a new trajectory takes the old one's place at once: until its first point the
joints go by a cubic spline from what was desired then, and by cubic splines from point to point later. What was desired
is what was commanded last, for the next cycle, dated one cycle back: so the code has it
(joint_trajectory_controller.cpp: last_commanded_time_, and trajectory.cpp: set_point_before_trajectory_msg).
"""

import numpy as np

from dcdrw_control.reference.plan import TICK, Trajectory


class Controller:
    """Follows trajectories exactly; times in seconds."""

    def __init__(self, joints: int, period: float = 0.0) -> None:
        """Take the number of joints, and the time from cycle to cycle [s]."""
        self._period = period
        self._times = np.zeros(1)
        self._positions, self._speeds = np.zeros((1, joints)), np.zeros((1, joints))

    def accept(self, trajectory: Trajectory, now: float) -> None:
        """Take a trajectory that arrives at a time."""
        times = trajectory.first_ns / 1e9 + TICK * np.arange(len(trajectory.positions))
        assert trajectory.positions.shape == trajectory.speeds.shape
        assert np.isfinite(trajectory.positions).all()
        assert np.isfinite(trajectory.speeds).all()
        assert times[0] > now, 'what is past is not done any more'
        assert not trajectory.speeds[-1].any(), 'allow_nonzero_velocity_at_trajectory_end is false'
        position, speed = self.state(now)
        self._times = np.concatenate([[now - self._period], times])
        self._positions = np.vstack([position, trajectory.positions])
        self._speeds = np.vstack([speed, trajectory.speeds])

    def state(self, now: float) -> tuple[np.ndarray, np.ndarray]:
        """Desired positions and speeds."""
        times, positions, speeds = self._times, self._positions, self._speeds
        if now >= times[-1]:
            return positions[-1], 0.0 * speeds[-1]
        k = int(np.searchsorted(times, now, side='right')) - 1
        span = times[k + 1] - times[k]
        s = (now - times[k]) / span
        p0, p1, v0, v1 = positions[k], positions[k + 1], span * speeds[k], span * speeds[k + 1]
        a, b = 3.0 * (p1 - p0) - 2.0 * v0 - v1, 2.0 * (p0 - p1) + v0 + v1
        return p0 + s * (v0 + s * (a + s * b)), (v0 + s * (2.0 * a + 3.0 * s * b)) / span

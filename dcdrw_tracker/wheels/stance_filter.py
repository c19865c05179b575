"""The speed of one wheel from its measured rotations: a Kalman filter that knows what a strike does to it."""

import math

import numpy as np

from dcdrw_msgs_py.rig import WheelShape
from dcdrw_msgs_py.rolling import speed_kept, stance
from dcdrw_msgs_py.values import Floats

LONGEST_STEP = 0.02
"""A prediction over a longer time is made in parts [s]."""
PULL_DRIFT = 5.0
"""How the unknown part of the acceleration, the coupler's pull, wanders [rad/s² in √s]."""
PULL_JUMP = 1.0
"""And how it jumps at a strike, as the damper's force does [rad/s²]."""
STRIKE_SPREAD = 0.03
"""How far a strike may leave another speed than a point mass's, as a share of the speed."""
START_SPEED_SPREAD, START_PULL_SPREAD = 0.5, 3.0
"""What is known of speed [rad/s] and pull [rad/s²] at the start."""
HYSTERESIS = math.radians(1.0)
"""A measurement that falls back behind a strike by more than this takes the strike back [rad]."""
LEAST_SPEED = 0.02
"""Slower than this a wheel stands, rather than strikes [rad/s]."""


class StanceFilter:
    """Rotation ψ, speed ω and pull u of a wheel, where ω̇ = (g/ℓ) sin(θ + γ) + u between strikes (paper's (1)).

    At a strike the wheel keeps ω cos 2α and rolls on about the next foot (paper's (15)): the filter makes this jump
    instead of smearing it, and carries the covariance over with the exact derivative of flow and jump, so that samples
    before a strike go on telling of the speed after it.
    """

    def __init__(self, shape: WheelShape, slope: float, gravity: float, psi: float, rate: float, spread: float) -> None:
        alpha = shape.alpha
        self._stiffness = gravity / shape.length
        self._alpha, self._slope = alpha, slope
        self._kept = speed_kept(alpha)
        self._cell, _ = stance(alpha, psi)
        self._pull = 0.0
        self.psi = psi
        """ψ [rad]."""
        self.rate = rate
        """ω [rad/s]."""
        self._covariance: Floats = np.diag([spread**2, START_SPEED_SPREAD**2, START_PULL_SPREAD**2])

    def predict(self, dt: float) -> None:
        """Move on by a time [s], across strikes."""
        parts = max(math.ceil(dt / LONGEST_STEP), 1)
        for _ in range(parts):
            self._move(dt / parts)

    def correct(self, psi: float, spread: float) -> None:
        """Take a measured ψ with its standard deviation [rad]."""
        covariance = self._covariance
        gain = covariance[:, 0] / (covariance[0, 0] + spread**2)
        psi_change, rate_change, pull_change = ((psi - self.psi) * gain).tolist()
        self.psi += psi_change
        self.rate += rate_change
        self._pull += pull_change
        self._covariance = covariance - np.outer(gain, covariance[0])
        low, high = self._boundaries()
        if self.psi >= high:
            self._strike(1)
        elif self.psi < low - HYSTERESIS:
            self._strike(-1)

    def _boundaries(self) -> tuple[float, float]:
        low = (2 * self._cell - 1) * self._alpha
        return low, low + 2.0 * self._alpha

    def _acceleration(self) -> float:
        theta = self.psi - 2.0 * self._alpha * self._cell
        return self._stiffness * math.sin(theta + self._slope) + self._pull

    def _move(self, dt: float) -> None:
        """Move on within a stance; at most one strike falls into so short a time."""
        low, high = self._boundaries()
        acceleration = self._acceleration()
        ahead = self.psi + self.rate * dt + 0.5 * acceleration * dt**2
        direction = 1 if ahead >= high else -1 if ahead < low and self.rate < 0.0 else 0
        if direction and abs(self.rate) > LEAST_SPEED:
            before = min(max(((high if direction > 0 else low) - self.psi) / self.rate, 0.0), dt)
            self._flow(before)
            self._strike(direction)
            dt -= before
        self._flow(dt)

    def _flow(self, dt: float) -> None:
        acceleration = self._acceleration()
        theta = self.psi - 2.0 * self._alpha * self._cell
        growth = self._stiffness * math.cos(theta + self._slope)
        self.psi += self.rate * dt + 0.5 * acceleration * dt**2
        # The acceleration at the end of the step, for second order in the speed, too.
        self.rate += 0.5 * (acceleration + self._acceleration()) * dt
        half = 0.5 * dt**2
        step = np.array([[1.0 + growth * half, dt, half], [growth * dt, 1.0 + growth * half, dt], [0.0, 0.0, 1.0]])
        noise = PULL_DRIFT**2 * np.array(
            [[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2], [dt**3 / 6, dt**2 / 2, dt]]
        )
        self._covariance = step @ self._covariance @ step.T + noise

    def _strike(self, direction: int) -> None:
        rate, before = self.rate, self._acceleration()
        self._cell += direction
        after = self._acceleration()
        if rate * direction <= LEAST_SPEED:  # nothing hits the ground so slowly: only the stance foot is another
            return
        kept = self._kept
        self.rate = kept * rate
        # A sample that is ahead strikes earlier, and so moves on the longer at the lower speed.
        jump = np.array([[kept, 0.0, 0.0], [(after - kept * before) / rate, kept, 0.0], [0.0, 0.0, 1.0]])
        self._covariance = jump @ self._covariance @ jump.T
        self._covariance[1, 1] += (STRIKE_SPREAD * rate) ** 2
        self._covariance[2, 2] += PULL_JUMP**2

"""The law `rear`: a torque at the rear hub that keeps the robot half a step behind a person, who cannot be commanded.

A proportional-derivative law on the phase difference. Left alone, a wheel is slow at its apex and fast at its strikes,
so that at half of a step's time it is not at half of its angle. The set-point is therefore a function of the rear
wheel's angle, its own free gait stretched to the person's cadence: the law asks for no torque against a gait that is
right, and only the deviation from it costs any. What is left of the swing lies evenly about 50 %.

A delay is made up for by a predictor: the rear wheel is taken forward through the torques that are still under way,
with its weight and its strikes, the person at the pace of late.
"""

import math
from collections import deque
from typing import Annotated, NamedTuple

import numpy as np

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.samples import SECOND, PhaseSample

PREDICTION_STEP = 0.002
"""Step of the predictor [s]."""
LONGEST_DELAY = 0.2
"""[s]"""


class HubGains(NamedTuple):
    """T = stiffness · (ψ_aim − ψ2) + damping · (ψ̇_aim − ψ̇2), as it is computed for a rig."""

    stiffness: Annotated[
        float, Quantity('torque by the phase error at the rear wheel', 'N·m/rad', low=0.0, high=1e6)
    ] = 0.0
    damping: Annotated[float, Quantity('torque by its rate', 'N·m·s/rad', low=0.0, high=1e6)] = 0.0
    free_speeds: Annotated[
        tuple[float, ...],
        Quantity("the rear wheel's speeds in its free gait, evenly spaced in angle from −α to α", ''),
    ] = ()
    inertia: Annotated[float, Quantity('of the rear wheel about its foot', 'kg·m²', low=0.0, high=1e5)] = 0.0
    delay: Annotated[
        float, Quantity('from a sample to the torque that answers it', 's', low=0.0, high=LONGEST_DELAY)
    ] = 0.0

    def check_sizes(self) -> None:
        """Refuse gains that nobody computed.

        Raises:
            ValueError: no free gait, or a wheel without inertia.

        """
        if len(self.free_speeds) < 3 or min(self.free_speeds) <= 0.0 or not self.inertia > 0.0:
            raise ValueError(
                'hub.free_speeds must be at least three speeds above 0, and hub.inertia above 0: let `dcdrw control '
                '--law rear --rig RIG.yaml --out gains.yaml` compute them, and give --params-file gains.yaml'
            )


class RearLaw:
    """Turns phase samples into a torque on the rear hub."""

    _last: PhaseSample | None
    _pace: float
    _acting: deque[tuple[float, float]]

    def __init__(self, gains: HubGains, alpha1: float, alpha2: float) -> None:
        from scipy.integrate import cumulative_trapezoid, trapezoid  # twice a node's start-up, and seldom needed

        self._gains, self._alpha1, self._alpha2 = gains, alpha1, alpha2
        speeds = np.array(gains.free_speeds)
        angles = np.linspace(-alpha2, alpha2, len(speeds))
        times = cumulative_trapezoid(1.0 / speeds, angles, initial=0.0)
        self._period = float(times[-1])
        ahead = times / self._period - (angles + alpha2) / (2.0 * alpha2)
        self._speeds = speeds.tolist()
        self._set_point = (ahead - trapezoid(ahead, times) / self._period).tolist()
        self._accelerations = np.gradient(0.5 * speeds**2, angles).tolist()
        self._kept = float(speeds[0] / speeds[-1])
        self.reset()

    def reset(self) -> None:
        """Forget what was."""
        self._last = None
        self._pace = math.nan
        self._acting = deque()

    def update(self, sample: PhaseSample) -> None:
        """Take the next sample, with rates."""
        last, self._last = self._last, sample
        if last is None:
            self._pace = sample.front.rate
            return
        elapsed = (sample.stamp_ns - last.stamp_ns) / SECOND
        share = -math.expm1(-elapsed / (0.25 * self._period))  # a strike's jolt is not a change of pace
        self._pace += share * (sample.front.rate - self._pace)

    def act(self, now: float, torque: float) -> None:
        """Note what was commanded at a time of a steady clock [s]: a predictor must know it [N·m]."""
        self._acting.append((now, torque))
        while len(self._acting) > 1 and self._acting[1][0] <= now - self._gains.delay:
            self._acting.popleft()

    def wanted(self, now: float) -> float:
        """The torque [N·m] to be commanded at a time of a steady clock [s]; NaN before the first sample."""
        sample, gains = self._last, self._gains
        if sample is None:
            return math.nan
        theta2, omega2 = self._ahead(sample, now)
        theta1 = sample.front.angle + self._pace * gains.delay
        phase = theta1 / (2.0 * self._alpha1) - theta2 / (2.0 * self._alpha2)
        aim = self._at(theta2, self._set_point)
        stretch = self._pace / (2.0 * self._alpha1) * self._period
        speed = self._at(theta2, self._speeds) * stretch
        error = math.remainder(phase - 0.5 - aim, 1.0) * 2.0 * self._alpha2
        return gains.stiffness * error + gains.damping * (speed - omega2)

    def _ahead(self, sample: PhaseSample, now: float) -> tuple[float, float]:
        """The rear wheel's angle and speed when a torque that is commanded now acts [rad], [rad/s]."""
        theta, omega = sample.rear
        steps = round(self._gains.delay / PREDICTION_STEP)
        commands = iter(self._acting)
        torque, (since, following) = 0.0, next(commands, (math.inf, 0.0))
        for i in range(steps):
            while since <= now - self._gains.delay + i * PREDICTION_STEP:
                torque, (since, following) = following, next(commands, (math.inf, 0.0))
            pull = self._at(theta, self._accelerations)
            theta += omega * PREDICTION_STEP
            omega += (pull + torque / self._gains.inertia) * PREDICTION_STEP
            if theta >= self._alpha2:
                theta, omega = theta - 2.0 * self._alpha2, omega * self._kept
        return theta, omega

    def _at(self, theta: float, values: list[float]) -> float:
        """Of values at even angles from −α to α, that at an angle between them: ten times as fast as NumPy for one."""
        last = len(values) - 1
        place = min(max((theta + self._alpha2) / (2.0 * self._alpha2), 0.0), 1.0) * last
        before = min(int(place), last - 1)
        return values[before] + (place - before) * (values[before + 1] - values[before])

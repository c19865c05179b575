"""How far the loop of the law `rear` is stable: the robot behind a person of even pace, from step to step.

The law itself runs, at the synchronizer's rate, on a rear wheel whose front one turns as it is told; nothing is
linearized by hand. A small deviation of the rear wheel is followed from each strike of the front wheel to the next.
"""

from typing import NamedTuple

import numpy as np

from dcdrw_control.sync.rear import LONGEST_DELAY, HubGains, RearLaw
from dcdrw_control.sync.synchronizer import SynchronizerParams
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import SECOND, PhaseSample, Turn
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.map.holding import MOST_GAIN, Margins, first_unstable
from dcdrw_sim.map.return_map import Complexes, spectrum
from dcdrw_sim.model.dynamics import State, accelerations, stance_distance
from dcdrw_sim.model.start import uncoupled_speed
from dcdrw_sim.model.wheel import kept
from dcdrw_sim.motion.runge_kutta import runge_kutta
from dcdrw_sim.rig.person import natural_cadence

SETTLING, WATCHED = 8, 8
"""Steps after which the gait is the loop's own, and steps over which the growth of a deviation is taken."""
DEVIATION = 1e-6
"""[rad], [rad/s] and [N·m]: far above rounding, far below what bends the gait."""
EDGE_SAMPLES = 6
"""Gains or delays that are tried for the edge; between two of them it is found exactly."""


class Rear(NamedTuple):
    """The rear wheel at an instant."""

    theta: float
    """[rad]"""
    omega: float
    """[rad/s]"""
    steps: int


class HubLoop:
    """A robot that the law `rear` drives behind a person of even pace, at the front wheel's own cadence.

    Its state at a strike of the front wheel is ψ2, θ2′ and the torques that were commanded and do not act yet.

    Args:
        rig: the rig.
        gains: of the law.

    Raises:
        ValueError: the front wheel has no gait of its own on this slope.

    """

    def __init__(self, rig: RigParams, gains: HubGains) -> None:
        self._rig, self._gains = rig.resolved(), gains
        period = 1.0 / natural_cadence(rig)
        self._ticks = round(period * SynchronizerParams().rate)
        self._tick = period / self._ticks
        self._pace = 2.0 * rig.front.alpha / period
        begun = np.zeros(2 + self._under_way(gains.delay))
        begun[1] = uncoupled_speed(rig, rig.rear, 0.0)
        self._settled = self._walk(1.0, gains.delay, begun, SETTLING)[-1]

    def multipliers(self, factor: float = 1.0) -> Complexes:
        """Of the state from one strike of the front wheel to the next, the two largest, shape (2,).

        Args:
            factor: times the gains; 0 without the law.

        """
        state, delay = self._settled, self._gains.delay
        after = self._walk(factor, delay, state, 1)[-1]
        columns = [
            (self._walk(factor, delay, state + DEVIATION * axis, 1)[-1] - after) / DEVIATION
            for axis in np.eye(len(state))
        ]
        return spectrum(np.stack(columns, axis=-1))[:2]

    def margins(self) -> Margins:
        """How many times the gains, or how much delay in all, makes the loop unstable."""
        delay = self._gains.delay
        gain = first_unstable(lambda factor: self._growth(factor, delay), 1.0, MOST_GAIN, EDGE_SAMPLES)
        return Margins(gain, self.unstable_delay())

    def unstable_delay(self) -> float:
        """The least delay in all that makes the loop unstable [s]; infinite where the law takes none so long."""
        return first_unstable(lambda delay: self._growth(1.0, delay), self._gains.delay, LONGEST_DELAY, EDGE_SAMPLES)

    def _growth(self, factor: float, delay: float) -> float:
        """Of a deviation, by each step: its logarithm; it begins in ψ2, and its first step is not counted."""
        state = np.zeros(2 + self._under_way(delay))
        state[:2] = self._settled[:2]
        deviating = state.copy()
        deviating[0] += DEVIATION
        one, other = (self._walk(factor, delay, begun, WATCHED) for begun in (state, deviating))
        sizes = np.linalg.norm(np.array(other)[1:, :2] - np.array(one)[1:, :2], axis=-1)
        return float(np.log(max(sizes[-1] / sizes[0], np.finfo(float).eps))) / (WATCHED - 1)

    def _under_way(self, delay: float) -> int:
        """Torques that were commanded, and act in the tick to come or later."""
        return int(delay // self._tick) + 1

    def _walk(self, factor: float, delay: float, begun: Floats, steps: int) -> list[Floats]:
        """States at the strikes of the front wheel, from a start with n2 = 0 on."""
        gains, (front, rear) = self._gains, (self._rig.front, self._rig.rear)
        law = RearLaw(
            gains._replace(stiffness=factor * gains.stiffness, damping=factor * gains.damping), front.alpha, rear.alpha
        )
        part = delay % self._tick
        torques = begun[2:].tolist()
        for back, torque in enumerate(reversed(torques), 1):
            law.act(-back * self._tick, torque)
        wheel = Rear(float(begun[0]), float(begun[1]), 0)
        states = [begun]
        for step in range(steps):
            for tick in range(self._ticks):
                now = (step * self._ticks + tick) * self._tick
                theta1 = (2.0 * tick / self._ticks - 1.0) * front.alpha
                turns = Turn(theta1, self._pace), Turn(wheel.theta, wheel.omega)
                law.update(PhaseSample(round(now * SECOND) + 1, *turns, Turn(), 0))
                torque = law.wanted(now)
                law.act(now, torque)
                torques.append(torque)
                wheel = self._on(wheel, step, theta1, torques.pop(0), part)
                wheel = self._on(wheel, step, theta1 + self._pace * part, torques[0], self._tick - part)
            psi2 = wheel.theta + 2.0 * rear.alpha * (wheel.steps - step - 1)  # as if it began again
            states.append(np.array([psi2, wheel.omega, *torques]))
        return states

    def _on(self, rear: Rear, step: int, theta1: float, torque: float, h: float) -> Rear:
        """The rear wheel a time h later: a step of Runge and Kutta, cut where the wheel strikes."""
        theta, omega = self._between(rear, step, theta1, torque, h)
        alpha = self._rig.rear.alpha
        if theta < alpha or h == 0.0:
            return Rear(theta, omega, rear.steps)
        to_strike = h
        for _ in range(4):  # Newton's method, by which each turn doubles the digits
            to_strike -= (theta - alpha) / omega
            theta, omega = self._between(rear, step, theta1, torque, to_strike)
        struck = Rear(-alpha, omega * kept(self._rig.rear), rear.steps + 1)
        return Rear(*self._between(struck, step, theta1 + self._pace * to_strike, torque, h - to_strike), struck.steps)

    def _between(self, rear: Rear, step: int, theta1: float, torque: float, h: float) -> tuple[float, float]:
        """θ2 and θ2′ a time h later, without a strike."""
        S = stance_distance(self._rig, step + 1, rear.steps)

        def rates(t: Floats, y: Floats) -> Floats:
            state = State(theta1 + self._pace * float(t), self._pace, *y.tolist())
            return np.array([state.omega2, float(accelerations(self._rig, state, S, 0.0, (0.0, torque))[1])])

        theta, omega = runge_kutta(rates, np.array([rear.theta, rear.omega]), h).tolist()
        return theta, omega

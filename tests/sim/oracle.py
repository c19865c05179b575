"""The paper's equations (1)–(12), with β and written out anew, integrated by scipy: a second opinion on everything."""

import math
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from dcdrw_msgs_py.rig import RigParams


class Event(NamedTuple):
    wheel: int
    t: float
    state: np.ndarray


def paper_rates(rig: RigParams, S: float, state: np.ndarray, external_force: float = 0.0) -> np.ndarray:
    """Rates of [θ1, ω1, θ2, ω2]."""
    theta1, omega1, theta2, omega2 = state
    l1, m1, l2, m2 = rig.front.length, rig.front.mass, rig.rear.length, rig.rear.mass
    I1, I2 = m1 * l1**2 * (1 + rig.front.gyration**2), m2 * l2**2 * (1 + rig.rear.gyration**2)
    Dx = l1 * math.sin(theta1) - l2 * math.sin(theta2) + S  # (4)
    Dy = l1 * math.cos(theta1) - l2 * math.cos(theta2)  # (5)
    D = math.sqrt(Dx**2 + Dy**2)  # (7)
    beta = math.atan2(Dy, Dx)  # (8), also where the rear wheel is ahead
    Dx_rate = l1 * math.cos(theta1) * omega1 - l2 * math.cos(theta2) * omega2  # (10)
    Dy_rate = l2 * math.sin(theta2) * omega2 - l1 * math.sin(theta1) * omega1  # (11)
    D_rate = (Dx * Dx_rate + Dy * Dy_rate) / D  # (9)
    F = rig.k * (D - rig.D0) + rig.b * D_rate + external_force  # (3)
    F += rig.coupler_friction * math.tanh(D_rate / rig.friction_speed)
    lever1 = math.cos(theta1) * math.cos(beta) - math.sin(theta1) * math.sin(beta)
    lever2 = math.cos(theta2) * math.cos(beta) - math.sin(theta2) * math.sin(beta)
    torque1 = m1 * rig.gravity * l1 * math.sin(theta1 + rig.slope) - F * l1 * lever1  # (1)
    torque2 = m2 * rig.gravity * l2 * math.sin(theta2 + rig.slope) + F * l2 * lever2  # (2)
    torque1 -= rig.rolling_resistance * m1 * rig.gravity * l1 * math.tanh(l1 * omega1 / rig.friction_speed)
    torque2 -= rig.rolling_resistance * m2 * rig.gravity * l2 * math.tanh(l2 * omega2 / rig.friction_speed)
    return np.array([omega1, torque1 / I1, omega2, torque2 / I2])


def integrate(rig: RigParams, state, seconds: float, method: str = 'DOP853') -> tuple[list[Event], np.ndarray]:
    """Strikes up to a time, and the state there; forward strikes only."""
    rig = rig.resolved()
    wheels, strikes, n, t, y = (rig.front, rig.rear), [], [0, 0], 0.0, np.array(state, float)
    events = []
    for i, wheel in enumerate(wheels):

        def reaches(t, y, i=i, alpha=wheel.alpha):
            return y[2 * i] - alpha

        reaches.terminal, reaches.direction = True, 1
        events.append(reaches)
    while t < seconds:
        S = (
            rig.S0
            + n[0] * 2 * rig.front.length * math.sin(rig.front.alpha)
            - n[1] * 2 * rig.rear.length * math.sin(rig.rear.alpha)
        )
        solution = solve_ivp(
            lambda t, y, S=S: paper_rates(rig, S, y),
            (t, seconds),
            y,
            method,
            events=events,
            rtol=1e-13,
            atol=1e-15,
            max_step=0.02 if method == 'DOP853' else np.inf,
        )
        t, y = solution.t[-1], solution.y[:, -1]
        for i, wheel in enumerate(wheels):
            if solution.t_events[i].size:
                strikes.append(Event(i + 1, t, y.copy()))
                rigid = (math.cos(2 * wheel.alpha) + wheel.gyration**2) / (1 + wheel.gyration**2)
                left = rigid + wheel.restitution * (1 - rigid)
                y[2 * i], y[2 * i + 1] = -wheel.alpha, y[2 * i + 1] * left
                n[i] += 1
    return strikes, y

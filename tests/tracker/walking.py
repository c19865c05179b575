"""Truth to test against: a pair of rimless wheels on their uncoupled limit cycle, the rear one drifting into step.

Each wheel's leg obeys θ̈ = (g/ℓ) sin(θ + γ) between strikes, whose first integral gives time as a function of angle.
The rear wheel runs on a warped time, so that the phase goes from `p0` to `p1` as 1 − exp(−t/τ).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.samples import JointSample, Turn

Array = NDArray[np.float64]

ALPHA = math.pi / 12
PITCH = 2 * ALPHA
GRAVITY_BY_LENGTH = 9.81 / 0.9652
SLOPE = math.radians(2.0)
START_NS = 1_700_000_000_000_000_000


def _leg() -> tuple[Array, Array, Array]:
    """Time, angle and speed over one step of the limit cycle."""
    after = math.cos(PITCH) ** 2 * 4 * GRAVITY_BY_LENGTH * math.sin(SLOPE) * math.sin(ALPHA) / math.sin(PITCH) ** 2
    theta = np.linspace(-ALPHA, ALPHA, 4001)
    speed = np.sqrt(after + 2 * GRAVITY_BY_LENGTH * (math.cos(SLOPE - ALPHA) - np.cos(theta + SLOPE)))
    slowness = 1 / speed
    time = np.concatenate(([0.0], np.cumsum((slowness[1:] + slowness[:-1]) / 2 * np.diff(theta))))
    return time, theta, speed


LEG_TIME, LEG_THETA, LEG_SPEED = _leg()
STEP = float(LEG_TIME[-1])
"""Time of a step [s]."""


def rotation(time: Array) -> Array:
    """ψ of a wheel that has just struck (ψ = −α) at time 0."""
    step = np.floor(time / STEP)
    return np.interp(time - step * STEP, LEG_TIME, LEG_THETA) + PITCH * step


def speed(time: Array) -> Array:
    """ψ̇ of that wheel; at a strike, after it."""
    return np.interp(time - np.floor(time / STEP) * STEP, LEG_TIME, LEG_SPEED)


class Walk(NamedTuple):
    """A trial's truth on a grid of times."""

    time: Array
    """[s] from the start."""
    front: Array
    """ψ1."""
    rear: Array
    front_speed: Array
    """ψ̇1 [rad/s]."""
    rear_speed: Array
    front_strikes: Array
    """Times [s]."""
    rear_strikes: Array

    def phase(self) -> Array:
        """p, in [0, 1)."""
        return ((self.front - self.rear) / PITCH) % 1.0

    def steps(self) -> tuple[Array, Array]:
        """n1 and n2."""
        return _steps(self.time, self.front_strikes), _steps(self.time, self.rear_strikes)

    def samples(self, noise_deg: float = 0.0, seed: int = 0, rates: bool = True) -> list[JointSample]:
        """The walk as messages, with gaussian noise on each rotation."""
        random = np.random.default_rng(seed)
        front = self.front + np.radians(noise_deg) * random.standard_normal(self.time.size)
        rear = self.rear + np.radians(noise_deg) * random.standard_normal(self.time.size)
        front_rate, rear_rate = self.front_speed, self.rear_speed
        if not rates:
            front_rate = rear_rate = np.full(self.time.size, np.nan)
        stamps = (START_NS + np.round(self.time * 1e9).astype(np.int64)).tolist()
        rows = zip(stamps, front.tolist(), front_rate.tolist(), rear.tolist(), rear_rate.tolist(), strict=True)
        return [JointSample(stamp, Turn(psi1, rate1), Turn(psi2, rate2)) for stamp, psi1, rate1, psi2, rate2 in rows]


def walk(seconds: float, rate: float = 200.0, p0: float = 0.216, p1: float = 0.5, settle: float = 2.0) -> Walk:
    """A trial: the front wheel just after a strike, the phase from p0 to p1 with time constant `settle` [s].

    In the end the wheels strike p1 steps apart in time; the phase then swings by about ±5 % of a step,
    as legs slow down at their apex.
    """
    time = np.arange(round(seconds * rate)) / rate
    # The rear wheel is where the front one is on warped time; its angle at the start gives p0 (contract §1).
    start = float(np.interp(ALPHA * (1 - 2 * p0), LEG_THETA, LEG_TIME))
    end = STEP * (1 - p1)

    def warped(at: Array) -> Array:
        return at + start + (end - start) * (1 - np.exp(-at / settle))

    rear_speed = speed(warped(time)) * (1.0 + (end - start) / settle * np.exp(-time / settle))
    fine = np.linspace(0.0, seconds, 20_001)
    strikes = STEP * np.arange(1, int(seconds / STEP) + 1, dtype=np.float64)
    rear_strikes = np.interp(STEP * np.arange(1, int(warped(fine)[-1] / STEP) + 1), warped(fine), fine)
    return Walk(time, rotation(time), rotation(warped(time)), speed(time), rear_speed, strikes, rear_strikes)


def keep(samples: list[JointSample], lost: float, seed: int = 0) -> list[JointSample]:
    """The same with a share of the samples lost at random, never the first."""
    kept = np.random.default_rng(seed).random(len(samples)) >= lost
    return [sample for index, sample in enumerate(samples) if index == 0 or kept[index]]


def _steps(time: Array, strikes: Array) -> Array:
    return np.searchsorted(strikes, time, side='right').astype(np.float64)

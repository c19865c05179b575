"""A person in the front wheel's place: it turns as a walk asks for, and can be pushed only a little.

The walk is a reference rotation of the wheel, at an even speed from heel strike to heel strike. A servo at the hub
follows it,

    T1 = K (ψ_ref − ψ1) + C (ψ̇_ref − ψ̇1),

with the stiffness K and damping C of a person who minds the own pace. Weight, strikes and the coupler's pull are all
borne by this torque: with the defaults the wheel stays within about 1 % of a step of its reference, and 10 N at the hub
move it by 2.5 mm.

The torque is held from one sample of the servo to the next, so that the motion stays a Taylor series between them. A
servo sampled every h is as good as a continuous one where h is short beside I/C, the shortest time in the loop (25 ms
with the defaults, h is 5 ms); faster servos than that are refused.
"""

import bisect
import math
import random
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.start import require_rolling
from dcdrw_sim.model.wheel import inertia, limit_cycle_speed

SERVO_SECONDS = 0.005
"""How long each torque is held [s]."""
MOST_SPREAD = 3.0
"""A step's time differs from the mean by so many standard deviations at most."""
SHORTEST_SHARE = 0.2
"""A step takes at least this share of the mean one."""


class PersonParams(NamedTuple):
    """How the person in front walks."""

    walks: Annotated[bool, Quantity('a person walks in the place of the front wheel')] = False
    cadence: Annotated[
        float,
        Quantity('steps per second', 'Hz', above=0.0, high=5.0, derived='of the front wheel that rolls by itself'),
    ] = math.nan
    variability_percent: Annotated[
        float,
        Quantity("one standard deviation of a stride's time; each step varies by itself", '%', low=0.0, high=15.0),
    ] = 2.7
    drift_percent: Annotated[float, Quantity('growth of the cadence', '% per minute', low=-50.0, high=50.0)] = 0.0
    heel_strikes: Annotated[
        str, Quantity('file of the times of heel strikes, left and right in turn, one a line [s]; walked in a circle')
    ] = ''
    stiffness: Annotated[float, Quantity('with which the walk is kept, K', 'N·m/rad', low=0.0, high=1e5)] = 4000.0
    damping: Annotated[float, Quantity('with which the walk is kept, C', 'N·m·s/rad', low=0.0, high=1e4)] = 400.0


class Walk:
    """A reference in steps: 0 at time 0, even from each whole step to the next."""

    def __init__(self, step_times: Iterator[float]) -> None:
        """Take the duration of each step [s]; there is no end to them."""
        self._durations, self._strikes = step_times, [0.0]

    def at(self, time: float) -> tuple[float, float]:
        """Steps walked up to a time [s], and steps per second."""
        while self._strikes[-1] <= time:
            self._strikes.append(self._strikes[-1] + next(self._durations))
        j = bisect.bisect_right(self._strikes, time) - 1
        rate = 1.0 / (self._strikes[j + 1] - self._strikes[j])
        return j + (time - self._strikes[j]) * rate, rate


def varied_steps(cadence: float, variability: float, drift: float, seed: int) -> Iterator[float]:
    """Durations of steps that vary from one to the next [s].

    Args:
        cadence: mean steps per second at the start.
        variability: one standard deviation of a stride's time, relative. Two steps that vary independently make a
            stride, so each varies by √2 times as much.
        drift: relative growth of the cadence per second.
        seed: of what varies.

    """
    chance, time = random.Random(seed), 0.0
    while True:
        spread = max(-MOST_SPREAD, min(MOST_SPREAD, chance.gauss(0.0, 1.0))) * math.sqrt(2.0) * variability
        pace = cadence * max(1.0 + drift * time, SHORTEST_SHARE)
        duration = max(1.0 + spread, SHORTEST_SHARE) / pace
        time += duration
        yield duration


def recorded_steps(path: Path) -> Iterator[float]:
    """Durations of the steps between recorded heel strikes [s]; after the last one from the first again.

    Raises:
        ValueError: the file cannot be read, or holds no times of at least two heel strikes in order.

    """
    try:
        strikes = np.loadtxt(path, delimiter=',', usecols=0, ndmin=1).tolist()
    except (ValueError, OSError) as error:
        raise ValueError(f'{path} (person.heel_strikes) must hold one time in seconds a line: {error}') from None
    durations = [after - before for before, after in pairwise(strikes)]
    if not durations or not all(math.isfinite(one) and one > 0.0 for one in durations):
        raise ValueError(f'{path} (person.heel_strikes) must hold at least two times, each later than the one before')

    def around() -> Iterator[float]:
        while True:
            yield from durations

    return around()


class Person:
    """The servo that keeps the front wheel of a rig to a walk."""

    def __init__(self, params: PersonParams, rig: RigParams, rotation: float, seed: int) -> None:
        """Begin the walk where the wheel is.

        Args:
            params: how to walk.
            rig: the rig.
            rotation: of the front wheel at time 0 [rad].
            seed: of what varies.

        Raises:
            ValueError: a servo too fast to be sampled, no cadence to derive, or as `recorded_steps`.
            OSError: as `recorded_steps`.

        """
        fastest = inertia(rig.front) / (2.0 * SERVO_SECONDS)
        if params.damping > fastest or params.stiffness > fastest / (2.0 * SERVO_SECONDS):
            raise ValueError(
                f'person.damping must be ≤ {fastest:.4g} N·m·s/rad and person.stiffness ≤ '
                f'{fastest / (2.0 * SERVO_SECONDS):.4g} N·m/rad with this front wheel, got {params.damping:g} and '
                f'{params.stiffness:g}'
            )
        self._params, self._rotation, self._pitch = params, rotation, 2.0 * rig.front.alpha
        if params.heel_strikes:
            steps = recorded_steps(Path(params.heel_strikes))
        else:
            cadence = natural_cadence(rig) if math.isnan(params.cadence) else params.cadence
            steps = varied_steps(cadence, params.variability_percent / 100.0, params.drift_percent / 100.0 / 60.0, seed)
        self.walk = Walk(steps)

    def reference(self, time: float) -> tuple[float, float]:
        """ψ_ref [rad] and its rate [rad/s] at a time [s]."""
        steps, rate = self.walk.at(time)
        return self._rotation + steps * self._pitch, rate * self._pitch

    def torque(self, time: float, rotation: float, omega: float) -> float:
        """What holds the wheel to the walk [N·m], from its rotation [rad] and speed [rad/s] at a time [s]."""
        aim, rate = self.reference(time)
        return self._params.stiffness * (aim - rotation) + self._params.damping * (rate - omega)


def natural_cadence(rig: RigParams) -> float:
    """Steps per second of the front wheel that rolls by itself.

    Raises:
        ValueError: it does not roll by itself.

    """
    require_rolling(rig)
    nodes, weights = np.polynomial.legendre.leggauss(32)
    alpha = rig.front.alpha
    speeds = limit_cycle_speed(rig.front, rig.slope, rig.gravity, alpha * nodes)
    return 1.0 / float(np.sum(alpha * weights / speeds))

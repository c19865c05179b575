"""What would explain the paper's trial: from 21.6 % into ±6 % of 50 % in 7 steps, shown for 5 s."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from dcdrw_msgs_py.in_step import BAND_PERCENT
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.rolling import phase
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.model.dynamics import State, accelerations, coupler, stance_distance
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.start import start
from dcdrw_sim.model.wheel import kept
from dcdrw_sim.motion.trajectory import run

START, STEPS = 0.216, 7
"""The paper's phase at the start, and the front wheel's strikes after which it is within the band."""
SPANS = 5.0, 10.0, 30.0
"""The paper shows the first; the others tell the causes apart [s]."""
RATE = 1000
"""Instants of a second that are looked at."""


class Cause(NamedTuple):
    """What the rig may have been, other than the model of the paper takes it to be."""

    name: str
    rig: RigParams
    plausible: str
    """How plausible it is, for a reader."""
    damps: int = 0
    """The damper acts only where the coupler becomes longer, 1, or shorter, -1; 0: both ways."""


class Course(NamedTuple):
    """How the phase goes from the paper's start."""

    strikes: Floats
    """Error at strikes 1, 2, … of the front wheel [%]."""
    strike_times: Floats
    """[s]"""
    time: Floats
    """RATE times a second [s]."""
    error: Floats
    """At every instant [%]."""

    @property
    def strike_steps(self) -> int | None:
        """The first strike at which the phase is within the band; None where it is at none."""
        inside = np.flatnonzero(abs(self.strikes) <= BAND_PERCENT)
        return int(inside[0]) + 1 if inside.size else None

    @property
    def steps(self) -> int | None:
        """Strikes to the step from which on it is within the band at every instant; None where it is not by the end."""
        outside = np.flatnonzero(abs(self.error) > BAND_PERCENT)
        since = self.time[outside[-1]] if outside.size else -1.0
        within = int((self.strike_times <= since).sum()) + 1 if outside.size else 0
        return within if within <= len(self.strikes) else None

    def stays(self, seconds: float) -> bool:
        """Whether it is within the band at every strike from STEPS on until a time [s]."""
        shown = self.strikes[STEPS - 1 :][self.strike_times[STEPS - 1 :] <= seconds]
        return bool(shown.size) and bool((abs(shown) <= BAND_PERCENT).all())


def causes() -> Iterator[Cause]:
    """What is not told of the rig, or not in the paper's model, each at a value that speaks for it."""
    rig = preset('paper').resolved()
    front, rear = rig.front, rig.rear
    yield Cause('as the paper says', rig, 'the model, with D0 at rest and wheels of 10 kg')
    long = rig._replace(D0=rig.D0 + front.step_length)
    yield Cause('D0 longer by σ: a preload', long, 'likely: nobody states D0, and the 5 s shown end before it leaves')
    yield Cause('a dashpot of 22 N·s/m', rig._replace(b=22.0), 'likely: damping is the least certain number of a rig')
    yield Cause('a spring of 45 N/m', rig._replace(k=45.0), 'unlikely: springs keep their rate, and 5.25 N/m is stated')
    for mass in (2.0, 40.0):
        heavy = rig._replace(front=front._replace(mass=mass), rear=rear._replace(mass=mass))
        yield Cause(f'wheels of {mass:g} kg', heavy, 'no: too slow')
    spokes = rig._replace(front=front._replace(gyration=0.5), rear=rear._replace(gyration=0.5))
    yield Cause('heavy spokes, r = 0.5', spokes, 'real, but slower')
    rubber = rig._replace(front=front._replace(restitution=0.1), rear=rear._replace(restitution=0.1))
    yield Cause('rubber feet, e = 0.1', rubber, 'real, but slower')
    yield Cause(
        'coupler friction of 2 N', rig._replace(coupler_friction=2.0), 'real, but it holds the pair where it is'
    )
    yield Cause('rolling resistance of 0.005', rig._replace(rolling_resistance=0.005), 'real, but too slow')
    yield Cause(
        'a damper that only resists lengthening', rig, 'no: at once to 5 %, where both wheels strike almost together', 1
    )
    yield Cause('a damper that only resists shortening', rig, 'no: through 50 % in 2 steps, and on to 96 %', -1)


def course(rig: RigParams, phase0: float = START) -> Course:
    """The motion of a rig from the paper's start, or another, over the longest of SPANS or to its end.

    Raises:
        ValueError: an impossible rig, or one whose wheels do not roll by themselves.

    """
    motion = run(*start(rig, phase0), SPANS[-1])
    front = [strike for strike in motion.strikes if strike.wheel == 1]
    theta2 = np.array([strike.state.theta2 for strike in front])
    seen = motion.at(np.arange(int(RATE * motion.duration) + 1) / RATE)
    p = phase(rig.front, rig.rear, seen.rotation1, seen.rotation2)
    return Course(
        -50.0 * theta2 / rig.rear.alpha,
        np.array([strike.t for strike in front]),
        seen.time,
        100.0 * p - 50.0,
    )


def course_of(cause: Cause, phase0: float = START) -> Course:
    """The motion that a cause leads to, as `course`; one-way dampers are integrated by SciPy."""
    if not cause.damps:
        return course(cause.rig, phase0)
    rig, state = start(cause.rig, phase0)
    wheels, steps, now = (rig.front, rig.rear), np.zeros(2, int), 0.0
    passive = rig._replace(b=0.0)
    strikes, times, seen = [], [], []

    def reaches(i: int, side: int) -> Callable[[float, Floats], float]:
        def angle(t: float, y: Floats) -> float:
            return float(y[2 * i] - side * wheels[i].alpha)

        vars(angle).update(terminal=True, direction=side)
        return angle

    while now < SPANS[-1]:
        S = float(stance_distance(rig, *steps.tolist()))

        def rates(t: float, y: Floats, S: float = S) -> Floats:
            at = State(*y)
            rate = coupler(passive, at, S).rate
            force = rig.b * rate if cause.damps * rate > 0.0 else 0.0
            front, rear = accelerations(passive, at, S, force)
            return np.array([at.omega1, front, at.omega2, rear])

        guards = [reaches(i, side) for i in range(2) for side in (1, -1)]
        part = solve_ivp(
            rates, (now, SPANS[-1]), state, 'DOP853', dense_output=True, events=guards, rtol=1e-9, atol=1e-9
        )
        inner = np.arange(math.ceil(now * RATE), math.floor(part.t[-1] * RATE) + 1) / RATE
        psi = part.sol(inner)[[0, 2]] + [[2.0 * wheel.alpha * n] for wheel, n in zip(wheels, steps, strict=True)]
        seen.append((inner, 100.0 * phase(*wheels, *psi) - 50.0))
        now, y = float(part.t[-1]), part.y[:, -1]
        struck = [i for i in range(2) if part.t_events[2 * i].size]
        if part.status == 0 or not struck:  # the time is over, or a wheel rocks back
            break
        for i in struck:
            if i == 0:
                strikes.append(-50.0 * y[2] / rig.rear.alpha)
                times.append(now)
            y[2 * i], y[2 * i + 1] = -wheels[i].alpha, kept(wheels[i]) * y[2 * i + 1]
            steps[i] += 1
        state = State(*y)
    time, error = map(np.concatenate, zip(*seen, strict=True))
    return Course(np.array(strikes), np.array(times), time, error)


def rows(shown: int = 10) -> Iterator[tuple[str, ...]]:
    """The answer as a table: cause, phase at strikes [%], steps, whether it stays for each of SPANS, plausibility.

    Steps are to the first strike within the band / to where it stays there at every instant, over the longest of SPANS.
    """
    for cause in causes():
        found = course_of(cause)
        phases = ' '.join(f'{50.0 + error:.1f}' for error in found.strikes[:shown])
        steps = ('–' if within is None else str(within) for within in (found.strike_steps, found.steps))
        stays = ('yes' if found.stays(span) else 'no' for span in SPANS)
        yield cause.name, phases, ' / '.join(steps), ', '.join(stays), cause.plausible

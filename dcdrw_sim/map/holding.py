"""A force held from strike to strike of the front wheel: its gain from the return map, and how far the loop is stable.

About a limit cycle a step answers a held force u as x⁺ = A x + B u, x the deviation of [θ1′, θ2, θ2′] at the section.
A force that comes late by d acts as B_old u_before + B_new u: the one before still acts for the first d of the step.
The law is u = u* − K x − κ (u_before − u*).
"""

import itertools
import math
from collections.abc import Callable
from contextlib import suppress
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.polynomial import Polynomial
from scipy.linalg import solve_discrete_are
from scipy.optimize import brentq, minimize_scalar

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.rolling import phase
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.map.return_map import Complexes, FixedPoint, ReturnMap, SectionState, spectrum
from dcdrw_sim.map.variation import jump, propagators, rates
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.motion.pair import Segment
from dcdrw_sim.motion.trajectory import Run, run

Target = Literal['cycle', 'time', 'angle']
TARGETS: tuple[Target, ...] = get_args(Target)
"""cycle: the pair's own limit cycle, where no force is left; time: the rear wheel strikes when half of the front
wheel's step time has passed; angle: p = 50 % at the strikes of the front wheel."""
Method = Literal['deadbeat', 'lqr']
METHODS: tuple[Method, ...] = get_args(Method)

MOST_GAIN = 20.0
"""Where the search for an unstable gain ends, in gains of the law."""
EDGE_SAMPLES = 40
"""Gains or delays that are tried along the way; between two of them the edge is found exactly."""
EDGE = 1e-4
"""To so much of the range of the search."""
UNCERTAIN = 0.3
"""Masses, damping and stiffness of a rig may each be such a share less or more than is known."""
SWING_SAMPLES = 1001
"""Times within a step at which its swing is looked at."""
WHOLE_STEP = 0.999
"""Delays are looked at up to this fraction of a step's time; a longer one would be that of another step."""


class Plant(NamedTuple):
    """How a step answers a force about a limit cycle."""

    rig: RigParams
    point: FixedPoint
    """The limit cycle under the steady force."""
    force: float
    """u*, the steady force that the target needs [N]."""
    delay: float
    """d [s]."""
    by_old: Floats
    """B_old, shape (3,) [per N]."""
    by_new: Floats
    """B_new, shape (3,) [per N]."""
    middle: float
    """Of the swing of p − 0.5 within a step on the limit cycle [steps]."""

    def closed(self, law: 'Law', factor: float = 1.0) -> Complexes:
        """Multipliers of the loop with so many times the gain of a law, the largest first, shape (4,)."""
        gain = factor * np.append(law.gain, law.gain_before)
        step = np.column_stack([self.point.derivative, self.by_old]) - np.outer(self.by_new, gain)
        return spectrum(np.vstack([step, -gain]))


class Law(NamedTuple):
    """A force from the state x at a strike: u = force − gain · (x − state) − gain_before (u_before − force)."""

    state: SectionState
    """What is aimed at."""
    force: float
    """[N]"""
    gain: Floats
    """Gains on θ1′ [N·s/rad], θ2 [N/rad] and θ2′ [N·s/rad], shape (3,)."""
    gain_before: float
    """Gain on the force that was held before."""
    middle: float
    """Of the swing of p − 0.5 within a step, where the pair is at its aim [steps]."""


class Margins(NamedTuple):
    """Where the loop becomes unstable; infinite where it does not within what is searched."""

    gain: float
    """Times the gain of the law; at most `MOST_GAIN` is looked at."""
    delay: float
    """[s]; at most a step's time is looked at."""


def plant(rig: RigParams, target: Target = 'cycle', delay: float = 0.0, limit: float = math.inf) -> Plant:
    """The step about the limit cycle that has the target.

    Args:
        rig: the rig.
        target: what counts as in step.
        delay: between a strike and the force that answers it [s].
        limit: largest steady force that may be needed [N].

    Raises:
        ValueError: the pair has no limit cycle, none with this target within the limit, or the delay is
            longer than a step.

    """
    point, force = _target(rig, target, limit)
    return _with_delay(rig, point, force, delay)


def law(plant: Plant, method: Method = 'deadbeat', band: float = 0.06, limit: float = 20.0) -> Law:
    """The law of a plant.

    Args:
        plant: as `plant` gives it.
        method: deadbeat brings θ2 to its aim in one step; lqr weighs θ2 in bands against the force in limits
            (Bryson's rule), for every step to come.
        band: what counts as a large error, in steps.
        limit: what counts as a large force [N].

    Raises:
        ValueError: a held force does not move θ2 at all.

    """
    derivative, by_old, by_new = plant.point.derivative, plant.by_old, plant.by_new
    if not abs(by_new[1]) > 0.0:
        raise ValueError('a force in the coupler does not move the rear wheel at the strikes of the front one')
    if method == 'deadbeat':
        gain = np.append(derivative[1], by_old[1]) / by_new[1]
    else:
        # The state with the force before, which the delay needs.
        A = np.vstack([np.column_stack([derivative, by_old]), np.zeros(4)])
        B = np.append(by_new, 1.0)[:, None]
        Q = np.diag([0.0, 1.0 / (2.0 * band * plant.rig.rear.alpha) ** 2, 0.0, 0.0])
        R = np.array([[1.0 / limit**2]])
        P = solve_discrete_are(A, B, Q, R)
        gain = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)[0]
    return Law(plant.point.state, plant.force, gain[:3], float(gain[3]), plant.middle)


def plants_near(rig: RigParams, share: float, delay: float = 0.0) -> list[Plant]:
    """The plants of `corners`, of those that have a limit cycle; the delay [s] is that of `plant`."""
    found = []
    for corner in corners(rig, share):
        with suppress(ValueError):
            found.append(plant(corner, delay=delay))
    return found


def eased(chosen: Law, about: Plant, share: float = UNCERTAIN) -> Law:
    """A law with so much less gain that the worst of the rigs near its plant's is damped best.

    A loop's largest multiplier is left aside: it is that of the pair's own speed, which a held force hardly moves.

    Args:
        chosen: the law.
        about: its plant.
        share: how far masses, damping and stiffness may each be off; where it is 0, the law stays as it is.

    """
    plants = plants_near(about.rig, share, about.delay) if share else []
    if not plants:
        return chosen

    def worst(factor: float) -> float:
        return max(float(abs(plant.closed(chosen, factor)[1])) for plant in plants)

    factor = float(minimize_scalar(worst, bounds=(0.0, 1.0), method='bounded').x)
    return chosen._replace(gain=factor * chosen.gain, gain_before=factor * chosen.gain_before)


def corners(rig: RigParams, share: float) -> list[RigParams]:
    """The eight rigs whose masses, damping and stiffness are each such a share less, or more."""
    return [
        rig._replace(
            front=rig.front._replace(mass=m * rig.front.mass),
            rear=rig.rear._replace(mass=m * rig.rear.mass),
            b=b * rig.b,
            k=k * rig.k,
        )
        for m, b, k in itertools.product((1.0 - share, 1.0 + share), repeat=3)
    ]


def margins(plant: Plant, chosen: Law) -> Margins:
    """How much more gain, or how much delay in all, makes the loop unstable."""

    def radius_of_gain(factor: float) -> float:
        return float(abs(plant.closed(chosen, factor)[0])) - 1.0

    def radius_of_delay(delay: float) -> float:
        return float(abs(_with_delay(plant.rig, plant.point, plant.force, delay).closed(chosen)[0])) - 1.0

    return Margins(
        first_unstable(radius_of_gain, 1.0, MOST_GAIN),
        first_unstable(radius_of_delay, plant.delay, WHOLE_STEP * plant.point.period),
    )


def first_unstable(growth: Callable[[float], float], low: float, high: float, samples: int = EDGE_SAMPLES) -> float:
    """The least value at which a loop is unstable; infinite where none is found.

    Args:
        growth: negative where the loop is stable at a value.
        low: where the search begins.
        high: where it ends.
        samples: how many values are tried; between two of them the edge is found exactly.

    """
    before, stable = low, growth(low)
    if stable >= 0.0:
        return low
    for value in np.linspace(low, high, samples)[1:]:
        if growth(value) >= 0.0:
            return float(brentq(growth, before, value, xtol=EDGE * (high - low)))
        before = value
    return math.inf


def _target(rig: RigParams, target: Target, limit: float) -> tuple[FixedPoint, float]:
    own = ReturnMap(rig).fixed_point()
    if target == 'cycle':
        return own, 0.0

    def miss(force: float) -> float:
        point = ReturnMap(rig, force).fixed_point(own.state)
        if target == 'angle':
            return float(point.state.theta2)
        motion = run(rig, State(rig.front.alpha, *point.state), strikes=3, external_force=force)
        rear = next(strike.t for strike in motion.strikes if strike.wheel == 2)
        return float(rear / point.period - 0.5)

    # A force of this size moves θ2 by about its error: search as far on either side as that needs, within the limit.
    slope = np.linalg.solve(np.eye(3) - own.derivative, own.by_force)[1]
    reach = min(limit, 4.0 * abs(own.state.theta2 / slope) + 1e-6)
    try:
        force = float(brentq(miss, -reach, reach, xtol=1e-9))
    except ValueError as error:
        raise ValueError(f'no steady force within ±{reach:.3g} N gives the target {target!r}: {error}') from None
    return ReturnMap(rig, force).fixed_point(own.state), force


def _with_delay(rig: RigParams, point: FixedPoint, force: float, delay: float) -> Plant:
    if not 0.0 <= delay < point.period:
        raise ValueError(f'the delay must be ≥ 0 and shorter than a step, {point.period:.3f} s, got {delay:g} s')
    rig = ReturnMap(rig).rig
    motion = run(rig, State(rig.front.alpha, *point.state), strikes=3, external_force=force)
    middle = _middle(motion, point.period)
    if delay == 0.0:
        return Plant(rig, point, force, 0.0, np.zeros(3), point.by_force, middle)
    segments = _cut(motion.segments, delay)
    steps = propagators(rig, segments, force)
    deviation = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
    for i, step in enumerate(steps):
        if i:
            deviation = jump(rig, segments[i - 1], segments[i], force) @ deviation
        if segments[i].start >= delay:
            deviation[4] = 0.0
        deviation = step @ deviation
    flow = rates(rig, motion.strikes[-1].state, rig.S0, force)
    by_old = (deviation - flow / flow[0] * deviation[0])[1:4]
    return Plant(rig, point, force, delay, by_old, point.by_force - by_old, middle)


def _middle(motion: Run, period: float) -> float:
    """The middle of the swing of p − 0.5 within a step [steps]."""
    rig, at = motion.rig, motion.at(np.linspace(0.0, period, SWING_SAMPLES))
    error = phase(rig.front, rig.rear, at.rotation1, at.rotation2) - 0.5
    return 0.5 * float(error.min() + error.max())


def _cut(segments: list[Segment], time: float) -> list[Segment]:
    """The same motion, with a segment that begins at a time [s]."""
    result = []
    for one in segments:
        if one.start < time < one.end:
            shift = Polynomial([time - one.start, 1.0])
            theta1, theta2 = (np.asarray(Polynomial(theta)(shift).coef, float) for theta in (one.theta1, one.theta2))
            result += [one._replace(end=time), Segment(time, one.end, theta1, theta2, one.steps)]
        else:
            result.append(one)
    return result

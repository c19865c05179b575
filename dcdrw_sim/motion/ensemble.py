"""Many pairs at once: trajectories side by side in the lanes of the Taylor kernel, compiled where numba is."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dcdrw_msgs_py.quantity import lookup
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams
from dcdrw_msgs_py.rolling import default_rest_length, default_stance_distance
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.model.dynamics import reset
from dcdrw_sim.model.rigs import FIELDS, Rigs, Wheels, rig_at
from dcdrw_sim.motion import taylor
from dcdrw_sim.motion.compiled import compiled
from dcdrw_sim.motion.ends import (
    BACKWARD,
    FORWARD,
    LEAVING_SPEED,
    LONGEST_STEP,
    MIN_COUPLER_LENGTH,
    NONE,
    SHORTEST_STEP,
    STALL_TIME,
    STANDING_SPEED,
    STIFFEST,
    End,
    MotionError,
    accept,
)
from dcdrw_sim.motion.events import first_strike
from dcdrw_sim.motion.extremes import phase_extremes
from dcdrw_sim.motion.taylor import (
    LANES,
    OMEGA1,
    OMEGA2,
    THETA1,
    THETA2,
    Present,
    Row,
    Table,
    bare,
    evaluate,
    expand,
    friction_step,
    minimum,
    motion,
    rows,
    rubs,
    step_size,
    work_parameters,
)

ENSEMBLE_TOLERANCE = 5e-16
"""Last term of the angles' series at the end of a step [rad]: strikes within 1e-9 over 100 time units."""

STRIKE = np.dtype([('wheel', np.int8), ('direction', np.int8), ('t', float), ('state', float, (4,))])
"""One strike: wheel 1 or 2, direction, time [s], and the state just before it."""
WATCHED_STRIKE = np.dtype([*STRIKE.descr, ('low', float), ('high', float)])
"""A strike, and the least and the greatest phase difference θ1/2α1 − θ2/2α2 [steps] since the strike before or the
start, these instants included. The phase p is that and whole steps."""

STATE = (THETA1, OMEGA1, THETA2, OMEGA2)
# Plain numbers, which compile.
TOO_FAST, NONE_YET, NO_PAIR = -2, -1, -1
TIME_OVER, STRIKES, STANDING, FALLEN, STALLED, HUBS_MET = (int(end) for end in End)

# Rows of the work array behind those of the series.
(
    PAIR,
    AHEAD1,
    AHEAD2,
    SLOWEST1,
    SLOWEST2,
    STRIKE1,
    STRIKE2,
    MISS1,
    MISS2,
    REACH,
    STEP,
    WHEEL,
    DIRECTION,
    S0,
    STRIDE1,
    STRIDE2,
    SPEED1,
    SPEED2,
    UNIT,
    TIME,
    STEPS1,
    STEPS2,
    LAST1,
    LAST2,
    ROLLED1,
    ROLLED2,
    PITCH1,
    PITCH2,
    RATE,
    RATE_AHEAD,
    TANGENT,
    LOW,
    HIGH,
    SAMPLED,
    SIZE,
) = range(taylor.END, taylor.END + 35 * LANES, LANES)
NEWTON_ITERATIONS = 2
"""Iterations that take the error of the inverse cubic down to rounding, mostly."""
CONVERGED = 1e-7
"""Last correction of Newton's method that leaves rounding error after it."""
MOST_STRIKES = 10_000
"""Room for those of a pair whose samples alone are asked for."""


class Ensemble(NamedTuple):
    """What became of each of N pairs."""

    strikes: NDArray[np.void]
    """dtype STRIKE or, with extremes, WATCHED_STRIKE, shape (N, capacity); each row is filled up to its count."""
    counts: NDArray[np.int64]
    """Strikes of each pair, shape (N,)."""
    ends: NDArray[np.int64]
    """`End` of each pair, or TOO_FAST, shape (N,)."""
    durations: Floats
    """Time at each pair's end [s], shape (N,)."""
    tails: Floats
    """The least and the greatest phase difference since each pair's last strike, as in WATCHED_STRIKE; NaN without
    extremes. Shape (N, 2)."""


def run_ensemble(
    rig: RigParams,
    states: ArrayLike,
    seconds: float,
    capacity: int,
    tolerance: float = ENSEMBLE_TOLERANCE,
    strict: bool = True,
    extremes: bool = False,
    **columns: ArrayLike,
) -> Ensemble:
    """Run many pairs of one rig, each with its own start and, where given, its own parameters.

    Args:
        rig: what all pairs share.
        states: [θ1, ω1, θ2, ω2] of each pair, shape (N, 4).
        seconds: when to end.
        capacity: strikes to record of each pair; a pair with so many ends.
        tolerance: last term of the angles' series at the end of a step [rad].
        strict: a motion too fast to follow is an error; else its pair ends TOO_FAST.
        extremes: whether the phase difference between strikes is watched, which takes a fifth longer; `judge` needs it.
        columns: parameters by their (dotted) names, as `spread`.

    Raises:
        ValueError: an impossible parameter, state, limit or shape.
        MotionError: a motion is too fast to follow.

    """
    rigs = spread(rig, len(np.atleast_1d(states)), columns)
    return run_pairs(rigs, states, seconds, capacity, tolerance, strict, extremes)


def run_pairs(
    rigs: Rigs,
    states: ArrayLike,
    seconds: float,
    capacity: int,
    tolerance: float = ENSEMBLE_TOLERANCE,
    strict: bool = True,
    extremes: bool = False,
) -> Ensemble:
    """Run many pairs, each of its own rig.

    Args:
        rigs: as `spread` and `take` give them.
        states: as the other arguments, those of `run_ensemble`.
        seconds: when to end.
        capacity: strikes to record of each pair.
        tolerance: of the angles' series [rad].
        strict: whether a motion too fast to follow is an error.
        extremes: whether the phase difference between strikes is watched.

    Raises:
        ValueError: an impossible state, limit or shape.
        MotionError: a motion is too fast to follow.

    """
    starts = _accepted_starts(rigs, states)
    if not (seconds >= 0.0 and capacity >= 1 and tolerance > 0.0):
        raise ValueError(
            f'seconds must be ≥ 0, capacity ≥ 1 and tolerance > 0, got {seconds}, {capacity} and {tolerance}'
        )
    ensemble = _blank(len(starts), capacity, extremes)
    _follow(rigs, starts, seconds, tolerance, ensemble, True if extremes else None)
    if strict and (lost := np.flatnonzero(ensemble.ends == TOO_FAST)).size:
        raise MotionError(
            f'the motion of pair {lost[0]} at t = {ensemble.durations[lost[0]]:.9g} s is too fast to follow'
        )
    return ensemble


def sample_pairs(rigs: Rigs, states: Floats, times: Floats, tolerance: float = ENSEMBLE_TOLERANCE) -> Floats:
    """How far the wheels of many pairs have turned at given times, each pair of its own rig.

    ψ of each wheel as its stance spoke at the start counts it: θ + 2α n. Where a pair ends (`End`) it stays as it was.

    Args:
        rigs: of N pairs, as `spread` and `take` give them.
        states: [θ1, ω1, θ2, ω2] of each pair, as `run_ensemble`; shape (N, 4).
        times: since the start [s], ascending; shape (T,).
        tolerance: of the angles' series [rad].

    Returns:
        ψ1 and ψ2 [rad], shape (N, T, 2).

    Raises:
        ValueError: an impossible state.

    """
    starts = _accepted_starts(rigs, states)
    rotations = np.empty((len(starts), len(times), 2))
    _follow(rigs, starts, float(times[-1]), tolerance, _blank(len(starts), MOST_STRIKES), None, times, rotations)
    return rotations


def _accepted_starts(rigs: Rigs, states: ArrayLike) -> Floats:
    """The states of N pairs, which are possible."""
    starts, count = np.ascontiguousarray(states, float), len(rigs.k)
    if starts.shape != (count, 4):
        raise ValueError(f'states must be of shape (N, 4), got {starts.shape}')
    free = np.full(count, math.inf)
    limits = np.column_stack([rigs.front.alpha, free, rigs.rear.alpha, free]) * (1 + 1e-12)
    if not (np.isfinite(starts) & (np.abs(starts) <= limits)).all():
        raise ValueError('states must be finite, their angles within ±α of their wheels')
    return starts


def _follow(
    rigs: Rigs,
    starts: Floats,
    seconds: float,
    tolerance: float,
    ensemble: Ensemble,
    watched: Present,
    times: Floats | None = None,
    rotations: Floats | None = None,
) -> None:
    if len(starts):
        work, parameters = _aligned(SIZE), _parameters(rigs)
        with np.errstate(all='ignore'):
            seconds, friction = float(seconds), rubs(rigs)
            _run(work, parameters, starts, seconds, float(tolerance), friction, watched, times, rotations, *ensemble)


def spread(rig: RigParams, count: int, columns: Mapping[str, ArrayLike]) -> Rigs:
    """The rigs of N pairs, derived defaults filled in.

    Args:
        rig: what all pairs share.
        count: N.
        columns: parameters that differ from pair to pair, by their (dotted) names: shape (N,) or a scalar; NaN stands
            for the default where there is a derived one.

    Raises:
        ValueError: an unknown name, another shape, or an impossible parameter, as `accept`.

    """
    common = {field.name: lookup(rig, field.name) for field in FIELDS}
    values: dict[str, Floats] = {}
    if unknown := set(columns) - set(common):
        raise ValueError(f'{", ".join(sorted(unknown))} is not a parameter of a rig; known are {", ".join(common)}')
    for name, shared in common.items():
        value = np.asarray(columns.get(name, shared), float)
        if value.shape not in ((), (count,)):
            raise ValueError(f'{name} must be a scalar or of shape ({count},), got {value.shape}')
        values[name] = np.broadcast_to(value, (count,))
    front, rear = (Wheels(**{name: values.pop(f'{side}.{name}') for name in Wheels._fields}) for side in (FRONT, REAR))
    values['S0'] = default_stance_distance(values['S0'], front.length)
    values['D0'] = default_rest_length(values['D0'], values['S0'], front.length, front.alpha)
    rigs = Rigs(front=front, rear=rear, **values)
    if count:
        _check(rigs)
    return rigs


def _check(rigs: Rigs) -> None:
    """Refuse all pairs for one that `accept` refuses: one at the end of a column, or the stiffest."""
    for field in FIELDS:
        column = lookup(rigs, field.name)
        for index in (int(np.argmin(column)), int(np.argmax(column))):
            if not field.quantity.allows(float(column[index])):
                accept(rig_at(rigs, index))
    mass = 1.0 / (1.0 / rigs.front.mass + 1.0 / rigs.rear.mass)
    fastest = STIFFEST * np.sqrt(rigs.gravity / rigs.front.length)
    for stiffness in (
        rigs.k / (mass * fastest**2),
        rigs.b / (mass * fastest),
        rigs.coupler_friction / rigs.friction_speed / (mass * fastest),
        rigs.rolling_resistance / rigs.friction_speed / (fastest / rigs.gravity),
    ):
        if stiffness.max() > 1.0:
            accept(rig_at(rigs, int(np.argmax(stiffness))))


def _parameters(rigs: Rigs) -> Floats:
    """Parameter rows of each pair, shape (N, PARAMETERS), in the order of the work array."""
    parameters = np.empty((len(rigs.k), taylor.PARAMETERS))
    for row, value in {**work_parameters(rigs), taylor.S: rigs.S0}.items():
        parameters[:, _column(row)] = value
    return parameters


def _column(row: int) -> int:
    return (row - taylor.FIRST_PARAMETER) // LANES


def _blank(count: int, capacity: int, extremes: bool = False) -> Ensemble:
    """Room for what becomes of so many pairs."""
    counts, ends = np.zeros((2, count), np.int64)
    strikes = np.zeros((count, capacity), WATCHED_STRIKE if extremes else STRIKE)
    return Ensemble(strikes, counts, ends, np.zeros(count), np.zeros((count, 2)))


def _aligned(size: int) -> Floats:
    """Zeros on a cache line's boundary: a vector that straddles two lines costs twice."""
    raw = np.zeros(size + 8)
    offset = -raw.ctypes.data // raw.itemsize % 8
    return raw[offset : offset + size]


@compiled
def _guess_strike(start: Row, rate: Row, end: Row, end_rate: Row, aim: Row, step: Row) -> Row:
    """When a wheel comes to an angle, were time a cubic of its angle: exact at both ends of the step."""
    part = (aim - start) / (end - start)
    rest = 1.0 - part
    return part * part * (3.0 - 2.0 * part) * step + part * rest * (end - start) * (rest / rate - part / end_rate)


@compiled
def _find_strikes(work: Table) -> None:
    """When each wheel strikes if it rolls forward throughout its step; the step's end if it does not strike.

    Newton's method, which aims at the strike or at where the step ends, whichever is nearer.
    """
    w = rows(work, LANES)
    step = w[STEP]
    end1, rate1, end2, rate2 = motion(w, step, step)
    aim1, aim2 = minimum(end1, w[taylor.ALPHA1]), minimum(end2, w[taylor.ALPHA2])
    time1 = _guess_strike(w[THETA1], w[OMEGA1], end1, rate1, aim1, step)
    time2 = _guess_strike(w[THETA2], w[OMEGA2], end2, rate2, aim2, step)
    for _ in range(NEWTON_ITERATIONS):
        theta1, omega1, theta2, omega2 = motion(w, time1, time2)
        correction1, correction2 = (theta1 - aim1) / omega1, (theta2 - aim2) / omega2
        time1, time2 = time1 - correction1, time2 - correction2
        w[MISS1], w[MISS2] = abs(correction1), abs(correction2)
    w[STRIKE1], w[STRIKE2], w[AHEAD1], w[AHEAD2] = time1, time2, end1, end2
    w[SLOWEST1], w[SLOWEST2] = minimum(w[OMEGA1], rate1), minimum(w[OMEGA2], rate2)


@compiled
def _cut_steps(w: Table) -> None:
    """End each lane's step at its first strike; set which wheel strikes (0: none), and which way."""
    _find_strikes(w)
    for l in range(LANES):
        w[WHEEL + l] = 0.0
        for i in range(2):
            row = i * LANES + l
            alpha = w[taylor.ALPHA1 + row]
            if w[SLOWEST1 + row] > 0.0 and w[MISS1 + row] < CONVERGED:
                t, direction = max(w[STRIKE1 + row], 0.0), FORWARD if w[AHEAD1 + row] >= alpha else NONE
            else:  # it turns back or grazes its guard
                t, direction = first_strike(w, STATE[2 * i], STATE[2 * i + 1], l, alpha, w[STEP + l])
            if direction != NONE and (w[WHEEL + l] == 0.0 or t < w[STEP + l]):
                w[STEP + l], w[WHEEL + l], w[DIRECTION + l] = t, i + 1.0, direction


@compiled
def _acceleration(w: Table, l: int, i: int, theta: float, S: float) -> Row:
    """The acceleration of wheel i were it at rest at an angle and a stance distance."""
    l1, l2 = w[taylor.L1 + l], w[taylor.L2 + l]
    theta1, theta2 = (theta, w[THETA2 + l]) if i == 0 else (w[THETA1 + l], theta)
    p1 = l2 * math.sin(theta1 - theta2) + S * math.cos(theta1)
    p2 = l1 * math.sin(theta1 - theta2) + S * math.cos(theta2)
    dx, dy = l1 * math.sin(theta1) - l2 * math.sin(theta2) + S, l1 * math.cos(theta1) - l2 * math.cos(theta2)
    length = math.sqrt(dx * dx + dy * dy)
    rate = (-l2 * p2 * w[OMEGA2 + l] if i == 0 else l1 * p1 * w[OMEGA1 + l]) / length
    force = w[taylor.K + l] * (length - w[taylor.D0 + l]) + w[taylor.B + l] * rate
    pull = (force + w[taylor.RUB + l] * math.tanh(rate * w[taylor.INV_V0 + l])) / length
    torque = -p1 * pull * w[taylor.INV_ML1 + l] if i == 0 else p2 * pull * w[taylor.INV_ML2 + l]
    weight = math.sin(theta) * w[taylor.COS_SLOPE + l] + math.cos(theta) * w[taylor.SIN_SLOPE + l]
    return w[taylor.G1 + i * LANES + l] * weight + torque


@compiled
def _rest(w: Table, l: int, i: int) -> bool:
    """Whether wheel i, at rest on two spokes, stays so; else it is let go over the one it is pushed over.

    As `Simulation`, to the same end: see `dcdrw_sim.model.dynamics.tipping`.
    """
    theta, row = STATE[2 * i] + l, i * LANES + l
    alpha = w[taylor.ALPHA1 + row]
    if w[theta] > 0.0:  # the same place, told from the forward spoke
        w[STEPS1 + row] += 1.0
    S, stride = _stance_distance(w, l), w[STRIDE1 + row]
    forward, backward = _acceleration(w, l, i, -alpha, S), -_acceleration(w, l, i, alpha, S - stride)
    if max(forward, backward) <= 0.0:
        return True
    way = 1.0 if forward >= backward else -1.0
    if way < 0.0:
        w[STEPS1 + row] -= 1.0
    w[theta], w[STATE[2 * i + 1] + l], w[LAST1 + row] = -way * alpha, way * LEAVING_SPEED * w[SPEED1 + row], w[TIME + l]
    return False


@compiled
def _stance_distance(w: Table, l: int) -> Row:
    return w[S0 + l] + w[STEPS1 + l] * w[STRIDE1 + l] + w[STEPS2 + l] * w[STRIDE2 + l]


@compiled
def _load(w: Table, l: int, parameters: Floats, start: Floats, watched: Present) -> bool:
    """Put a pair at its start into a lane; whether a wheel stands there."""
    for row in range(taylor.PARAMETERS):
        w[taylor.FIRST_PARAMETER + row * LANES + l] = parameters[row]
    for row in range(TIME + l, SIZE, LANES):  # time, steps, and what happened last
        w[row] = 0.0
    w[THETA1 + l], w[OMEGA1 + l], w[THETA2 + l], w[OMEGA2 + l] = start
    w[S0 + l] = w[taylor.S + l]
    w[STRIDE1 + l] = 2.0 * w[taylor.L1 + l] * math.sin(w[taylor.ALPHA1 + l])
    w[STRIDE2 + l] = -2.0 * w[taylor.L2 + l] * math.sin(w[taylor.ALPHA2 + l])
    w[SPEED1 + l], w[SPEED2 + l] = math.sqrt(w[taylor.G1 + l]), math.sqrt(w[taylor.G2 + l])
    w[UNIT + l] = 1.0 / min(w[SPEED1 + l], w[SPEED2 + l])
    w[PITCH1 + l], w[PITCH2 + l] = 0.5 / w[taylor.ALPHA1 + l], 0.5 / w[taylor.ALPHA2 + l]
    stands = False
    for i in range(2):
        if w[STATE[2 * i + 1] + l] == 0.0 and abs(w[STATE[2 * i] + l]) >= w[taylor.ALPHA1 + i * LANES + l]:
            stands = _rest(w, l, i) or stands
            w[taylor.S + l] = _stance_distance(w, l)
    _watch_phase(w, l, watched)
    return stands


@compiled
def _watch_phase(w: Table, l: int, watched: Present) -> None:
    """Begin with the extremes of the phase difference anew."""
    if watched is not None:
        w[LOW + l] = w[HIGH + l] = w[THETA1 + l] * w[PITCH1 + l] - w[THETA2 + l] * w[PITCH2 + l]
        w[RATE + l] = w[OMEGA1 + l] * w[PITCH1 + l] - w[OMEGA2 + l] * w[PITCH2 + l]


@compiled
def _phase_range(w: Table, l: int, watched: Present) -> tuple[float, float]:
    """The extremes of the phase difference up to now; NaN where nobody watches it."""
    if watched is None:
        return math.nan, math.nan
    now = w[THETA1 + l] * w[PITCH1 + l] - w[THETA2 + l] * w[PITCH2 + l]
    return min(w[LOW + l], now), max(w[HIGH + l], now)


@compiled
def _record(w: Table, l: int, i: int, direction: int, watched: Present, record: NDArray[np.void]) -> None:
    """Note a strike of wheel i, its angle exactly on its guard."""
    w[STATE[2 * i] + l] = direction * w[taylor.ALPHA1 + i * LANES + l]
    record['wheel'], record['direction'], record['t'] = i + 1, direction, w[TIME + l]
    for j in range(4):
        record['state'][j] = w[STATE[j] + l]
    if watched is not None:
        record['low'], record['high'] = _phase_range(w, l, watched)


@compiled
def _strike(w: Table, l: int, i: int, direction: int, watched: Present) -> int:
    """Put wheel i on its next spoke; how the run ends with that, if it does."""
    theta, omega, row = STATE[2 * i] + l, STATE[2 * i + 1] + l, i * LANES + l
    w[theta], w[omega] = reset(w[taylor.ALPHA1 + row], w[taylor.KEPT1 + row], w[omega], direction)
    w[STEPS1 + row] += direction
    fallen = direction == BACKWARD and w[ROLLED1 + row] == BACKWARD
    w[LAST1 + row], w[ROLLED1 + row] = w[TIME + l], direction
    stands = abs(w[omega]) < STANDING_SPEED * w[SPEED1 + row] and _rest(w, l, i)
    w[taylor.S + l] = _stance_distance(w, l)
    _watch_phase(w, l, watched)
    return FALLEN if fallen else STANDING if stands else NONE_YET


@compiled
def _sample(w: Table, l: int, times: Floats, rotations: Floats) -> None:
    """Note how far the wheels have turned at those of the times that lie in the step that begins."""
    at = int(w[SAMPLED + l])
    while at < len(times) and times[at] <= w[TIME + l] + w[STEP + l]:
        for i in range(2):
            theta = evaluate(w, STATE[2 * i], l, times[at] - w[TIME + l])
            rotations[at, i] = theta + 2.0 * w[taylor.ALPHA1 + i * LANES + l] * w[STEPS1 + i * LANES + l]
        at += 1
    w[SAMPLED + l] = at


@compiled
def _hold(w: Table, l: int, rotations: Floats) -> None:
    """Note where a pair ended for all times that are left."""
    for at in range(int(w[SAMPLED + l]), len(rotations)):
        for i in range(2):
            turned = 2.0 * w[taylor.ALPHA1 + i * LANES + l] * w[STEPS1 + i * LANES + l]
            rotations[at, i] = w[STATE[2 * i] + l] + turned


@compiled
def _run(
    work: Floats,
    parameters: Floats,
    starts: Floats,
    seconds: float,
    tolerance: float,
    friction: Present,
    watched: Present,
    times: Floats | None,
    rotations: Floats | None,
    records: NDArray[np.void],
    counts: NDArray[np.int64],
    ends: NDArray[np.int64],
    durations: Floats,
    tails: Floats,
) -> None:
    """Run every pair: each lane takes the next one when its own has ended, and never waits for another."""
    w, lanes = bare(work), rows(bare(work), LANES)
    total, capacity = records.shape
    following, active = 0, 0
    for l in range(LANES):  # a lane without a pair computes something, and nobody looks
        _load(w, l, parameters[0], starts[0], watched)
        w[PAIR + l] = NO_PAIR
    while True:
        for l in range(LANES):
            while w[PAIR + l] == NO_PAIR and following < total:
                if _load(w, l, parameters[following], starts[following], watched):
                    ends[following] = STANDING
                    tails[following, 0], tails[following, 1] = _phase_range(w, l, watched)
                    if times is not None and rotations is not None:
                        _hold(w, l, rotations[following])
                else:
                    w[PAIR + l] = following
                    active += 1
                following += 1
        if active == 0:
            return
        expand(w, LANES, friction, None)
        for l in range(LANES):
            w[REACH + l] = min(step_size(w, l, tolerance), LONGEST_STEP * w[UNIT + l])
            if friction is not None:
                w[REACH + l] = friction_step(w, l, w[REACH + l])
            w[STEP + l] = max(0.0, min(w[REACH + l], seconds - w[TIME + l]))
        _cut_steps(w)
        theta1, omega1, theta2, omega2 = motion(lanes, lanes[STEP], lanes[STEP])
        if watched is not None:
            lanes[RATE_AHEAD] = omega1 * lanes[PITCH1] - omega2 * lanes[PITCH2]
            # Where it starts towards zero so fast that it may get there, the rate may change its sign twice.
            relative = lanes[OMEGA1 + LANES] * lanes[PITCH1] - lanes[OMEGA2 + LANES] * lanes[PITCH2]
            lanes[TANGENT] = lanes[RATE] + relative * lanes[STEP]
            for l in range(LANES):
                turns = w[RATE + l] * w[RATE_AHEAD + l] < 0.0 or w[RATE + l] * w[TANGENT + l] < 0.0
                if turns and w[PAIR + l] != NO_PAIR:
                    least, greatest = phase_extremes(w, l, w[PITCH1 + l], w[PITCH2 + l], w[STEP + l])
                    w[LOW + l], w[HIGH + l] = min(w[LOW + l], least), max(w[HIGH + l], greatest)
            lanes[RATE] = lanes[RATE_AHEAD]
        if times is not None and rotations is not None:
            for l in range(LANES):
                if w[PAIR + l] != NO_PAIR:
                    _sample(w, l, times, rotations[int(w[PAIR + l])])
        lanes[THETA1], lanes[OMEGA1], lanes[THETA2], lanes[OMEGA2] = theta1, omega1, theta2, omega2
        lanes[TIME] = lanes[TIME] + lanes[STEP]
        for l in range(LANES):
            if w[PAIR + l] == NO_PAIR:
                continue
            end, mine = NONE_YET, int(w[PAIR + l])
            if not w[taylor.LENGTH + l] > MIN_COUPLER_LENGTH * w[taylor.L1 + l]:
                end = HUBS_MET
            elif not w[REACH + l] >= SHORTEST_STEP * w[UNIT + l]:
                end = TOO_FAST
            elif w[WHEEL + l] > 0.0:
                i, direction = int(w[WHEEL + l]) - 1, int(w[DIRECTION + l])
                _record(w, l, i, direction, watched, records[mine, counts[mine]])
                counts[mine] += 1
                end = _strike(w, l, i, direction, watched)
                if end == NONE_YET and counts[mine] == capacity:
                    end = STRIKES
            if end == NONE_YET and w[TIME + l] >= seconds:
                end = TIME_OVER
            if end == NONE_YET and w[TIME + l] - min(w[LAST1 + l], w[LAST2 + l]) > STALL_TIME * w[UNIT + l]:
                end = STALLED
            if end != NONE_YET:
                ends[mine], durations[mine], w[PAIR + l] = end, w[TIME + l], NO_PAIR
                tails[mine, 0], tails[mine, 1] = _phase_range(w, l, watched)
                if times is not None and rotations is not None:
                    _hold(w, l, rotations[mine])
                active -= 1

"""Many pairs at once: trajectories side by side in the lanes of the Taylor kernel, compiled where numba is."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dcdrw_msgs_py.quantity import check
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim import taylor
from dcdrw_sim.compiled import compiled
from dcdrw_sim.simulation import work_parameters
from dcdrw_sim.strikes import BACKWARD, FORWARD, MIN_COUPLER_LENGTH, NONE, STALL_TIME, STANDING_SPEED, End, first_strike, reset
from dcdrw_sim.taylor import (ALPHA1, ALPHA2, FIRST_PARAMETER, G1, G2, L1, L2, LANES, LENGTH, OMEGA1, OMEGA2,
                              PARAMETERS, S, THETA1, THETA2, evaluate_lanes, expand, step_size)

Floats = NDArray[np.float64]

TOLERANCE = 5e-16
"""Last term of the angles' series at the end of a step [rad]: strikes within 1e-9 over 100 time units."""

STRIKE = np.dtype([('wheel', np.int8), ('direction', np.int8), ('t', float), ('state', float, (4,))])
"""One strike: wheel 1 or 2, direction, time [s], and the state just before it."""

STATE = (taylor.THETA1, taylor.OMEGA1, taylor.THETA2, taylor.OMEGA2)
# Plain numbers, which compile.
NONE_YET = -1
TIME_OVER, STRIKES, STANDING, FALLEN, STALLED, HUBS_MET = (int(end) for end in End)

COLUMNS = {'k': taylor.K, 'b': taylor.B, 'D0': taylor.D0, 'S0': taylor.S}
"""Parameters that may differ from pair to pair, beside the slope."""

# Rows of the work array behind those of the series.
(AHEAD1, AHEAD_RATE1, AHEAD2, AHEAD_RATE2, STRIKE1, STRIKE2, HIT1, HIT2, MISS1, MISS2, VALUE, RATE, STEP, TIME, WHEEL, DIRECTION,
 S0, STRIDE1, STRIDE2, PATIENCE, SIZE) = range(taylor.END, taylor.END + 21 * LANES, LANES)
NEWTON_ITERATIONS = 4
"""From the chord's error of a few percent of a step down to rounding, mostly."""
CONVERGED = 1e-7
"""Last correction of Newton's method that leaves rounding error after it."""


class Ensemble(NamedTuple):
    """What became of each of N pairs."""

    strikes: NDArray[Any]
    """dtype STRIKE, shape (N, capacity); each row is filled up to its count."""
    counts: NDArray[np.int64]
    """Strikes of each pair, shape (N,)."""
    ends: NDArray[np.int64]
    """`End` of each pair, shape (N,)."""
    durations: Floats
    """Time at each pair's end [s], shape (N,)."""


def run_ensemble(rig: RigParams, states: ArrayLike, seconds: float, capacity: int, **columns: ArrayLike) -> Ensemble:
    """Run many pairs of one rig, each with its own start and, where given, its own k, b, D0, S0 or slope.

    Args:
        rig: what all pairs share.
        states: [θ1, ω1, θ2, ω2] of each pair, shape (N, 4).
        seconds: when to end.
        capacity: strikes to record of each pair; a pair with so many ends.
        columns: k, b, D0, S0, slope: shape (N,) or a scalar.

    Raises:
        ValueError: an impossible parameter, state or shape.

    """
    starts = np.ascontiguousarray(states, float)
    if starts.ndim != 2 or starts.shape[1] != 4:
        raise ValueError(f'states must be of shape (N, 4), got {starts.shape}')
    rig = check(rig).resolved()
    limits = np.array([rig.front.alpha, math.inf, rig.rear.alpha, math.inf]) * (1 + 1e-12)
    if not (np.abs(starts) <= limits).all() or not np.isfinite(starts).all():
        raise ValueError('states must be finite, their angles within ±α of their wheels')
    count = len(starts)
    ensemble = Ensemble(np.zeros((count, capacity), STRIKE), np.zeros(count, np.int64), np.zeros(count, np.int64),
                        np.zeros(count))
    _run(_aligned(SIZE), _parameters(rig, count, columns), starts, float(seconds), *ensemble)
    return ensemble


def _parameters(rig: RigParams, count: int, columns: dict[str, ArrayLike]) -> Floats:
    """Parameter rows of each pair, shape (N, PARAMETERS), in the order of the work array."""
    lane = [0.0] * SIZE
    work_parameters(lane, 0, rig)
    lane[taylor.S] = rig.S0
    parameters = np.tile(lane[FIRST_PARAMETER::LANES], (count, 1))
    for name, values in columns.items():
        values = np.asarray(values, float)
        check(rig._replace(**{name: float(values.min())})), check(rig._replace(**{name: float(values.max())}))
        if name == 'slope':
            parameters[:, _column(taylor.COS_SLOPE)] = np.cos(values)
            parameters[:, _column(taylor.SIN_SLOPE)] = np.sin(values)
        else:
            parameters[:, _column(COLUMNS[name])] = values
    return parameters


def _column(row: int) -> int:
    return (row - FIRST_PARAMETER) // LANES


def _aligned(size: int) -> Floats:
    """Zeros on a cache line's boundary: a vector that straddles two lines costs twice."""
    raw = np.zeros(size + 8)
    offset = -raw.ctypes.data // raw.itemsize % 8
    return raw[offset:offset + size]


@compiled
def _load(w: Any, l: int, parameters: Any, start: Any) -> None:
    """Put a pair at its start into a lane."""
    for row in range(PARAMETERS):
        w[FIRST_PARAMETER + row * LANES + l] = parameters[row]
    w[THETA1 + l], w[OMEGA1 + l], w[THETA2 + l], w[OMEGA2 + l] = start
    w[S0 + l], w[TIME + l] = w[S + l], 0.0
    w[STRIDE1 + l] = 2.0 * w[L1 + l] * math.sin(w[ALPHA1 + l])
    w[STRIDE2 + l] = 2.0 * w[L2 + l] * math.sin(w[ALPHA2 + l])
    w[PATIENCE + l] = STALL_TIME / math.sqrt(min(w[G1 + l], w[G2 + l]))


@compiled
def _strike_times(w: Any, theta: int, omega: int, alpha: int, ahead: int, strike: int) -> None:
    """When each lane's wheel, rolling forward throughout its step, strikes: Newton's method from the chord.

    Fills the rows `strike`, and with them whether it strikes (HIT) and the last correction (MISS).
    """
    hit, miss = strike + HIT1 - STRIKE1, strike + MISS1 - STRIKE1
    for l in range(LANES):
        w[hit + l] = 1.0 if w[ahead + l] >= w[alpha + l] else 0.0
        chord = (w[alpha + l] - w[theta + l]) / (w[ahead + l] - w[theta + l])
        w[strike + l] = w[STEP + l] * chord
    for _ in range(NEWTON_ITERATIONS):
        evaluate_lanes(w, VALUE, theta, strike, LANES)
        evaluate_lanes(w, RATE, omega, strike, LANES)
        for l in range(LANES):
            correction = (w[VALUE + l] - w[alpha + l]) / w[RATE + l]
            w[miss + l] = abs(correction) if w[hit + l] > 0.0 else 0.0
            w[strike + l] = w[strike + l] - correction if w[hit + l] > 0.0 else w[STEP + l]


@compiled
def _cut_steps(w: Any) -> None:
    """End each lane's step at its first strike; set which wheel strikes (0: none), and which way."""
    for i in range(4):
        evaluate_lanes(w, AHEAD1 + i * LANES, STATE[i], STEP, LANES)
    _strike_times(w, THETA1, OMEGA1, ALPHA1, AHEAD1, STRIKE1)
    _strike_times(w, THETA2, OMEGA2, ALPHA2, AHEAD2, STRIKE2)
    for l in range(LANES):
        slowest = min(min(w[OMEGA1 + l], w[OMEGA2 + l]), min(w[AHEAD_RATE1 + l], w[AHEAD_RATE2 + l]))
        if slowest > 0.0 and max(w[MISS1 + l], w[MISS2 + l]) < CONVERGED:
            front_first = w[HIT1 + l] > 0.0 and (w[HIT2 + l] == 0.0 or w[STRIKE1 + l] <= w[STRIKE2 + l])
            w[WHEEL + l] = 1.0 if front_first else 2.0 * w[HIT2 + l]
            w[DIRECTION + l] = FORWARD
            w[STEP + l] = max(0.0, min(w[STRIKE1 + l], w[STRIKE2 + l]))
        else:  # a wheel turns back or grazes its guard
            w[WHEEL + l] = 0.0
            for i in range(2):
                alpha = w[ALPHA1 + i * LANES + l]
                t, direction = first_strike(w, STATE[2 * i], STATE[2 * i + 1], l, alpha, w[STEP + l])
                if direction != NONE and (w[WHEEL + l] == 0.0 or t < w[STEP + l]):
                    w[STEP + l], w[WHEEL + l], w[DIRECTION + l] = t, i + 1.0, direction


@compiled
def _record(w: Any, l: int, strike: Any, wheel: int, direction: int) -> None:
    strike.wheel, strike.direction, strike.t = wheel, direction, w[TIME + l]
    for j in range(4):
        strike.state[j] = w[STATE[j] + l]


@compiled
def _run(w: Any, parameters: Any, starts: Any, seconds: float, strikes: Any, counts: Any, ends: Any, durations: Any) -> None:
    """Run every pair: each lane takes the next one when its own has ended, and never waits for another."""
    total, capacity = strikes.shape
    pair = np.full(LANES, -1)
    steps, last_strike, last_direction = np.zeros((2, LANES)), np.zeros((2, LANES)), np.zeros((2, LANES))
    following, active = 0, 0
    for l in range(LANES):  # a lane without a pair computes what the first one does, and nobody looks
        _load(w, l, parameters[0], starts[0])
    while True:
        for l in range(LANES):
            if pair[l] < 0 and following < total:
                _load(w, l, parameters[following], starts[following])
                pair[l] = following
                steps[:, l], last_strike[:, l], last_direction[:, l] = 0.0, 0.0, 0.0
                following, active = following + 1, active + 1
        if active == 0:
            return
        expand(w, LANES)
        for l in range(LANES):
            w[STEP + l] = min(step_size(w, l, TOLERANCE), seconds - w[TIME + l])
        _cut_steps(w)
        for i in range(4):
            evaluate_lanes(w, STATE[i], STATE[i], STEP, LANES)
        for l in range(LANES):
            w[TIME + l] += w[STEP + l]
        for l in range(LANES):
            end, mine = NONE_YET, pair[l]
            if mine < 0:
                continue
            if w[LENGTH + l] < MIN_COUPLER_LENGTH * w[L1 + l]:
                end = HUBS_MET
            elif w[WHEEL + l] > 0.0:
                i, direction = int(w[WHEEL + l]) - 1, int(w[DIRECTION + l])
                theta, omega, alpha = STATE[2 * i], STATE[2 * i + 1], w[ALPHA1 + i * LANES + l]
                w[theta + l] = direction * alpha
                _record(w, l, strikes[mine, counts[mine]], i + 1, direction)
                counts[mine] += 1
                w[theta + l], w[omega + l] = reset(alpha, w[omega + l], direction)
                steps[i, l] += direction
                w[S + l] = w[S0 + l] + steps[0, l] * w[STRIDE1 + l] - steps[1, l] * w[STRIDE2 + l]
                if abs(w[omega + l]) < STANDING_SPEED * math.sqrt(w[G1 + i * LANES + l]):
                    end = STANDING
                elif direction == BACKWARD and last_direction[i, l] == BACKWARD:
                    end = FALLEN
                elif counts[mine] == capacity:
                    end = STRIKES
                last_strike[i, l], last_direction[i, l] = w[TIME + l], direction
            elif w[TIME + l] - min(last_strike[0, l], last_strike[1, l]) > w[PATIENCE + l]:
                end = STALLED
            if end == NONE_YET and w[TIME + l] >= seconds:
                end = TIME_OVER
            if end != NONE_YET:
                ends[mine], durations[mine], pair[l] = end, w[TIME + l], -1
                active -= 1

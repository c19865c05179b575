"""What became of a motion: whether the pair walks in step, from when on, or what comes in the way.

In step is what `dcdrw_msgs_py.in_step` says: the error stays within a band at every later instant, its extremes between
strikes taken exactly. `strike_steps` looks at the strikes of the front wheel only. The paper's condition is |θ2| ≤ BAND
at the section, the instant before a strike of the front wheel (θ1 = α1): at some strike (`enters`) or from some strike
on (`settles`).

A judgement tells what a motion did while it was simulated; what it would go on to do, the return map tells
(`dcdrw_sim.study.points`).
"""

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.in_step import BAND_PERCENT, HOLD_STEPS, in_step_from, strikes_in_step, wrapped_percent
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.model.rigs import Rigs
from dcdrw_sim.motion.compiled import compiled
from dcdrw_sim.motion.ends import BACKWARD, FORWARD
from dcdrw_sim.motion.ensemble import FALLEN, HUBS_MET, STALLED, STANDING, TOO_FAST, Ensemble

BAND = math.radians(1.0)
"""The paper's condition: |θ2| at the section is at most this [rad]."""
HOLD = 5
"""The last sections, by which settling, steadiness and rocking are judged."""
STEADY = 1e-5
"""Less change of θ2 per step is none [rad]: it may add up to 0.1° more where only 0.5 % of an error go per step."""
LATE = 3.0
"""A wheel that has not struck for so many steps' time hangs."""


class Verdict(IntEnum):
    """What became of a motion, from the best to the worst: the worst of several is their maximum."""

    IN_STEP = 0
    UNDECIDED = 1
    SWINGS = 2
    ELSEWHERE = 3
    STALLS = 4
    STANDS = 5
    FALLS = 6
    COLLIDES = 7
    RACES = 8

    @property
    def meaning(self) -> str:
        """The verdict in words."""
        return _MEANINGS[self]


_MEANINGS = {
    Verdict.IN_STEP: 'walks in step: within the band at every instant',
    Verdict.UNDECIDED: 'walks, but neither in step nor steadily when the time is over',
    Verdict.SWINGS: 'walks steadily, within the band at strikes, but swings beyond it between them',
    Verdict.ELSEWHERE: 'walks steadily at another phase, beyond the band',
    Verdict.STALLS: 'a wheel fails to pass its apex: it rocks back, or hangs',
    Verdict.STANDS: 'a wheel failed to pass its apex, rocked, and stands still on two spokes',
    Verdict.FALLS: 'a wheel was pushed over and rolls uphill',
    Verdict.COLLIDES: 'the hubs met',
    Verdict.RACES: 'the motion became too fast to follow',
}
# Plain numbers, which compile.
_IN_STEP, _UNDECIDED, _SWINGS, _ELSEWHERE, _STALLS, _STANDS, _FALLS, _COLLIDES, _RACES = (int(v) for v in Verdict)


class Sections(NamedTuple):
    """The states of N motions at their sections, shape (N, M) each; NaN after the last one."""

    time: Floats
    """[s]"""
    omega1: Floats
    """θ1′ [rad/s]"""
    theta2: Floats
    """[rad]"""
    omega2: Floats
    """θ2′ [rad/s]"""
    coupler_length: Floats
    """D [m]; a function of θ2 where no step was slipped."""


class Judgement(NamedTuple):
    """What became of each of N motions; shape (N,) each. Steps are those of the front wheel, the start counts as 0."""

    verdict: NDArray[np.int8]
    """`Verdict`."""
    steps: Floats
    """To synchronization: strikes up to the one from which on the pair is in step; NaN where it is not at the end."""
    time: Floats
    """Time of that strike [s]."""
    strike_steps: Floats
    """Strikes up to the one from which on the error at every strike is within the band; NaN where it is not."""
    enters: NDArray[np.bool_]
    """Whether |θ2| ≤ BAND at some section: the paper's condition, whatever came after."""
    steps_to_enter: Floats
    """Strikes up to the first such section; NaN where there is none."""
    time_to_enter: Floats
    """[s]"""
    settles: NDArray[np.bool_]
    """Whether |θ2| ≤ BAND at the last HOLD sections, of a motion that walks on."""
    steps_to_settle: Floats
    """Strikes up to the first of those; NaN where it does not settle."""
    theta2: Floats
    """θ2 at the last section [rad]; NaN where there was none."""
    sections: NDArray[np.int64]
    """How many the motion went through; the first is the start where that is one."""
    step_difference: NDArray[np.int64]
    """n at the last section."""
    slips: NDArray[np.int64]
    """How often n at the section changed: a wheel struck twice in a row."""


def judge(
    ensemble: Ensemble, rigs: Rigs, capacity: int, band_percent: float = BAND_PERCENT, theta2_band: float = BAND
) -> tuple[Judgement, Sections]:
    """Judge each motion of an ensemble.

    Args:
        ensemble: N motions.
        rigs: theirs, as `dcdrw_sim.motion.ensemble.spread` gives them.
        capacity: M, how many sections to return of each motion; the judgement sees all.
        band_percent: in step is within ± this [% of a step].
        theta2_band: in place of BAND [rad].

    Raises:
        ValueError: the motions were run without their extremes, on which "in step at every instant" rests.

    """
    if np.isnan(ensemble.tails).any():
        raise ValueError('these motions have no extremes between strikes to judge: run them with extremes=True')
    total = len(ensemble.counts)
    sections = Sections(*(np.full((total, capacity), math.nan) for _ in Sections._fields))
    steps, time, strike_steps, steps_to_enter, time_to_enter, steps_to_settle, theta2 = np.full((7, total), math.nan)
    counts, step_difference, slips = np.zeros((3, total), np.int64)
    enters, settles = np.zeros((2, total), np.bool_)
    judgement = Judgement(
        np.zeros(total, np.int8),
        steps,
        time,
        strike_steps,
        enters,
        steps_to_enter,
        time_to_enter,
        settles,
        steps_to_settle,
        theta2,
        counts,
        step_difference,
        slips,
    )
    front, rear = rigs.front, rigs.rear
    wheels = np.column_stack([front.length, front.alpha, rear.length, rear.alpha, rigs.S0])
    bands = float(band_percent), float(theta2_band)
    _judge(*ensemble, wheels, *bands, *judgement, *sections)
    return judgement, sections


@compiled
def _judge(  # Any: the arrays of Ensemble, Judgement and Sections, which mypy cannot unpack one by one
    strikes: Any,
    strike_counts: Any,
    ends: Any,
    durations: Any,
    tails: Any,
    wheels: Any,
    band_percent: float,
    band: float,
    verdict: Any,
    steps: Any,
    time: Any,
    strike_steps: Any,
    enters: Any,
    steps_to_enter: Any,
    time_to_enter: Any,
    settles: Any,
    steps_to_settle: Any,
    last_theta2: Any,
    counts: Any,
    step_difference: Any,
    slips: Any,
    times: Any,
    omega1s: Any,
    theta2s: Any,
    omega2s: Any,
    lengths: Any,
) -> None:
    capacity = times.shape[1]
    for i in range(len(ends)):
        l1, alpha1, l2, alpha2, S = wheels[i]
        sigma1, sigma2 = 2.0 * l1 * math.sin(alpha1), 2.0 * l2 * math.sin(alpha2)
        n, count, steady, rocked, first = 0, 0, 0, -HOLD, 0
        step, since, since_at_strikes, since_time = 0, 0, 0, 0.0
        inside = -1  # section since which |θ2| is within the band, if it is
        front, rear, period, theta2 = 0.0, 0.0, math.inf, math.nan
        for j in range(strike_counts[i]):
            strike = strikes[i, j]
            direction, now = strike['direction'], strike['t']
            low = wrapped_percent(strike['low'])
            since = in_step_from(since, step, low, low + 100.0 * (strike['high'] - strike['low']), band_percent)
            if direction == BACKWARD:
                rocked = count
            if strike['wheel'] == 2:
                n, S, rear = n - direction, S - direction * sigma2, now
                continue
            if direction == FORWARD:
                before, theta2 = theta2, strike['state'][2]
                change = (theta2 - before + alpha2) % (2.0 * alpha2) - alpha2
                steady = steady + 1 if abs(change) < STEADY else 0
                if count == 0 and now > 0.0:
                    first = 1
                if abs(theta2) > band:
                    inside = -1
                elif inside < 0:
                    inside = count
                    if not enters[i]:
                        enters[i], steps_to_enter[i], time_to_enter[i] = True, count + first, now
                if count < capacity:
                    times[i, count], omega1s[i, count] = now, strike['state'][1]
                    theta2s[i, count], omega2s[i, count] = theta2, strike['state'][3]
                    dx = l1 * math.sin(alpha1) - l2 * math.sin(theta2) + S
                    dy = l1 * math.cos(alpha1) - l2 * math.cos(theta2)
                    lengths[i, count] = math.sqrt(dx * dx + dy * dy)
                period = now - front if count else math.inf
                slips[i] += n != step_difference[i]
                step_difference[i] = n
                count += 1
            if now > 0.0:  # the strike at the start opens step 0
                step += direction
            error = wrapped_percent(0.5 - 0.5 * strike['state'][2] / alpha2)
            since_at_strikes = in_step_from(since_at_strikes, step, error, error, band_percent)
            if since == step:
                since_time = now
            n, S, front = n + direction, S + direction * sigma1, now
        low = wrapped_percent(tails[i, 0])
        since = in_step_from(since, step, low, low + 100.0 * (tails[i, 1] - tails[i, 0]), band_percent)
        counts[i], last_theta2[i] = count, theta2
        end, late = ends[i], durations[i] - LATE * period
        if end == TOO_FAST:
            verdict[i] = _RACES
        elif end == HUBS_MET:
            verdict[i] = _COLLIDES
        elif end == FALLEN:
            verdict[i] = _FALLS
        elif end == STANDING:
            verdict[i] = _STANDS
        elif end == STALLED or front < late or rear < late or count - rocked < HOLD:
            verdict[i] = _STALLS
        else:
            at_strikes = strikes_in_step(since_at_strikes, step) >= HOLD_STEPS
            if at_strikes:
                strike_steps[i] = since_at_strikes
            if inside >= 0 and count - inside >= HOLD:
                settles[i], steps_to_settle[i] = True, inside + first
            if strikes_in_step(since, step) >= HOLD_STEPS:
                verdict[i], steps[i], time[i] = _IN_STEP, since, since_time
            elif steady < HOLD:
                verdict[i] = _UNDECIDED
            else:
                verdict[i] = _SWINGS if at_strikes else _ELSEWHERE

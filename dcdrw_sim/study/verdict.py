"""What became of a motion: whether the pair falls into step, how fast, or what comes in the way.

The goal is φ = α. At the section, the instant before a strike of the front wheel (θ1 = α1), that is θ2 = 0: so
|θ2| ≤ BAND there is the paper's condition, at some strike (`enters`) or from some strike on (`settles`). The limit
cycle of a pair has θ2 near 0, not at it, and what is left counts: a pair whose limit cycle lies outside the band never
settles.
"""

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_sim.model.rigs import Rigs
from dcdrw_sim.motion.compiled import compiled
from dcdrw_sim.motion.ends import BACKWARD, FORWARD
from dcdrw_sim.motion.ensemble import FALLEN, HUBS_MET, STALLED, STANDING, TOO_FAST, Ensemble

Floats = NDArray[np.float64]

BAND = math.radians(1.0)
"""The paper's condition: |θ2| at the section is at most this [rad]."""
HOLD = 5
"""The last strikes, by which a motion is judged."""
STEADY = 1e-5
"""Less change of θ2 per step is none [rad]: it may add up to 0.1° more where only 0.5 % of an error go per step."""
LATE = 3.0
"""A wheel that has not struck for so many steps' time hangs."""


class Verdict(IntEnum):
    """What became of a motion, from the best to the worst: the worst of several is their maximum."""

    SETTLES = 0
    ENTERS = 1
    UNDECIDED = 2
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
    Verdict.SETTLES: 'walks in step: within the band at the last strikes',
    Verdict.ENTERS: 'was within the band at some strike, but not at the last ones',
    Verdict.UNDECIDED: 'walks, but neither within the band nor steadily when the time is over',
    Verdict.ELSEWHERE: 'walks steadily at another phase, beyond the band',
    Verdict.STALLS: 'a wheel fails to pass its apex: it rocks back, or hangs',
    Verdict.STANDS: 'a wheel failed to pass its apex, rocked, and stands still on two spokes',
    Verdict.FALLS: 'a wheel was pushed over and rolls uphill',
    Verdict.COLLIDES: 'the hubs met',
    Verdict.RACES: 'the motion became too fast to follow',
}
# Plain numbers, which compile.
_SETTLES, _ENTERS, _UNDECIDED, _ELSEWHERE, _STALLS, _STANDS, _FALLS, _COLLIDES, _RACES = (int(v) for v in Verdict)


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
    """What became of each of N motions; shape (N,) each."""

    verdict: NDArray[np.int8]
    """`Verdict`."""
    enters: NDArray[np.bool_]
    """Whether |θ2| ≤ BAND at some section: the paper's condition, whatever came after."""
    steps_to_enter: Floats
    """Steps of the front wheel to the first such section; NaN where there is none."""
    time_to_enter: Floats
    """[s]"""
    steps: Floats
    """Steps of the front wheel until |θ2| stays within BAND; NaN where it does not settle."""
    time: Floats
    """The same as time [s]."""
    theta2: Floats
    """At the last section [rad]; NaN where there was none."""
    sections: NDArray[np.int64]
    """How many the motion went through; the first is the start where that is one."""
    step_difference: NDArray[np.int64]
    """n at the last section."""
    slips: NDArray[np.int64]
    """How often n at the section changed: a wheel struck twice in a row."""


def judge(ensemble: Ensemble, rigs: Rigs, capacity: int, band: float = BAND) -> tuple[Judgement, Sections]:
    """Judge each motion of an ensemble.

    Args:
        ensemble: N motions.
        rigs: theirs, as `dcdrw_sim.motion.ensemble.spread` gives them.
        capacity: M, how many sections to return of each motion; the judgement sees all.
        band: in place of BAND [rad].

    """
    total = len(ensemble.counts)
    sections = Sections(*(np.full((total, capacity), math.nan) for _ in Sections._fields))
    judgement = Judgement(
        np.zeros(total, np.int8),
        np.zeros(total, np.bool_),
        *(np.full(total, math.nan) for _ in range(5)),
        *(np.zeros(total, np.int64) for _ in range(3)),
    )
    front, rear = rigs.front, rigs.rear
    wheels = np.column_stack([front.length, front.alpha, rear.length, rear.alpha, rigs.S0])
    _judge(
        ensemble.strikes, ensemble.counts, ensemble.ends, ensemble.durations, wheels, float(band), *judgement, *sections
    )
    return judgement, sections


@compiled
def _judge(
    strikes: Any,
    strike_counts: Any,
    ends: Any,
    durations: Any,
    wheels: Any,
    band: float,
    verdict: Any,
    enters: Any,
    steps_to_enter: Any,
    time_to_enter: Any,
    steps: Any,
    time: Any,
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
        n, count, steady, rocked = 0, 0, 0, -HOLD
        inside, inside_since, entered = -1, 0.0, -1  # section since which |θ2| is within the band, if it is
        front, rear, period, theta2 = 0.0, 0.0, math.inf, math.nan
        for j in range(strike_counts[i]):
            strike = strikes[i, j]
            direction, now = strike['direction'], strike['t']
            if direction == BACKWARD:
                rocked = count
            if strike['wheel'] == 2:
                n, S, rear = n - direction, S - direction * sigma2, now
                continue
            if direction == FORWARD:
                before, theta2 = theta2, strike['state'][2]
                change = (theta2 - before + alpha2) % (2.0 * alpha2) - alpha2
                steady = steady + 1 if abs(change) < STEADY else 0
                if abs(theta2) > band:
                    inside = -1
                elif inside < 0:
                    inside, inside_since = count, now
                    if entered < 0:
                        entered, enters[i], steps_to_enter[i], time_to_enter[i] = count, True, count, now
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
            n, S, front = n + direction, S + direction * sigma1, now
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
        elif inside >= 0 and count - inside >= HOLD:
            verdict[i], steps[i], time[i] = _SETTLES, inside, inside_since
        elif steady >= HOLD:
            verdict[i] = _ELSEWHERE
        elif entered >= 0:
            verdict[i] = _ENTERS
        else:
            verdict[i] = _UNDECIDED

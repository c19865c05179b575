"""Strikes: where the next spoke meets the ground, what that does to the wheel, and how a run can end."""

import math
from enum import IntEnum
from typing import NamedTuple

from dcdrw_sim.model.dynamics import State
from dcdrw_sim.motion.taylor import LANES, ORDER, Work, evaluate

FORWARD, NONE, BACKWARD = 1, 0, -1


class End(IntEnum):
    """Why a run ended."""

    TIME = 0
    STRIKES = 1
    STANDING = 2
    FALLEN = 3
    STALLED = 4
    HUBS_MET = 5

    @property
    def meaning(self) -> str:
        """The reason in words."""
        return _MEANINGS[self]


_MEANINGS = {
    End.TIME: 'the time asked for is over',
    End.STRIKES: 'as many strikes as asked for',
    End.STANDING: 'a wheel did not pass its apex, rocked, and stands still on two spokes',
    End.FALLEN: 'a wheel was pushed over: it passed its apex backwards and rolls uphill',
    End.STALLED: 'a wheel hangs: no strike for longer than it could balance on its apex',
    End.HUBS_MET: 'the hubs met: the coupler has no length and no direction left',
}

STANDING_SPEED = 1e-6
"""A wheel that leaves a strike slower than this, in √(g/ℓ), and is pressed on both spokes, stands."""
STALL_TIME = 50.0
"""No strike for this long, in √(ℓ/g): from rounding error alone a wheel leaves its apex in about 36."""
MIN_COUPLER_LENGTH = 1e-6
"""Coupler length, in ℓ, at which the hubs count as met."""


class Strike(NamedTuple):
    """One strike, as the reference files hold it."""

    wheel: int
    """1 the front, 2 the rear."""
    t: float
    """[s]"""
    state: State
    """Just before."""
    direction: int
    """FORWARD, or BACKWARD where the wheel rocks or rolls uphill."""


def reset(alpha: float, omega: float, direction: int) -> tuple[float, float]:
    """Angle and speed after a strike: rules A and B of the paper, and their mirror for a wheel that rolls back.

    Angular momentum about the new stance foot is kept, so the speed falls by cos 2α.
    """
    return -direction * alpha, omega * math.cos(2.0 * alpha)


def crossing(w: Work, series: int, l: int, target: float, low: float, high: float) -> float:
    """The time in [low, high] at which a monotonic series passes a value, to rounding.

    Newton's method from the chord, kept within its bracket by bisection. A series that has passed the value
    at `low` already gives `low`.
    """
    at_low = evaluate(w, series, l, low) - target
    at_high = evaluate(w, series, l, high) - target
    if at_high == 0.0 != at_low:
        return high
    if at_low == 0.0 or (at_low > 0.0) == (at_high > 0.0):
        return low
    near = 1e-10 * (high - low)
    part = at_low / (at_low - at_high)
    t = low + (high - low) * (part if low == 0.0 else math.sqrt(part))
    for _ in range(100):
        value, slope = 0.0, 0.0
        for j in range(series + ORDER * LANES + l, series + l - 1, -LANES):
            slope = slope * t + value
            value = value * t + w[j]
        value -= target
        if (value > 0.0) == (at_high > 0.0):
            high = t
        else:
            low = t
        correction = value / slope if slope != 0.0 else math.inf
        t -= correction
        if abs(correction) <= near:
            break
        if not low <= t <= high:
            t = 0.5 * (low + high)
    return t


def first_strike(w: Work, theta: int, omega: int, l: int, alpha: float, h: float) -> tuple[float, int]:
    """Time and direction of a wheel's first strike within a step h; (h, NONE) where there is none.

    A step holds at most one turning point of the wheel, so the motion is monotonic before and after it: a
    forward strike can only happen while the wheel rolls forward, a backward one while it rolls back.
    """
    start, end = w[omega + l], evaluate(w, omega, l, h)
    turn = h
    if start * end < 0.0:
        turn = crossing(w, omega, l, 0.0, 0.0, h)
    low, high = 0.0, turn
    rolls_forward = start > 0.0 or (start == 0.0 and end > 0.0)
    for _ in range(2):
        reached = evaluate(w, theta, l, high)
        if rolls_forward and reached >= alpha:
            return crossing(w, theta, l, alpha, low, high), FORWARD
        if not rolls_forward and reached <= -alpha:
            return crossing(w, theta, l, -alpha, low, high), BACKWARD
        if turn == h:
            break
        low, high, rolls_forward = turn, h, not rolls_forward
    return h, NONE

"""Events within a step: when a series passes a value, and when a wheel's next spoke meets the ground."""

import math

from dcdrw_sim.motion.ends import BACKWARD, FORWARD, NONE
from dcdrw_sim.motion.taylor import LANES, ORDER, Work, evaluate


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

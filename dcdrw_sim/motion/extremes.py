"""Extremes of the phase difference within a step of the integrator, exactly: where ω1/2α1 = ω2/2α2.

Between strikes the phase difference p is, whole steps aside, q = θ1/2α1 − θ2/2α2, as smooth as the motion.
"""

import math

from dcdrw_sim.motion import taylor
from dcdrw_sim.motion.events import crossing
from dcdrw_sim.motion.taylor import LANES, LEVER1, LEVER2, ORDER, Work, evaluate

# By now these series have done their duty; expanding the motion anew fills them anew.
_RATE, _SLOPE = LEVER1, LEVER2


def phase_extremes(w: Work, l: int, pitch1: float, pitch2: float, h: float) -> tuple[float, float]:
    """The least and greatest q [steps] at the turning points within a step h; (∞, −∞) where it has none.

    A step of the integrator holds at most one extreme of the rate of q, so q turns at most twice.

    Args:
        w: work array, expanded; the series of the levers are overwritten.
        l: lane.
        pitch1: 1/2α1 [1/rad].
        pitch2: 1/2α2 [1/rad].
        h: the step.

    """
    for j in range(l, ORDER * LANES + l + 1, LANES):
        w[_RATE + j] = pitch1 * w[taylor.OMEGA1 + j] - pitch2 * w[taylor.OMEGA2 + j]
    start, end = w[_RATE + l], evaluate(w, _RATE, l, h)
    if start * end < 0.0:
        once = phase_at(w, l, pitch1, pitch2, crossing(w, _RATE, l, 0.0, 0.0, h))
        return once, once
    for j in range(ORDER):
        w[_SLOPE + j * LANES + l] = (j + 1) * w[_RATE + (j + 1) * LANES + l]
    w[_SLOPE + ORDER * LANES + l] = 0.0
    middle = crossing(w, _SLOPE, l, 0.0, 0.0, h)
    if start * evaluate(w, _RATE, l, middle) >= 0.0:
        return math.inf, -math.inf
    first = phase_at(w, l, pitch1, pitch2, crossing(w, _RATE, l, 0.0, 0.0, middle))
    second = phase_at(w, l, pitch1, pitch2, crossing(w, _RATE, l, 0.0, middle, h))
    return min(first, second), max(first, second)


def phase_at(w: Work, l: int, pitch1: float, pitch2: float, t: float) -> float:
    """q [steps] at a time t from the start of the series."""
    return pitch1 * evaluate(w, taylor.THETA1, l, t) - pitch2 * evaluate(w, taylor.THETA2, l, t)

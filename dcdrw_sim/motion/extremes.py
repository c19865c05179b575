"""Extremes of the phase difference within a step of the integrator, exactly: where ω1/2α1 = ω2/2α2.

Between strikes the phase difference p is, whole steps aside, q = θ1/2α1 − θ2/2α2, as smooth as the motion.
"""

from dcdrw_sim.motion import taylor
from dcdrw_sim.motion.events import crossing
from dcdrw_sim.motion.taylor import LANES, LEVER1, LEVER2, ORDER, Work, evaluate

# By now the series of the levers have done their duty; expanding the motion anew fills them anew.
_PHASE, _RATE = LEVER1, LEVER2


def phase_extremes(w: Work, l: int, pitch1: float, pitch2: float, h: float) -> tuple[float, float]:
    """The least and greatest q [steps] at the turning points within a step h; (∞, −∞) where it has none.

    A step of the integrator holds at most one turning point of the rate of q, so q turns at most twice.

    Args:
        w: work array, expanded; the series of the levers are overwritten.
        l: lane.
        pitch1: 1/2α1 [1/rad].
        pitch2: 1/2α2 [1/rad].
        h: the step.

    """
    for j in range(l, ORDER * LANES + l + 1, LANES):
        w[_PHASE + j] = pitch1 * w[taylor.THETA1 + j] - pitch2 * w[taylor.THETA2 + j]
        w[_RATE + j] = pitch1 * w[taylor.OMEGA1 + j] - pitch2 * w[taylor.OMEGA2 + j]
    # The least of the rate lies between the ends where its own rate, that of the shifted series, changes sign.
    low, middle, high = 0.0, turning_point(w, l, h), h
    least, greatest = 1e300, -1e300
    for _ in range(2):
        before, after = evaluate(w, _RATE, l, low), evaluate(w, _RATE, l, middle)
        if before * after < 0.0:
            q = evaluate(w, _PHASE, l, crossing(w, _RATE, l, 0.0, low, middle))
            least, greatest = min(least, q), max(greatest, q)
        low, middle = middle, high
    return least, greatest


def turning_point(w: Work, l: int, h: float) -> float:
    """Where the rate of q turns within a step h, by bisection of its own rate; h where it does not."""
    low, high = 0.0, h
    rises = slope_of_rate(w, l, low) > 0.0
    if (slope_of_rate(w, l, high) > 0.0) == rises:
        return h
    for _ in range(50):
        middle = 0.5 * (low + high)
        if (slope_of_rate(w, l, middle) > 0.0) == rises:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def slope_of_rate(w: Work, l: int, t: float) -> float:
    """The rate of the rate of q."""
    total = 0.0
    for j in range(ORDER, 0, -1):
        total = total * t + j * w[_RATE + j * LANES + l]
    return total

"""Taylor series of the coupled wheels between two strikes, for one pair or for several side by side.

All series and parameters lie in one flat work array: coefficient j of the series X, of lane l, is
``w[X + j * LANES + l]``, and the lanes are the innermost loop of everything. The same functions serve a
single pair, which uses one lane of a plain list and needs no compiler (`dcdrw_sim.simulation`), and an
ensemble that fills all lanes and is compiled (`dcdrw_sim.ensemble`). Lanes are independent of each other:
each has its own parameters, time and step.

The equations are the paper's (1)–(12) in the contract's shorter form, in which no coupler angle is needed:

    p1 = ℓ2 sin(θ1 − θ2) + S cos θ1          D Ḋ  = ℓ1 p1 ω1 − ℓ2 p2 ω2
    p2 = ℓ1 sin(θ1 − θ2) + S cos θ2          F    = k (D − D0) + b Ḋ + F_ext
    ω1' = g/ℓ1 sin(θ1 + γ) − p1 (F/D)/(m1 ℓ1)
    ω2' = g/ℓ2 sin(θ2 + γ) + p2 (F/D)/(m2 ℓ2)

Products of series are convolutions (Jorba and Zou, Exp. Math. 14, 2005); D·Ḋ and D·(F/D), solved for
the newest coefficient, give the quotients.
"""

import math
from collections.abc import MutableSequence
from operator import mul

Work = MutableSequence[float]

LANES = 16
"""Pairs side by side: two AVX-512 or four AVX2 registers."""
ORDER = 16
"""Degree of the angles' polynomials; a power of two, so that the step size takes square roots only."""

_SERIES = (ORDER + 1) * LANES
(THETA1, OMEGA1, THETA2, OMEGA2, SIN1, COS1, SIN2, COS2, P1, P2, LENGTH, RATE, PULL) = range(0, 13 * _SERIES, _SERIES)
(SUM_A, SUM_B, SUM_C, SUM_D, G1, G2, COS_SLOPE, SIN_SLOPE, L1, L2, INV_ML1, INV_ML2, K, B, D0, FORCE, S, FREE1, FREE2,
 ALPHA1, ALPHA2, END) = range(13 * _SERIES, 13 * _SERIES + 22 * LANES, LANES)
FIRST_PARAMETER, PARAMETERS = G1, (END - G1) // LANES
"""Where the parameters begin, and how many there are."""

# Coefficients of sin x / x and cos x in powers of −x² as ratios of neighbours, highest first (Horner).
_SIN = tuple(1.0 / ((2 * j) * (2 * j + 1)) for j in range(9, 0, -1))
_COS = tuple(1.0 / ((2 * j - 1) * (2 * j)) for j in range(9, 0, -1))


def convolve(w: Work, out: int, a: int, b: int, n: int, lanes: int) -> None:
    """Store the n-th coefficient of the product of two series, Σ_{j=0}^{n} a_j b_{n−j}, at `out`."""
    for l in range(lanes):
        xs = w[a + l:a + l + n * LANES + 1:LANES]
        ys = w[b + l:b + l + n * LANES + 1:LANES]
        w[out + l] = sum(map(mul, xs, ys[::-1]), 0.0)


def evaluate_lanes(w: Work, out: int, series: int, times: int, lanes: int) -> None:
    """Evaluate a series in every lane, at that lane's entry in the row `times`, into the row `out`."""
    for l in range(lanes):
        w[out + l] = evaluate(w, series, l, w[times + l])


def sin_series(x: float) -> float:
    """Sine of |x| ≤ π/4 to rounding; unlike the library's, it vectorizes."""
    y = x * x
    total = 1.0
    for c in _SIN:
        total = 1.0 - y * c * total
    return x * total


def cos_series(x: float) -> float:
    """Cosine of |x| ≤ π/4 to rounding; unlike the library's, it vectorizes."""
    y = x * x
    total = 1.0
    for c in _COS:
        total = 1.0 - y * c * total
    return total


def expand(w: Work, lanes: int) -> None:
    """Expand the motion about the state: fill the series from coefficient 0 of the angles and speeds.

    Args:
        w: work array, at least END long, with state and parameters set; angles within ±π/4.
        lanes: how many of the LANES are in use.

    """
    for l in range(lanes):
        w[SIN1 + l] = sin_series(w[THETA1 + l])
        w[COS1 + l] = cos_series(w[THETA1 + l])
        w[SIN2 + l] = sin_series(w[THETA2 + l])
        w[COS2 + l] = cos_series(w[THETA2 + l])
        dx = w[L1 + l] * w[SIN1 + l] - w[L2 + l] * w[SIN2 + l] + w[S + l]
        dy = w[L1 + l] * w[COS1 + l] - w[L2 + l] * w[COS2 + l]
        w[LENGTH + l] = math.sqrt(dx * dx + dy * dy)
    for order in range(ORDER):
        n, last, following = order * LANES, (order - 1) * LANES, (order + 1) * LANES
        if order > 0:  # sin' = cos ω, cos' = −sin ω
            convolve(w, SUM_A, COS1, OMEGA1, order - 1, lanes)
            convolve(w, SUM_B, SIN1, OMEGA1, order - 1, lanes)
            convolve(w, SUM_C, COS2, OMEGA2, order - 1, lanes)
            convolve(w, SUM_D, SIN2, OMEGA2, order - 1, lanes)
            scale = 1.0 / order
            for l in range(lanes):
                w[SIN1 + n + l] = w[SUM_A + l] * scale
                w[COS1 + n + l] = -w[SUM_B + l] * scale
                w[SIN2 + n + l] = w[SUM_C + l] * scale
                w[COS2 + n + l] = -w[SUM_D + l] * scale
        convolve(w, SUM_A, SIN1, COS2, order, lanes)
        convolve(w, SUM_B, COS1, SIN2, order, lanes)
        for l in range(lanes):
            sin_difference = w[SUM_A + l] - w[SUM_B + l]
            w[P1 + n + l] = w[L2 + l] * sin_difference + w[S + l] * w[COS1 + n + l]
            w[P2 + n + l] = w[L1 + l] * sin_difference + w[S + l] * w[COS2 + n + l]
        convolve(w, SUM_A, P1, OMEGA1, order, lanes)
        convolve(w, SUM_B, P2, OMEGA2, order, lanes)
        convolve(w, SUM_C, LENGTH + LANES, RATE, order - 1, lanes)
        convolve(w, SUM_D, LENGTH + LANES, PULL, order - 1, lanes)
        scale = 1.0 / (order + 1)
        for l in range(lanes):
            rate = (w[L1 + l] * w[SUM_A + l] - w[L2 + l] * w[SUM_B + l] - w[SUM_C + l]) / w[LENGTH + l]
            force = w[K + l] * w[LENGTH + n + l] + w[B + l] * rate
            if order == 0:
                force += w[FORCE + l] - w[K + l] * w[D0 + l]
            w[RATE + n + l] = rate
            w[PULL + n + l] = (force - w[SUM_D + l]) / w[LENGTH + l]
            w[LENGTH + following + l] = rate * scale
        convolve(w, SUM_A, P1, PULL, order, lanes)
        convolve(w, SUM_B, P2, PULL, order, lanes)
        for l in range(lanes):
            weight1 = w[SIN1 + n + l] * w[COS_SLOPE + l] + w[COS1 + n + l] * w[SIN_SLOPE + l]
            weight2 = w[SIN2 + n + l] * w[COS_SLOPE + l] + w[COS2 + n + l] * w[SIN_SLOPE + l]
            w[THETA1 + following + l] = w[OMEGA1 + n + l] * scale
            w[THETA2 + following + l] = w[OMEGA2 + n + l] * scale
            w[OMEGA1 + following + l] = (w[G1 + l] * weight1 - w[SUM_A + l] * w[INV_ML1 + l]) * w[FREE1 + l] * scale
            w[OMEGA2 + following + l] = (w[G2 + l] * weight2 + w[SUM_B + l] * w[INV_ML2 + l]) * w[FREE2 + l] * scale


def step_size(w: Work, l: int, tolerance: float) -> float:
    """The step at which the angles' last terms fall to the tolerance [rad]."""
    last = abs(w[THETA1 + ORDER * LANES + l]) + abs(w[THETA2 + ORDER * LANES + l]) + 1e-300
    return math.sqrt(math.sqrt(math.sqrt(math.sqrt(tolerance / last))))


def evaluate(w: Work, series: int, l: int, t: float) -> float:
    """A series at a time t from its start."""
    total = 0.0
    for j in range(series + ORDER * LANES + l, series + l - 1, -LANES):
        total = total * t + w[j]
    return total

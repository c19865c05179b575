"""Taylor series of the coupled wheels between two strikes, for one pair or for several side by side.

All series and parameters lie in one flat work array: coefficient j of the series X, of lane l, is
``w[X + j * LANES + l]``; the LANES numbers that start there are a row. The same functions serve a single pair,
which uses one lane of a plain list and needs no compiler (`dcdrw_sim.motion.pair`), and an ensemble that fills
all lanes and computes with whole rows (`dcdrw_sim.motion.ensemble`). Lanes are independent of each other: each has its
own parameters, time and step.

The equations are the paper's (1)–(12) in the contract's shorter form, in which no coupler angle is needed;
with the difference δ = θ1 − θ2 as a third angle, the length of the coupler follows from the angles alone:

    D²  = ℓ1² + ℓ2² + S² + 2 S (ℓ1 sin θ1 − ℓ2 sin θ2) − 2 ℓ1 ℓ2 cos δ
    F   = k (D − D0) + b Ḋ + F_c tanh(Ḋ/v0) + F_ext
    ω1' = G1 (sin(θ1 + γ) − c_r tanh(ℓ1 ω1/v0)) − (ℓ2 sin δ + S cos θ1) (F/D) ℓ1/I1 + T1/I1
    ω2' = G2 (sin(θ2 + γ) − c_r tanh(ℓ2 ω2/v0)) + (ℓ1 sin δ + S cos θ2) (F/D) ℓ2/I2 + T2/I2

with I_i = m_i ℓ_i² (1 + r_i²) and G_i = m_i g ℓ_i/I_i.

Products of series are convolutions (Jorba and Zou, Exp. Math. 14, 2005). Sine and cosine follow from
sin' = ω cos and cos' = −ω sin; D and F/D from D·D and D·(F/D), solved for the newest coefficient.
"""

import math
from collections.abc import MutableSequence
from operator import mul
from typing import Any, Literal

import numpy as np

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.values import Floats, Real, each
from dcdrw_sim.model.dynamics import NO_TORQUES
from dcdrw_sim.model.rigs import Rigs
from dcdrw_sim.model.wheel import inertia, kept, pull

Work = MutableSequence[float]
Row = Any  # a number, an array of a number each lane or, compiled, a vector: what the caller's work array holds
Table = Any  # a work array: a list, an array or, compiled, a pointer

LANES = 16
"""Pairs side by side: two AVX-512 or four AVX2 registers."""
ORDER = 16
"""Degree of the polynomials; a power of two, so that the step size takes square roots only."""

Present = Literal[True] | None
"""Whether a part of the model is present; told by the type, so that kernels are compiled without what is not."""

NUMB, SWING = 16.0, 4.0
"""Friction's u = v/v0 beyond which tanh u is ±1 to rounding, and by how much u may change in a step within."""

_SERIES = (ORDER + 1) * LANES
(THETA1, OMEGA1, SIN1, COS1, THETA2, OMEGA2, SIN2, COS2, OMEGA, SIN, COS, LEVER1, LEVER2, LENGTH, PULL) = range(
    0, 15 * _SERIES, _SERIES
)
(
    SUM1,
    SUM2,
    SUM3,
    SUM4,
    SUM5,
    SUM6,
    G1,
    G2,
    COS_SLOPE,
    SIN_SLOPE,
    L1,
    L2,
    INV_ML1,
    INV_ML2,
    K,
    B,
    D0,
    FORCE,
    S,
    FREE1,
    FREE2,
    ALPHA1,
    ALPHA2,
    KEPT1,
    KEPT2,
    DRIVE1,
    DRIVE2,
    RUB,
    INV_V0,
    ROLLING,
    _PARAMETERS_END,
) = range(15 * _SERIES, 15 * _SERIES + 31 * LANES, LANES)
FIRST_PARAMETER, PARAMETERS = G1, (_PARAMETERS_END - G1) // LANES
"""Where the parameters begin, and how many there are."""

(SURGE, SURGE1, SURGE2, GRIP, GRIP1, GRIP2, LOOSE, LOOSE1, LOOSE2, END) = range(
    _PARAMETERS_END, _PARAMETERS_END + 10 * _SERIES, _SERIES
)
"""Series of friction, used where there is any: u', tanh u and 1 − tanh² u, for u = Ḋ/v0, ℓ1 ω1/v0 and ℓ2 ω2/v0."""

Product = tuple[int, int, int]
"""Where the coefficient goes, and the two factors."""
_ROTATIONS = (
    (SUM1, COS1, OMEGA1),
    (SUM2, SIN1, OMEGA1),
    (SUM3, COS2, OMEGA2),
    (SUM4, SIN2, OMEGA2),
    (SUM5, COS, OMEGA),
    (SUM6, SIN, OMEGA),
)
_COUPLER = ((SUM1, LENGTH + LANES, LENGTH + LANES), (SUM2, LENGTH + LANES, PULL))  # without D's constant coefficient
_TORQUES = ((SUM1, LEVER1, PULL), (SUM2, LEVER2, PULL))
_GRIPS = ((SUM4, SURGE, LOOSE), (SUM5, SURGE1, LOOSE1), (SUM6, SURGE2, LOOSE2))
_SQUARES = ((SUM4, GRIP, GRIP), (SUM5, GRIP1, GRIP1), (SUM6, GRIP2, GRIP2))

# Coefficients of sin x / x and cos x in powers of −x² as ratios of neighbours, highest first (Horner).
_SIN = tuple(1.0 / ((2 * j) * (2 * j + 1)) for j in range(9, 0, -1))
_COS = tuple(1.0 / ((2 * j - 1) * (2 * j)) for j in range(9, 0, -1))


def work_parameters(
    rig: RigParams | Rigs, external_force: float = 0.0, torques: tuple[float, float] = NO_TORQUES
) -> dict[int, Real]:
    """What the rows of the work array that hold parameters are, for one rig or for N, but S.

    Args:
        rig: one or N.
        external_force: added to the coupler's [N].
        torques: on the hubs, positive downhill [N·m].

    """
    front, rear = rig.front, rig.rear
    return {
        G1: pull(front, rig.gravity),
        G2: pull(rear, rig.gravity),
        COS_SLOPE: each(math.cos, rig.slope),
        SIN_SLOPE: each(math.sin, rig.slope),
        L1: front.length,
        L2: rear.length,
        INV_ML1: front.length / inertia(front),
        INV_ML2: rear.length / inertia(rear),
        K: rig.k,
        B: rig.b,
        D0: rig.D0,
        FORCE: external_force,
        ALPHA1: front.alpha,
        ALPHA2: rear.alpha,
        KEPT1: kept(front),
        KEPT2: kept(rear),
        DRIVE1: torques[0] / (front.mass * rig.gravity * front.length),
        DRIVE2: torques[1] / (rear.mass * rig.gravity * rear.length),
        RUB: rig.coupler_friction,
        INV_V0: 1.0 / rig.friction_speed,
        ROLLING: rig.rolling_resistance,
        FREE1: 1.0,
        FREE2: 1.0,
    }


def rubs(rig: RigParams | Rigs) -> Present:
    """Whether a rig has friction, or any of N."""
    return True if np.any(rig.coupler_friction) or np.any(rig.rolling_resistance) else None


def rows(w: Table, lanes: int) -> Table:
    """A view of a work array in which ``[X]`` is one value: a number for one lane, else an array for all.

    Compiled, that array is a vector (`dcdrw_sim.motion.lanes`).
    """
    return w if lanes == 1 else _Rows(w)


def bare(w: Table) -> Table:
    """The work array; compiled, a bare pointer to it, free of bookkeeping."""
    return w


class _Rows:
    def __init__(self, w: Floats) -> None:
        self._rows = w.reshape(-1, LANES)

    def __getitem__(self, at: int | slice) -> Floats:
        return self._rows[at // LANES if isinstance(at, int) else slice(at.start // LANES, (at.stop - 1) // LANES + 1)]

    def __setitem__(self, at: int, row: Row) -> None:
        self._rows[at // LANES] = row


def convolve(w: Table, products: tuple[Product, ...], n: int) -> None:
    """Store the n-th coefficient of each product of two series, Σ_{j=0}^{n} a_j b_{n−j}; zero for n = −1."""
    for out, a, b in products:
        w[out] = sum(map(mul, w[a : a + n * LANES + 1 : LANES], w[b : b + n * LANES + 1 : LANES][::-1]), 0.0)


def sqrt(x: Row) -> Row:
    """The square root of a number or a row."""
    return x**0.5


def minimum(x: Row, y: Row) -> Row:
    """The smaller of two numbers or, lane by lane, of two rows."""
    return np.minimum(x, y)


def sin_series(x: Row) -> Row:
    """Sine of |x| ≤ π/4, of a number or a row, to rounding."""
    y = x * x
    total = 1.0 - y * _SIN[0]
    for c in _SIN[1:]:
        total = 1.0 - y * c * total
    return x * total


def cos_series(x: Row) -> Row:
    """Cosine of |x| ≤ π/4, of a number or a row, to rounding."""
    y = x * x
    total = 1.0 - y * _COS[0]
    for c in _COS[1:]:
        total = 1.0 - y * c * total
    return total


def expand(work: Table, lanes: int, friction: Present, driven: Present) -> None:
    """Expand the motion about the state: fill the series from coefficient 0 of the angles and speeds.

    Args:
        work: work array, at least END long, with state and parameters set; angles within ±π/4.
        lanes: 1 for a list, LANES for an array.
        friction: present where the coupler or a wheel has any; without, its series are left alone.
        driven: present where torques act on the hubs.

    """
    w = rows(work, lanes)
    l1, l2, stance = w[L1], w[L2], w[S]
    sin1, cos1, sin2, cos2 = sin_series(w[THETA1]), cos_series(w[THETA1]), sin_series(w[THETA2]), cos_series(w[THETA2])
    dx, dy = l1 * sin1 - l2 * sin2 + stance, l1 * cos1 - l2 * cos2
    length = sqrt(dx * dx + dy * dy)
    inverse = 1.0 / length
    w[SIN1], w[COS1], w[SIN2], w[COS2] = sin1, cos1, sin2, cos2
    w[SIN], w[COS] = sin1 * cos2 - cos1 * sin2, cos1 * cos2 + sin1 * sin2
    w[OMEGA], w[LENGTH] = w[OMEGA1] - w[OMEGA2], length
    for order in range(ORDER):
        n, following, scale = order * LANES, (order + 1) * LANES, 1.0 / (order + 1)
        convolve(w, _ROTATIONS, order)
        sin1, sin2, cos = w[SUM1] * scale, w[SUM3] * scale, -w[SUM6] * scale
        w[SIN1 + following], w[COS1 + following] = sin1, -w[SUM2] * scale
        w[SIN2 + following], w[COS2 + following] = sin2, -w[SUM4] * scale
        w[SIN + following], w[COS + following] = w[SUM5] * scale, cos
        convolve(w, _COUPLER, order - 1)
        length = (stance * (l1 * sin1 - l2 * sin2) - l1 * l2 * cos - 0.5 * w[SUM1]) * inverse
        rate = (order + 1) * length
        force = w[K] * w[LENGTH + n] + w[B] * rate
        if friction is not None:
            _grip(work, w, lanes, order, rate)
            force = force + w[RUB] * w[GRIP + n]
        if order == 0:
            force = force + w[FORCE] - w[K] * w[D0]
        w[LENGTH + following], w[PULL + n] = length, (force - w[SUM2]) * inverse
        w[LEVER1 + n] = l2 * w[SIN + n] + stance * w[COS1 + n]
        w[LEVER2 + n] = l1 * w[SIN + n] + stance * w[COS2 + n]
        convolve(w, _TORQUES, order)
        weight1 = w[SIN1 + n] * w[COS_SLOPE] + w[COS1 + n] * w[SIN_SLOPE]
        weight2 = w[SIN2 + n] * w[COS_SLOPE] + w[COS2 + n] * w[SIN_SLOPE]
        if friction is not None:
            weight1, weight2 = weight1 - w[ROLLING] * w[GRIP1 + n], weight2 - w[ROLLING] * w[GRIP2 + n]
        if driven is not None and order == 0:
            weight1, weight2 = weight1 + w[DRIVE1], weight2 + w[DRIVE2]
        omega1 = (w[G1] * weight1 - w[SUM1] * w[INV_ML1]) * (w[FREE1] * scale)
        omega2 = (w[G2] * weight2 + w[SUM2] * w[INV_ML2]) * (w[FREE2] * scale)
        w[THETA1 + following], w[THETA2 + following] = w[OMEGA1 + n] * scale, w[OMEGA2 + n] * scale
        w[OMEGA1 + following], w[OMEGA2 + following], w[OMEGA + following] = omega1, omega2, omega1 - omega2
        if friction is not None:
            w[SURGE1 + n] = w[L1] * w[INV_V0] * ((order + 1) * omega1)
            w[SURGE2 + n] = w[L2] * w[INV_V0] * ((order + 1) * omega2)


def _grip(work: Table, w: Table, lanes: int, order: int, rate: Row) -> None:
    """The next coefficient of each friction's tanh u, from u' (1 − tanh² u), and of 1 − tanh² u."""
    n = order * LANES
    if order == 0:
        w[GRIP], w[GRIP1], w[GRIP2] = rate * w[INV_V0], w[L1] * w[OMEGA1] * w[INV_V0], w[L2] * w[OMEGA2] * w[INV_V0]
        for l in range(lanes):
            work[GRIP + l] = math.tanh(work[GRIP + l])
            work[GRIP1 + l] = math.tanh(work[GRIP1 + l])
            work[GRIP2 + l] = math.tanh(work[GRIP2 + l])
    else:
        w[SURGE + n - LANES] = rate * w[INV_V0] * order
        convolve(w, _GRIPS, order - 1)
        scale = 1.0 / order
        w[GRIP + n], w[GRIP1 + n], w[GRIP2 + n] = w[SUM4] * scale, w[SUM5] * scale, w[SUM6] * scale
    convolve(w, _SQUARES, order)
    one = 1.0 if order == 0 else 0.0
    w[LOOSE + n], w[LOOSE1 + n], w[LOOSE2 + n] = one - w[SUM4], one - w[SUM5], one - w[SUM6]


def motion(w: Table, t1: Row, t2: Row) -> tuple[Row, Row, Row, Row]:
    """θ1, ω1 at a time t1 from the start of the series, θ2, ω2 at t2; of a number or a row."""
    top = ORDER * LANES
    theta1, omega1, theta2, omega2 = w[THETA1 + top], w[OMEGA1 + top], w[THETA2 + top], w[OMEGA2 + top]
    for j in range(top - LANES, -1, -LANES):
        theta1, omega1 = theta1 * t1 + w[THETA1 + j], omega1 * t1 + w[OMEGA1 + j]
        theta2, omega2 = theta2 * t2 + w[THETA2 + j], omega2 * t2 + w[OMEGA2 + j]
    return theta1, omega1, theta2, omega2


def step_size(w: Work, l: int, tolerance: float) -> float:
    """The step at which the angles' last terms fall to the tolerance [rad]."""
    last = abs(w[THETA1 + ORDER * LANES + l]) + abs(w[THETA2 + ORDER * LANES + l]) + 1e-300
    return math.sqrt(math.sqrt(math.sqrt(math.sqrt(tolerance / last))))


def friction_step(w: Work, l: int, h: float) -> float:
    """A step no longer than friction allows.

    Where |u| > NUMB, tanh u is ±1 to rounding and its series tells nothing of the turn at u = 0: a step ends before it
    gets there. Nearer, u changes by at most SWING, within which the series converges.
    """
    per_speed = w[INV_V0 + l]
    if w[RUB + l] > 0.0:
        h = _gentle(w, SURGE + l, abs(w[LENGTH + LANES + l]) * per_speed, h)
    if w[ROLLING + l] > 0.0:
        h = _gentle(w, SURGE1 + l, abs(w[L1 + l] * w[OMEGA1 + l]) * per_speed, h)
        h = _gentle(w, SURGE2 + l, abs(w[L2 + l] * w[OMEGA2 + l]) * per_speed, h)
    return h


def _gentle(w: Work, surge: int, u: float, h: float) -> float:
    """The step h or, where it may change u by more than it should, a shorter one; from the series of u'."""
    most, change = max(SWING, u - NUMB), 0.0
    for j in range(ORDER - 2, -1, -1):
        change = change * h + abs(w[surge + j * LANES]) / (j + 1)
    return most / change if change * h > most else h


def evaluate(w: Work, series: int, l: int, t: float) -> float:
    """A series at a time t from its start."""
    total = 0.0
    for j in range(series + ORDER * LANES + l, series + l - 1, -LANES):
        total = total * t + w[j]
    return total

"""The gait in which the strikes of both wheels are evenly spaced, in closed form: it tells where a pair can walk.

Two equal wheels, without dimensions (m = ℓ = g = 1). Angles are taken as small and the coupler as long, so that it
pulls along the slope, and the spring is at rest at φ = α. Between strikes the sum and the difference of the angles
then go their own ways,

    (θ1 + θ2)″ = θ1 + θ2 + 2γ
    (θ1 − θ2)″ = θ1 − θ2 − 2 k (α + θ1 − θ2) − 2 b (θ1′ − θ2′)        (front wheel ahead: n = 1)

and swapping the wheels is a symmetry. So there is a gait that repeats itself, wheels swapped, after every half step of
duration H: θ1 = −α, θ1′ = ω cos 2α, θ2 = θ, θ2′ = ω′ becomes θ2 = α, θ2′ = ω, θ1 = θ, θ1′ = ω′. For given H these
four conditions are linear in ω, ω′, θ and γ: the slope is a function of the period, whose least value is the gentlest
slope on which the pair walks. There two gaits meet and vanish (a fold): the return map's multiplier is 1.
"""

import cmath
import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.rolling import speed_kept
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.map.return_map import Complexes, spectrum
from dcdrw_sim.model.scaling import nondimensional
from dcdrw_sim.model.wheel import inertia, kept

SHORTEST, LONGEST = 0.1, 20.0
"""Periods among which a gait is sought, in √(ℓ/g)."""
FLAT = 1e-6
"""Where the spring just balances the weight, 1 − 2 k̂ = 0, this stands for 0."""
DAMPINGS = (1e-3, 1e3)
"""Dampings b̂ between which a stall band is sought."""


class EvenPair(NamedTuple):
    """A rig of equal wheels as this gait knows it, and the units of that.

    A wheel's gyration slows its motion by √(1 + r²): that is a unit of time, and it makes b̂ smaller. Friction is left
    out.
    """

    alpha: float
    k: float
    b: float
    kept: float
    time: float
    """[s]"""
    damping: float
    """[N·s/m]"""


def even_pair(rig: RigParams) -> EvenPair:
    """The front wheel, the coupler and the units of a rig."""
    plain, scales = nondimensional(rig)
    slower = math.sqrt(inertia(plain.front))
    return EvenPair(
        plain.front.alpha, plain.k, plain.b / slower, kept(plain.front), scales.time * slower, scales.damping * slower
    )


class EvenGait(NamedTuple):
    """A gait of evenly spaced strikes, at the section: θ1 = α."""

    slope: float
    """The slope on which it goes [rad]."""
    period: float
    """Duration of a step, in √(ℓ/g)."""
    omega1: float
    """θ1′ in √(g/ℓ)."""
    theta2: float
    """[rad]; not 0: half the time is not half the angle."""
    omega2: float
    """θ2′"""
    multipliers: Complexes
    """Multipliers of a whole step, the largest first, shape (3,)."""


def even_gait(alpha: float, k: float, b: float, period: float, kept: float | None = None) -> EvenGait:
    """The gait with that period, and the slope that it takes.

    Args:
        alpha: α [rad].
        k: k̂.
        b: b̂.
        period: of a step, in √(ℓ/g).
        kept: η, by default that of a point mass, cos 2α.

    """
    start, flow, (omega1, theta2, omega2, slope) = _solve(alpha, k, b, period, kept)
    # Half a step's derivative: [ω, θ, ω′] before a strike to [θ2′, θ1, θ1′] before the next, where θ2 is α again.
    motion = flow[:, :4] @ start[:4, :3]
    pull = k * theta2 + b * (omega2 - omega1)
    end_rates = np.array([omega2, theta2 + slope - pull, omega1, alpha + slope + pull])
    half = (motion - np.outer(end_rates / omega1, motion[2]))[[3, 0, 1]]
    return EvenGait(slope, period, omega1, theta2, omega2, spectrum(half @ half))


def gentlest_even_gait(alpha: float, k: float, b: float, kept: float | None = None) -> EvenGait:
    """The gait on the gentlest slope: that of the fold, or the slowest where the slope falls with the period."""
    return even_gait(alpha, k, b, _least(alpha, k, b, kept)[0], kept)


def even_gait_on(alpha: float, k: float, b: float, slope: float, kept: float | None = None) -> EvenGait | None:
    """The quicker gait on a slope [rad], the one that may be stable; None where the slope is too gentle."""
    gentlest = gentlest_even_gait(alpha, k, b, kept)
    if not slope > gentlest.slope:
        return None
    period = brentq(lambda period: _slope(alpha, k, b, period, kept) - slope, SHORTEST, gentlest.period, xtol=1e-12)
    return even_gait(alpha, k, b, float(period), kept)


def worst_damping(alpha: float, k: float, kept: float | None = None) -> float:
    """The damping b̂ that needs the steepest slope."""
    low, high = map(math.log, DAMPINGS)
    found = minimize_scalar(
        lambda log_b: -_least(alpha, k, math.exp(log_b), kept)[1], bounds=(low, high), method='bounded'
    )
    return math.exp(found.x)


def even_stall_band(alpha: float, k: float, slope: float, kept: float | None = None) -> tuple[float, float] | None:
    """The dampings b̂ between which no pair walks on a slope [rad]; None where there are none."""

    def lack(log_b: float) -> float:
        return _least(alpha, k, math.exp(log_b), kept)[1] - slope

    worst = math.log(worst_damping(alpha, k, kept))
    if not lack(worst) > 0.0:
        return None
    low, high = (math.exp(brentq(lack, worst, end) if lack(end) < 0.0 else end) for end in map(math.log, DAMPINGS))
    return low, high


def _least(alpha: float, k: float, b: float, kept: float | None = None) -> tuple[float, float]:
    """The period that takes the gentlest slope, and that slope."""
    found = minimize_scalar(
        lambda period: _slope(alpha, k, b, period, kept),
        bounds=(SHORTEST, LONGEST),
        method='bounded',
        options={'xatol': 1e-8},
    )
    return float(found.x), float(found.fun)


def _slope(alpha: float, k: float, b: float, period: float, kept: float | None = None) -> float:
    return _solve(alpha, k, b, period, kept)[2][3]


def _solve(
    alpha: float, k: float, b: float, period: float, kept: float | None = None
) -> tuple[Floats, Floats, list[float]]:
    """The start of half a step and its flow, both linear in [ω, θ, ω′, γ, 1], and [ω, θ, ω′, γ] of the gait."""
    flow = _flow(alpha, k, b, 0.5 * period)
    start, end = np.zeros((6, 5)), np.zeros((4, 5))
    start[0, 4], start[1, 0], start[2, 1], start[3, 2] = -alpha, speed_kept(alpha) if kept is None else kept, 1.0, 1.0
    start[4, 3] = start[5, 4] = 1.0
    end[0, 1] = end[1, 2] = end[3, 0] = 1.0
    end[2, 4] = alpha
    conditions = flow @ start - end
    return start, flow, np.linalg.solve(conditions[:, :4], -conditions[:, 4]).tolist()


def _flow(alpha: float, k: float, b: float, time: float) -> Floats:
    """[θ1, θ1′, θ2, θ2′] after a time, linear in [θ1, θ1′, θ2, θ2′, γ, 1] before, shape (4, 6)."""
    grow, shrink = 0.5 * math.exp(time), 0.5 * math.exp(-time)
    sum_flow = np.array([[grow + shrink, grow - shrink], [grow - shrink, grow + shrink]])
    sum_push = np.array([grow + shrink - 1.0, grow - shrink])
    # x″ + 2 b x′ − κ x = 0, whose roots r1, r2 = −b ± √(b² + κ) a very stiff spring makes complex.
    kappa = 1.0 - 2.0 * k
    kappa = kappa if abs(kappa) > FLAT else FLAT
    root = cmath.sqrt(b * b + kappa) or FLAT
    r1, r2 = kappa / (b + root), -b - root
    e1, e2 = cmath.exp(r1 * time), cmath.exp(r2 * time)
    impulse, impulse_rate = (e1 - e2) / (2.0 * root), (r1 * e1 - r2 * e2) / (2.0 * root)
    step = impulse_rate + 2.0 * b * impulse
    difference_flow = np.array([[step, impulse], [kappa * impulse, impulse_rate]]).real
    difference_push = -2.0 * k * alpha * np.array([(step - 1.0) / kappa, impulse]).real
    same, other = 0.5 * (sum_flow + difference_flow), 0.5 * (sum_flow - difference_flow)
    half_push = 0.5 * difference_push
    return np.block(
        [[same, other, sum_push[:, None], half_push[:, None]], [other, same, sum_push[:, None], -half_push[:, None]]]
    )

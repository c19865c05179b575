"""What springs and dashpots bear: forces, stroke, speed and heat, from the motions of a pair."""

import math
from typing import NamedTuple, cast

import numpy as np

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.rolling import default_rest_length
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.map.limit_cycles import LimitCycles, losses
from dcdrw_sim.model.dynamics import State, accelerations, coupler, coupler_force, stance_distance
from dcdrw_sim.model.rigs import Rigs, take
from dcdrw_sim.model.wheel import inertia, kept
from dcdrw_sim.motion.ensemble import Ensemble
from dcdrw_sim.motion.runge_kutta import runge_kutta

FINE = 16
"""Parts of the time between two strikes at which the coupler is looked at, at least."""
STIFF = 0.5
"""But each part is no longer than this times the damper's own time, m/b."""


class Loads(NamedTuple):
    """What one coupler bears."""

    force: float
    """Greatest force on the hubs, either way [N]."""
    spring_force: float
    """Greatest force of the spring, k |D − D0| [N]."""
    damper_force: float
    """Greatest force of the damper and of friction [N]."""
    shortest: float
    """Least distance of the hubs [m]."""
    longest: float
    """Greatest distance of the hubs [m]."""
    speed: float
    """Greatest speed of the damper, |Ḋ| [m/s]."""
    heat: float
    """What the damper turns into heat on the limit cycle [J/min]; NaN where there is none."""

    @property
    def stroke(self) -> float:
        """How far the hubs come apart and together [m]."""
        return self.longest - self.shortest


UNKNOWN = Loads(*(math.nan,) * len(Loads._fields))
"""Of a coupler that was not looked at."""


SHORTEST, LONGEST = 0.5, 2.0
"""Times its free length, a coil spring is worked between these: shorter, and coils touch; longer, and it yields."""


class Order(NamedTuple):
    """What spring to order, and how to mount it. Where the hubs are D0 apart it has no force."""

    lengthened: float
    """Most by which it is longer than its free length [m]; negative where it is always shorter."""
    shortened: float
    """Most by which it is shorter [m]."""
    least_free_length: float
    """That bears this, between SHORTEST and LONGEST [m]; without rods and eyes."""
    free_length: float
    """Of the spring that is ordered [m]: that on the list, else the least."""
    rods: float
    """What rods and eyes are to add to it, D0 less the free length [m]; negative where it is too long."""
    preload: float
    """Its force where the pair is at 50 % [N], positive in tension."""


def order(rig: RigParams, k: float, loads: Loads, free_length: float = math.nan) -> Order:
    """The spring of a coupler that bears these loads; NaN where they are unknown.

    Args:
        rig: in which it is.
        k: its stiffness [N/m].
        loads: of the coupler.
        free_length: of the spring on the list [m]; NaN where none is told.

    """
    rig = rig.resolved()
    lengthened, shortened = loads.longest - rig.D0, rig.D0 - loads.shortest
    least = max(shortened / (1.0 - SHORTEST), lengthened / (LONGEST - 1.0))
    chosen = least if math.isnan(free_length) else free_length
    return Order(lengthened, shortened, least, chosen, rig.D0 - chosen, k * (half_step_distance(rig) - rig.D0))


def half_step_distance(rig: RigParams) -> float:
    """How far the hubs are apart where the pair is at 50 %, S0 + ℓ sin α [m]."""
    rig = rig.resolved()
    return default_rest_length(math.nan, rig.S0, rig.front.length, rig.front.alpha)


def loads(rigs: Rigs, pairs: Rigs, motions: Ensemble, cycles: LimitCycles) -> list[Loads]:
    """Loads of N couplers in M motions each.

    Args:
        rigs: of the couplers, N.
        pairs: of the motions, N M, those of a coupler side by side.
        motions: what became of them, from the strike with which each begins to its last one.
        cycles: the limit cycles, N.

    """
    strikes, alphas = motions.strikes, (pairs.front.alpha, pairs.rear.alpha)
    lane, j = np.nonzero(np.arange(1, strikes.shape[1]) < motions.counts[:, None])
    states, wheel = strikes['state'].transpose(2, 0, 1)[:, lane, j], strikes['wheel'][lane, j]
    direction, some = strikes['direction'].astype(int), take(pairs, lane)
    n1, n2 = (np.cumsum(direction * (strikes['wheel'] == side), axis=1)[lane, j] for side in (1, 2))
    for i, (alpha, shape) in enumerate(zip(alphas, (some.front, some.rear), strict=True)):
        struck = wheel == i + 1
        states[2 * i, struck] = (-direction[lane, j] * alpha[lane])[struck]
        states[2 * i + 1, struck] *= kept(shape)[struck]
    time = strikes['t'][lane, j + 1] - strikes['t'][lane, j]
    S = np.asarray(stance_distance(_each(some), n1.astype(float), n2.astype(float)))
    bounds = _bounds(some, states, S, time)
    greatest = np.full((len(bounds), len(rigs.k)), math.nan)
    for row, bound in zip(greatest, bounds, strict=True):
        np.fmax.at(row, lane // (len(pairs.k) // len(rigs.k)), bound)
    walking = losses(rigs, cycles)
    greatest[3] *= -1.0  # of the least distance
    return [Loads(*row) for row in np.vstack((greatest, 60.0 * walking.damper * walking.speed)).T.tolist()]


def _each(rigs: Rigs) -> RigParams:
    """N rigs, for the equations of one, which take arrays in the place of numbers."""
    return cast(RigParams, rigs)


def _bounds(rigs: Rigs, states: Floats, S: Floats, time: Floats) -> Floats:
    """The greatest |F|, |spring|, |damper|, −D, D and |Ḋ| of each motion between two strikes, shape (6, motions)."""
    rig = _each(rigs)

    def rates(_: Floats, y: Floats) -> Floats:
        state = State(*y)
        front, rear = accelerations(rig, state, S)
        return np.stack((state.omega1, front, state.omega2, rear))

    damping = rigs.b + rigs.coupler_friction / rigs.friction_speed
    quickest = damping * (rigs.front.length**2 / inertia(rigs.front) + rigs.rear.length**2 / inertia(rigs.rear))
    parts = max(FINE, math.ceil(float((time * quickest).max(initial=0.0)) / STIFF))
    h, bounds, y = time / parts, np.full((6, *time.shape), -math.inf), states
    for _ in range(parts + 1):
        spring = coupler(rig, State(*y), S)
        force, elastic = coupler_force(rig, spring.length, spring.rate), rigs.k * (spring.length - rigs.D0)
        now = abs(force), abs(elastic), abs(force - elastic), -spring.length, spring.length, abs(spring.rate)
        bounds = np.maximum(bounds, np.array(now, float))
        y = runge_kutta(rates, y, h)
    return bounds

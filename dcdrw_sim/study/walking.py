"""Whether a pair walks in step, what that takes, and how far it is from stalling: all that is told of one pair."""

import math
from typing import NamedTuple

import numpy as np

from dcdrw_msgs_py.in_step import BAND_PERCENT
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.map.limit_cycles import find_limit_cycles, search_fixed_point
from dcdrw_sim.map.return_map import ReturnMap
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.scaling import nondimensional
from dcdrw_sim.model.wheel import gentlest_slope
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.relatives.even_gait import even_gait_on, even_pair, even_stall_band, gentlest_even_gait
from dcdrw_sim.study.regimes import (
    BASIN_SECONDS,
    gentlest_slopes,
    judge_from,
    least_speeds,
    stall_bands,
    steepest_stall,
)
from dcdrw_sim.study.verdict import BAND, Verdict

BASIN_PHASES = tuple(np.linspace(0.0, 1.0, 25, endpoint=False).tolist())
"""Phases of the starts that are tried."""
LEFT = 1e-3
"""Motions are followed until the largest multiplier leaves this of a deviation, for BASIN_SECONDS at least."""
LONGEST = 20.0
"""But no longer than this times BASIN_SECONDS."""


class EvenCycle(NamedTuple):
    """The gait of evenly spaced strikes, in closed form."""

    theta2: float
    """θ2* at the section [rad]."""
    period: float
    """Duration of a step [s]."""
    moduli: tuple[float, ...]


class LimitCycle(NamedTuple):
    """How a pair walks once all deviations have died out."""

    phase: float
    """Phase at the section, in steps."""
    theta2: float
    """θ2* at the section [rad]."""
    swing_percent: tuple[float, float]
    """Least and greatest phase at any instant [% of a step]."""
    period: float
    """Duration of a step [s]."""
    velocity: float
    """Mean, down the slope [m/s]."""
    rear_strike: float
    """When the rear wheel strikes, as a fraction of the step's time."""
    moduli: tuple[float, ...]
    """Moduli of the multipliers of the return map, largest first."""
    stable: bool
    closed_form: EvenCycle | None
    """None where even strikes are too slow for this slope."""

    @property
    def in_step(self) -> bool:
        """Whether it lies within the band at every instant."""
        return all(abs(phase - 50.0) <= BAND_PERCENT for phase in self.swing_percent)


class Reach(NamedTuple):
    """The starts from which a pair comes to its limit cycle."""

    starts: int
    """Phases that were tried, both wheels on their uncoupled limit cycles."""
    lead_there: int
    """How many of them lead there."""
    least_speed: float
    """From the worst of them a pair walks on at this fraction of the speed; NaN where it does not at full speed."""


class Walking(NamedTuple):
    """All that is told of one pair, in SI units and radians; NaN or None where there is no such thing."""

    gentlest_slope: float
    """Above this there is a limit cycle, by continuation."""
    gentlest_slope_closed_form: float
    gentlest_slope_uncoupled: float
    """Above this one wheel rolls by itself."""
    gentlest_slope_any_damping: float
    """Above this no damper stalls."""
    damping_that_needs_it: float
    stall_band: tuple[float, float]
    """Dampings between which there is no limit cycle on this slope."""
    stall_band_closed_form: tuple[float, float] | None
    limit_cycle: LimitCycle | None
    basin: Reach | None

    @property
    def conditions(self) -> dict[str, bool]:
        """What makes a pair walk in step, and whether it holds."""
        cycle, basin = self.limit_cycle, self.basin or Reach(len(BASIN_PHASES), 0, math.nan)
        least = basin.least_speed
        slow = '' if math.isnan(least) else f'; down to {100 * least:.0f} % of their speed it walks on'
        phases = f'{basin.lead_there} of {basin.starts} phases lead there'
        return {
            'there is a limit cycle': cycle is not None,
            'it is stable: every multiplier is below 1': cycle is not None and cycle.stable,
            f'its swing lies within ±{BAND_PERCENT:g} % of 50 %, at every instant': cycle is not None and cycle.in_step,
            f'{phases}, both wheels on their uncoupled limit cycles{slow}': basin.lead_there == basin.starts,
        }


def walking(rig: RigParams) -> Walking:
    """Tell all of one pair.

    Args:
        rig: the rig, its derived defaults filled in.

    Raises:
        ValueError: an impossible rig, or unequal wheels.

    """
    if rig.front != rig.rear:
        raise ValueError('regimes are those of equal wheels: make front and rear alike')
    pair, alone = even_pair(rig), spread(rig, 1, {})
    worst_b, worst_slope = steepest_stall(rig)
    low, high = stall_bands(alone)
    band, cycle = even_stall_band(pair.alpha, pair.k, rig.slope, pair.kept), limit_cycle(rig)
    return Walking(
        float(gentlest_slopes(alone).values[0]),
        gentlest_even_gait(pair.alpha, pair.k, pair.b, pair.kept).slope,
        gentlest_slope(rig.front, rig.rolling_resistance),
        worst_slope,
        worst_b,
        (float(low.values[0]), float(high.values[0])),
        (pair.damping * band[0], pair.damping * band[1]) if band else None,
        cycle,
        reach(rig, cycle) if cycle else None,
    )


def limit_cycle(rig: RigParams) -> LimitCycle | None:
    """The limit cycle of a pair; None where none is found, from whatever phase."""
    return_map = ReturnMap(rig)
    try:
        fixed = search_fixed_point(return_map)
    except ValueError:
        return None
    pair = even_pair(rig)
    even = even_gait_on(pair.alpha, pair.k, pair.b, rig.slope, pair.kept)
    rear = run(rig, State(rig.front.alpha, *fixed.state), strikes=2).strikes[-1]
    low, high = find_limit_cycles(spread(rig, 1, {}), np.array([fixed.state])).swings[0].tolist()
    return LimitCycle(
        float(return_map.phase(fixed.state)),
        fixed.state.theta2,
        (50.0 + low, 50.0 + high),
        fixed.period,
        rig.front.step_length / fixed.period,
        rear.t / fixed.period,
        tuple(abs(fixed.multipliers).tolist()),
        fixed.stable,
        even and EvenCycle(even.theta2, even.period * pair.time, tuple(abs(even.multipliers).tolist())),
    )


def reach(rig: RigParams, cycle: LimitCycle) -> Reach | None:
    """How many of BASIN_PHASES lead to a limit cycle, and from how slow starts the pair walks on.

    None on a slope on which no wheel rolls by itself, so that there is no such start.
    """
    if not rig.slope > gentlest_slope(rig.front, rig.rolling_resistance):
        return None
    shortest = BASIN_SECONDS * nondimensional(rig)[1].time
    needed = math.log(LEFT) / math.log(cycle.moduli[0]) * cycle.period if 0.0 < cycle.moduli[0] < 1.0 else 0.0
    seconds = min(max(shortest, needed), LONGEST * shortest)
    ends = judge_from(rig, BASIN_PHASES, np.ones(len(BASIN_PHASES)), seconds)
    near = (ends.verdict <= Verdict.ELSEWHERE) & (abs(ends.theta2 - cycle.theta2) <= BAND)
    return Reach(len(BASIN_PHASES), int(near.sum()), float(least_speeds(rig, BASIN_PHASES, seconds).max()))

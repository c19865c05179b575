"""`dcdrw regimes`: whether a pair walks in step, what it takes, and how far it is from stalling."""

import argparse
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from dcdrw.console import add_json, check_json, tell
from dcdrw.files import add_force
from dcdrw.suite.parameter_file import add_rig_options, chosen_params
from dcdrw_msgs_py.in_step import BAND_PERCENT
from dcdrw_msgs_py.quantity import flatten
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.map.limit_cycles import find_limit_cycles, search_fixed_point
from dcdrw_sim.map.return_map import NoReturnError, ReturnMap
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.scaling import nondimensional
from dcdrw_sim.model.wheel import gentlest_slope
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.motion.trajectory import run as simulate
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

PHASES = tuple(np.linspace(0.0, 1.0, 25, endpoint=False).tolist())
"""Of the starts that are tried."""

_EPILOG = """\
A limit cycle ends in a fold: on gentler slopes, or with a damper in the stall band, a wheel fails to pass its apex.
"closed form" is that of evenly spaced strikes, for small angles and a long coupler. docs/synchronization.md tells which
of these conditions are necessary and which suffice. --json has the same in SI units and radians.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Tell what it takes for a pair to walk in step, and whether it has it.'
    parser.epilog = _EPILOG
    add_rig_options(parser)
    add_json(parser)
    add_force(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    check_json(options)
    rig = chosen_params(options).rig.resolved()
    found = record(rig)
    tell(options, (f'{heading:<12} {content}' for heading, content in report(rig, found)), found)
    return 0


def record(rig: RigParams) -> dict[str, Any]:
    """Everything for a program, in SI units and radians; None where there is no such thing.

    Args:
        rig: the rig, its derived defaults filled in.

    Raises:
        ValueError: an impossible rig, or unequal wheels.

    """
    if rig.front != rig.rear:
        raise ValueError('regimes are those of equal wheels: make front and rear alike')
    pair, alone = even_pair(rig), spread(rig, 1, {})
    worst_b, worst_slope = steepest_stall(rig)
    band, cycle = even_stall_band(pair.alpha, pair.k, rig.slope, pair.kept), _limit_cycle(rig)
    return {
        'parameters': flatten(rig),
        'gentlest_slope': _known(float(gentlest_slopes(alone).values[0])),
        'gentlest_slope_closed_form': gentlest_even_gait(pair.alpha, pair.k, pair.b, pair.kept).slope,
        'gentlest_slope_uncoupled': gentlest_slope(rig.front, rig.rolling_resistance),
        'gentlest_slope_any_damping': _known(worst_slope),
        'damping_that_needs_it': _known(worst_b),
        'stall_band': [_known(float(end.values[0])) for end in stall_bands(alone)],
        'stall_band_closed_form': [pair.damping * end for end in band] if band else None,
        'limit_cycle': cycle,
        'basin': _from_every_phase(rig, cycle['theta2']) if cycle else None,
    }


def _limit_cycle(rig: RigParams) -> dict[str, Any] | None:
    return_map = ReturnMap(rig)
    try:
        fixed = search_fixed_point(return_map)
    except (NoReturnError, ValueError):
        return None
    pair = even_pair(rig)
    even = even_gait_on(pair.alpha, pair.k, pair.b, rig.slope, pair.kept)
    rear = simulate(rig, State(rig.front.alpha, *fixed.state), strikes=2).strikes[-1]
    return {
        'phase': float(return_map.phase(fixed.state)),
        'theta2': fixed.state.theta2,
        'swing_percent': (50.0 + find_limit_cycles(spread(rig, 1, {}), np.array([fixed.state])).swings[0]).tolist(),
        'period': fixed.period,
        'velocity': rig.front.step_length / fixed.period,
        'rear_strike': rear.t / fixed.period,
        'moduli': abs(fixed.multipliers).tolist(),
        'stable': fixed.stable,
        'closed_form': even
        and {'theta2': even.theta2, 'period': even.period * pair.time, 'moduli': abs(even.multipliers).tolist()},
    }


def _from_every_phase(rig: RigParams, theta2: float) -> dict[str, Any] | None:
    """How many of PHASES lead within the band of the limit cycle, and from how slow starts the pair walks on."""
    if not rig.slope > gentlest_slope(rig.front, rig.rolling_resistance):
        return None
    seconds = BASIN_SECONDS * nondimensional(rig)[1].time
    ends = judge_from(rig, PHASES, np.ones(len(PHASES)), seconds)
    near = (ends.verdict <= Verdict.ELSEWHERE) & (abs(ends.theta2 - theta2) <= BAND)
    least = float(least_speeds(rig, PHASES, seconds).max())
    return {'starts': len(PHASES), 'lead_there': int(near.sum()), 'least_speed': _known(least)}


def report(rig: RigParams, found: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Lines for a person: a heading, and its content."""
    plain = nondimensional(rig)[0]
    yield 'coupler', f'{rig.k:.4g} N/m, {rig.b:.4g} N·s/m: k̂ = {plain.k:.4g}, b̂ = {plain.b:.4g}'
    least = found['gentlest_slope']
    yield (
        'slope',
        f'{_degrees(rig.slope)}; this coupler needs more than {_degrees(least)} '
        f'(closed form {_degrees(found["gentlest_slope_closed_form"])})',
    )
    yield (
        '',
        f'no damper stalls above {_degrees(found["gentlest_slope_any_damping"])}; the worst has '
        f'{_number(found["damping_that_needs_it"])} N·s/m',
    )
    low, high = found['stall_band']
    closed = found['stall_band_closed_form']
    yield (
        'stall band',
        (
            f'{low:.4g} to {high:.4g} N·s/m'
            if low and high
            else 'none that both edges bound'
            if low or high
            else 'none on this slope'
        )
        + (f' (closed form {closed[0]:.4g} to {closed[1]:.4g})' if closed else ''),
    )
    cycle = found['limit_cycle']
    if cycle is None:
        yield 'limit cycle', 'none: a wheel fails to pass its apex'
    else:
        yield (
            'limit cycle',
            f'{cycle["velocity"]:.4f} m/s, a step in {cycle["period"]:.4f} s; moduli '
            f'{" ".join(f"{modulus:.4f}" for modulus in cycle["moduli"])}',
        )
        yield (
            '',
            'within a step the phase swings from {:.2f} to {:.2f} %'.format(*cycle['swing_percent']),
        )
        yield (
            '',
            f"the rear wheel strikes at {100 * cycle['rear_strike']:.2f} % of the step's time; θ2* = "
            f'{math.degrees(cycle["theta2"]):.3f}°, a phase of {100 * cycle["phase"]:.2f} %',
        )
        if even := cycle['closed_form']:
            yield (
                '',
                f'closed form: a step in {even["period"]:.4f} s, θ2* = {math.degrees(even["theta2"]):.3f}°, '
                f'moduli {" ".join(f"{modulus:.4f}" for modulus in even["moduli"])}',
            )
    for condition, holds in conditions(found).items():
        yield ('yes' if holds else 'NO'), condition
    yield 'so', 'the pair walks in step' if all(conditions(found).values()) else 'the pair does not walk in step'


def conditions(found: dict[str, Any]) -> dict[str, bool]:
    """What makes a pair walk in step, and whether it holds."""
    cycle, basin = found['limit_cycle'], found['basin']
    lead_there, starts = (basin['lead_there'], basin['starts']) if basin else (0, len(PHASES))
    least = basin['least_speed'] if basin else None
    slow = f'; down to {100 * least:.0f} % of their speed it walks on' if least else ''
    return {
        'there is a limit cycle': cycle is not None,
        'it is stable: every multiplier is below 1': bool(cycle and cycle['stable']),
        f'its swing lies within ±{BAND_PERCENT:g} % of 50 %, at every instant': bool(
            cycle and all(abs(value - 50.0) <= BAND_PERCENT for value in cycle['swing_percent'])
        ),
        f'{lead_there} of {starts} phases lead there, both wheels on their uncoupled limit cycles{slow}': lead_there
        == starts,
    }


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _number(value: float | None) -> str:
    return '-' if value is None else f'{value:.4g}'


def _degrees(value: float | None) -> str:
    return '-' if value is None else f'{math.degrees(value):.3f}°'

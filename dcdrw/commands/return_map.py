"""`dcdrw map`: how fast a pair falls into step, by the return map's multipliers, by regression and by counting."""

import argparse
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from dcdrw.console import add_json, check_json, count, tell
from dcdrw.files import add_force
from dcdrw.suite.parameter_file import add_rig_options, chosen_params
from dcdrw_msgs_py.in_step import BAND_PERCENT
from dcdrw_msgs_py.quantity import flatten
from dcdrw_sim.map.limit_cycles import find_limit_cycles
from dcdrw_sim.map.regression import BAND, STEPS, TRIAL_PHASES, Convergence, Regression, measure
from dcdrw_sim.map.return_map import Complexes, ReturnMap
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.study.points import Points, study

_EPILOG = """\
The section is the instant before a strike of the front wheel. A multiplier is what is left of a small deviation after
a step; the largest sets the pace. The trials start with both wheels on their uncoupled limit cycles; the regressions
are fitted to them, large deviations included, and so differ from the multipliers. Steps are those to synchronization,
as the monitor counts them: to the strike from which on the error stays within the band at every instant. Strike steps
look at the strikes of the front wheel only. In --json, eigenvalues are pairs of real and imaginary part.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Find the limit cycle of a pair and tell how fast the pair comes to it.'
    parser.epilog = _EPILOG
    add_rig_options(parser)
    parser.add_argument(
        '--steps',
        type=count,
        default=STEPS,
        metavar='N',
        help=f'steps of each of the {len(TRIAL_PHASES)} trials (default: %(default)s)',
    )
    add_json(parser)
    add_force(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    check_json(options)
    return_map = ReturnMap(chosen_params(options).rig)
    convergence = measure(return_map, steps=options.steps)
    seconds = options.steps * convergence.fixed_point.period
    phases = tuple(trial.phase for trial in convergence.trials)
    points = study(spread(return_map.rig, 1, {}), seconds, phases)
    lines = (f'{name:<13} {content}' for name, content in summary_lines(return_map, convergence, points))
    tell(options, lines, json_record(return_map, convergence, points))
    return 0


def summary_lines(return_map: ReturnMap, convergence: Convergence, points: Points) -> Iterator[tuple[str, str]]:
    """Lines for a person: a heading, empty where the last one goes on, and its content.

    Args:
        return_map: the pair's.
        convergence: what the map says.
        points: what became of the same trials, and of the limit cycle, at every instant.

    """
    fixed, raw, affine, trials = convergence
    state, phase = fixed.state, _phase(return_map, convergence)
    yield (
        'fixed point',
        (
            f'θ2* = {math.degrees(state.theta2):.3f}°, θ1′ = {state.omega1:.4f} rad/s, '
            f'θ2′ = {state.omega2:.4f} rad/s; a step takes {fixed.period:.4f} s'
        ),
    )
    yield 'phase', f'{100 * phase:.1f} % of a step, {50 * phase:.1f} % of a stride'
    low, high = _swing(return_map, convergence)
    within = max(abs(low), abs(high)) <= BAND_PERCENT
    yield (
        'swing',
        f'{50 + low:.2f} to {50 + high:.2f} % within a step: '
        + (f'within ±{BAND_PERCENT:g} % of 50 %' if within else f'never in step, beyond ±{BAND_PERCENT:g} % of 50 %'),
    )
    yield 'multipliers', f'{_numbers(fixed.multipliers)}   {"stable" if fixed.stable else "not stable"}'
    if raw and affine:
        yield 'affine', f'{_numbers(affine.eigenvalues)}   {_quality(affine)}'
        yield 'raw', f"{_numbers(raw.eigenvalues)}   {_quality(raw)}; the paper's"
        yield '', 'its first is 1 with any coupler: θ1′, θ2′ and D do not vanish at the fixed point'
    else:
        yield 'regressions', 'none: no trial went through all its steps'
    yield 'convergence', f'{fixed.steps_per_decade:.1f} steps per decade of error'
    yield 'trials from', ' '.join(f'{100 * trial.phase:4.0f}' for trial in trials) + '   % of a step'
    steps_to_cycle = [math.nan if trial.steps_to_cycle is None else trial.steps_to_cycle for trial in trials]
    for name, steps, meaning in (
        ('steps', points.steps[0], f'in step from here on: within ±{BAND_PERCENT:g} % of 50 % at every instant'),
        ('strike steps', points.motions.strike_steps, 'the same at strikes only'),
        ('to the cycle', steps_to_cycle, f'until θ2 at the section stays within {math.degrees(BAND):g}° of θ2*'),
    ):
        yield (
            name,
            ' '.join(f'{"-" if math.isnan(value) else format(value, ".0f"):>4}' for value in steps) + f'   {meaning}',
        )
    for trial in trials:
        if trial.trouble:
            yield '', f'from {100 * trial.phase:.0f} %: {trial.trouble}'


def json_record(return_map: ReturnMap, convergence: Convergence, points: Points) -> dict[str, Any]:
    """Everything for a program; SI units and radians, but where a name says otherwise. Arguments as `summary_lines`."""
    fixed, raw, affine, trials = convergence
    phase = _phase(return_map, convergence)
    return {
        'fixed_point': {
            **fixed.state._asdict(),
            'theta2_deg': math.degrees(fixed.state.theta2),
            'phase_percent': 100.0 * phase,
            'phase_percent_of_stride': 50.0 * phase,
            'swing_percent': [50.0 + error for error in _swing(return_map, convergence)],
            'period': fixed.period,
            'stable': fixed.stable,
        },
        'derivative': fixed.derivative.tolist(),
        'multipliers': _pairs(fixed.multipliers),
        'moduli': abs(fixed.multipliers).tolist(),
        'steps_per_decade': fixed.steps_per_decade if fixed.stable else None,
        'regressions': {
            name: {
                'eigenvalues': _pairs(fit.eigenvalues),
                'matrix': fit.matrix.tolist(),
                'offset': fit.offset.tolist(),
                'rank': fit.rank,
                'singular_values': fit.singular_values.tolist(),
            }
            for name, fit in (('raw', raw), ('affine', affine))
            if fit
        },
        'trials': [
            {
                'phase_percent': 100.0 * trial.phase,
                'steps_to_synchronization': None if math.isnan(steps) else int(steps),
                'strike_steps': None if math.isnan(strike_steps) else int(strike_steps),
                'steps_to_cycle': trial.steps_to_cycle,
                'trouble': trial.trouble,
            }
            for trial, steps, strike_steps in zip(
                trials, points.steps[0].tolist(), points.motions.strike_steps.tolist(), strict=True
            )
        ],
        'parameters': flatten(return_map.rig),
    }


def _phase(return_map: ReturnMap, convergence: Convergence) -> float:
    return max(0.0, float(return_map.phase(convergence.fixed_point.state)))  # rounding, where both strike at once


def _swing(return_map: ReturnMap, convergence: Convergence) -> tuple[float, float]:
    """Least and greatest error at any instant of the limit cycle [% of a step]."""
    state = np.array([convergence.fixed_point.state])
    low, high = find_limit_cycles(spread(return_map.rig, 1, {}), state).swings[0].tolist()
    return low, high


def _pairs(values: Complexes) -> list[list[float]]:
    return [[value.real, value.imag] for value in values.tolist()]


def _numbers(values: Complexes) -> str:
    return '  '.join(f'{value.real:7.4f}' + (f'{value.imag:+.4f}i' if value.imag else '') for value in values.tolist())


def _quality(fit: Regression) -> str:
    return f'regression on {len(fit.matrix)} states, rank {fit.rank}, condition of P⁻¹ {fit.condition:.0e}'

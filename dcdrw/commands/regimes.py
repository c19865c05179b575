"""`dcdrw regimes`: whether a pair walks in step, what it takes, and how far it is from stalling."""

import argparse
import math
from collections.abc import Iterator
from typing import Any

from dcdrw.console import add_json, check_json, tell
from dcdrw.files import add_force
from dcdrw.suite.parameter_file import add_rig_options, chosen_params
from dcdrw_msgs_py.quantity import flatten
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.scaling import nondimensional
from dcdrw_sim.study.walking import Walking, walking

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
    found = walking(rig)
    lines = (f'{heading:<12} {content}' for heading, content in summary_lines(rig, found))
    tell(options, lines, {'parameters': flatten(rig)} | _plain(found))
    return 0


def summary_lines(rig: RigParams, found: Walking) -> Iterator[tuple[str, str]]:
    """Lines for a person: a heading, and its content."""
    plain = nondimensional(rig)[0]
    yield 'coupler', f'{rig.k:.4g} N/m, {rig.b:.4g} N·s/m: k̂ = {plain.k:.4g}, b̂ = {plain.b:.4g}'
    yield (
        'slope',
        f'{_degrees(rig.slope)}; this coupler needs more than {_degrees(found.gentlest_slope)} '
        f'(closed form {_degrees(found.gentlest_slope_closed_form)})',
    )
    yield (
        '',
        f'no damper stalls above {_degrees(found.gentlest_slope_any_damping)}; the worst has '
        f'{_number(found.damping_that_needs_it)} N·s/m',
    )
    low, high = found.stall_band
    closed = found.stall_band_closed_form
    yield (
        'stall band',
        (
            f'{low:.4g} to {high:.4g} N·s/m'
            if not math.isnan(low + high)
            else 'none that both edges bound'
            if not (math.isnan(low) and math.isnan(high))
            else 'none on this slope'
        )
        + (f' (closed form {closed[0]:.4g} to {closed[1]:.4g})' if closed else ''),
    )
    cycle = found.limit_cycle
    if cycle is None:
        yield 'limit cycle', 'none: a wheel fails to pass its apex'
    else:
        yield (
            'limit cycle',
            f'{cycle.velocity:.4f} m/s, a step in {cycle.period:.4f} s; moduli '
            f'{" ".join(f"{modulus:.4f}" for modulus in cycle.moduli)}',
        )
        yield (
            '',
            'within a step the phase swings from {:.2f} to {:.2f} %'.format(*cycle.swing_percent),
        )
        yield (
            '',
            f"the rear wheel strikes at {100 * cycle.rear_strike:.2f} % of the step's time; θ2* = "
            f'{math.degrees(cycle.theta2):.3f}°, a phase of {100 * cycle.phase:.2f} %',
        )
        if even := cycle.closed_form:
            yield (
                '',
                f'closed form: a step in {even.period:.4f} s, θ2* = {math.degrees(even.theta2):.3f}°, '
                f'moduli {" ".join(f"{modulus:.4f}" for modulus in even.moduli)}',
            )
    for condition, holds in found.conditions.items():
        yield ('yes' if holds else 'NO'), condition
    yield 'so', 'the pair walks in step' if all(found.conditions.values()) else 'the pair does not walk in step'


def _plain(value: Any) -> Any:
    """Named tuples as dictionaries, and None for what is not known: as JSON has it."""
    if hasattr(value, '_asdict'):
        return {name: _plain(part) for name, part in value._asdict().items()}
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def _number(value: float) -> str:
    return '-' if math.isnan(value) else f'{value:.4g}'


def _degrees(value: float) -> str:
    return '-' if math.isnan(value) else f'{math.degrees(value):.3f}°'

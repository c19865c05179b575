"""`dcdrw control`: the gains of the active synchronizer for a rig, and how far its loop is stable."""

import argparse
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dcdrw.console import add_json, check_json, number, positive, tell
from dcdrw.files import add_force, refuse_existing, write_text
from dcdrw.suite.parameter_file import add_rig_options, chosen_params
from dcdrw_control.sync.safety import Limits
from dcdrw_msgs_py.quantity import flatten
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.yaml_file import yaml_text
from dcdrw_sim.map.holding import METHODS, TARGETS, Law, Margins, Plant, law, margins, plant
from dcdrw_tracker.gait.sync import SyncParams

_EPILOG = """\
The law holds a force from strike to strike of the front wheel: u = force - gain (x - state) - gain_before u_before,
with x = [θ1', θ2, θ2'] at the strike. Its gain comes from the exact derivative of the return map by the force. deadbeat
brings θ2 home in one step; lqr weighs the error against the force.

example:
  dcdrw control --rig my_rig.yaml --out gains.yaml
  ros2 run dcdrw synchronizer --ros-args --params-file gains.yaml
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Compute the gains of the active synchronizer, and where its loop becomes unstable.'
    parser.epilog = _EPILOG
    add_rig_options(parser)
    law = parser.add_argument_group('the law')
    law.add_argument(
        '--target',
        choices=TARGETS,
        default=TARGETS[0],
        help="cycle: the pair's own limit cycle, where no force is left; time: 50 %% of a step's time; "
        'angle: 50 %% of its angle (default: %(default)s)',
    )
    law.add_argument('--method', choices=METHODS, default=METHODS[0], help='(default: %(default)s)')
    law.add_argument(
        '--delay', type=number, default=0.0, metavar='S', help='from a strike to the force that answers it'
    )
    law.add_argument(
        '--damping',
        type=number,
        default=0.0,
        metavar='N·s/m',
        help='damping that the force adds to the coupler, where its own would stall the pair',
    )
    law.add_argument(
        '--max-force', type=positive, default=Limits().max_force, metavar='N', help='(default: %(default)g)'
    )
    parser.add_argument('--out', type=Path, metavar='GAINS.yaml', help="write the synchronizer's parameters there")
    add_json(parser)
    add_force(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    check_json(options)
    if options.out:
        refuse_existing([options.out], options.force)
    if options.damping < 0.0:
        raise ValueError(f'--damping must be ≥ 0, got {options.damping:g}')
    rig = chosen_params(options).rig.resolved()
    found = plant(rig._replace(b=rig.b + options.damping), options.target, options.delay, options.max_force)
    chosen = law(found, options.method, 0.01 * SyncParams().band_percent, options.max_force)
    edges = margins(found, chosen)
    parameters = _parameters(rig, chosen, options)
    tell(options, _summary_lines(found, chosen, edges), _json_record(found, chosen, edges, parameters))
    if options.out:
        write_text(options.out, yaml_text({'/**': {'ros__parameters': parameters}}), options.force)
        print(f'written: {options.out}')
    return 0


def _parameters(rig: RigParams, chosen: Law, options: argparse.Namespace) -> dict[str, Any]:
    """The parameters of the node `synchronizer`, by their dotted names."""
    shared = {name: flatten(rig)[name] for name in ('front.length', 'front.spokes', 'rear.length', 'rear.spokes', 'S0')}
    return {
        'law': 'hold',
        'hold.state': [float(value) for value in chosen.state],
        'hold.gain': [float(value) for value in chosen.gain],
        'hold.force': float(chosen.force),
        'hold.gain_before': float(chosen.gain_before),
        'damping': float(options.damping),
        'limits.max_force': float(options.max_force),
        **shared,
    }


def _summary_lines(found: Plant, chosen: Law, edges: Margins) -> Iterator[str]:
    state = chosen.state
    yield (
        f'aim           θ2 = {math.degrees(state.theta2):.3f}°, θ1′ = {state.omega1:.4f} rad/s, '
        f'θ2′ = {state.omega2:.4f} rad/s at the strike; steady force {chosen.force:.4g} N'
    )
    yield f'gain          {chosen.gain[0]:.4g} N·s/rad, {chosen.gain[1]:.4g} N/rad, {chosen.gain[2]:.4g} N·s/rad'
    if chosen.gain_before:
        yield f'gain before   {chosen.gain_before:.4g}, for a delay of {1000.0 * found.delay:.0f} ms'
    yield f'multipliers   {_moduli(found.point.multipliers)} without the law'
    yield f'              {_moduli(found.closed(chosen))} with it'
    yield f'unstable      {_edge(edges.gain, "times this gain")}; {_edge(edges.delay, "s of delay")}'


def _moduli(values: Any) -> str:
    return ', '.join(f'{abs(value):.4f}' for value in values)


def _edge(value: float, unit: str) -> str:
    return f'from {value:.3g} {unit} on' if math.isfinite(value) else f'nowhere found in {unit}'


def _json_record(found: Plant, chosen: Law, edges: Margins, parameters: dict[str, Any]) -> dict[str, Any]:
    """Everything for a program, in SI units and radians."""
    return {
        'parameters': parameters,
        'period': found.point.period,
        'open_loop_multipliers': [abs(value) for value in found.point.multipliers],
        'closed_loop_multipliers': [abs(value) for value in found.closed(chosen)],
        'unstable_gain_factor': edges.gain if math.isfinite(edges.gain) else None,
        'unstable_delay': edges.delay if math.isfinite(edges.delay) else None,
    }

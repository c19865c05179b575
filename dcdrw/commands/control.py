"""`dcdrw control`: the gains of the active synchronizer for a rig, and how far its loop is stable."""

import argparse
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from dcdrw.console import add_json, check_json, number, positive, tell
from dcdrw.files import add_force, refuse_existing, write_text
from dcdrw.suite.hub_gains import hub_gains
from dcdrw.suite.hub_loop import HubLoop
from dcdrw.suite.parameter_file import add_rig_options, chosen_params
from dcdrw_control.sync.safety import Limits
from dcdrw_msgs_py.quantity import flatten
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.yaml_file import yaml_text
from dcdrw_sim.map.holding import METHODS, TARGETS, UNCERTAIN, Margins, eased, law, margins, plant
from dcdrw_sim.map.return_map import Complexes
from dcdrw_tracker.gait.sync import SyncParams

_EPILOG = """\
hold: a force from strike to strike of the front wheel, u = force - gain (x - state) - gain_before u_before, with
x = [θ1', θ2, θ2'] at the strike. Its gain comes from the exact derivative of the return map by the force. deadbeat
brings θ2 home in one step; lqr weighs the error against the force. The gain is then eased until the worst of the rigs
within --uncertain is damped best.
rear: a torque on the rear hub, behind a person of even pace: all of it at the edge of the band, critically damped.

example:
  dcdrw control --rig my_rig.yaml --out gains.yaml
  dcdrw control --rig my_rig.yaml --law rear --delay 0.05 --out gains.yaml
  ros2 run dcdrw synchronizer --ros-args --params-file gains.yaml
"""


class _Found(NamedTuple):
    """The gains of a law, and what becomes of its loop."""

    parameters: dict[str, Any]
    """Of the node `synchronizer`, by their dotted names."""
    report: list[str]
    """The gains, in lines to read."""
    without: Complexes
    """Multipliers without the law."""
    closed: Complexes
    """Multipliers with it."""
    edges: Margins


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Compute the gains of the active synchronizer, and where its loop becomes unstable.'
    parser.epilog = _EPILOG
    add_rig_options(parser)
    parser.add_argument('--law', choices=('hold', 'rear'), default='hold', help='(default: %(default)s)')
    parser.add_argument(
        '--delay', type=number, default=0.0, metavar='S', help='from a sample to the force or torque that answers it'
    )
    hold = parser.add_argument_group('the law hold')
    hold.add_argument(
        '--target',
        choices=TARGETS,
        default=TARGETS[0],
        help="cycle: the pair's own limit cycle, where no force is left; time: 50 %% of a step's time; "
        'angle: 50 %% of its angle (default: %(default)s)',
    )
    hold.add_argument('--method', choices=METHODS, default=METHODS[0], help='(default: %(default)s)')
    hold.add_argument(
        '--uncertain',
        type=number,
        default=100.0 * UNCERTAIN,
        metavar='PERCENT',
        help='masses, damping and stiffness may each be so much less or more than the rig says (default: %(default)g)',
    )
    hold.add_argument(
        '--damping',
        type=number,
        default=0.0,
        metavar='N·s/m',
        help='damping that the force adds to the coupler, where its own would stall the pair',
    )
    hold.add_argument(
        '--max-force', type=positive, default=Limits().max_force, metavar='N', help='(default: %(default)g)'
    )
    rear = parser.add_argument_group('the law rear')
    rear.add_argument(
        '--max-torque', type=positive, default=Limits().max_torque, metavar='N·m', help='(default: %(default)g)'
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
    if not 0.0 <= options.uncertain < 100.0:
        raise ValueError(f'--uncertain must be ≥ 0 and < 100, got {options.uncertain:g}')
    rig = chosen_params(options).rig.resolved()
    found = _rear(rig, options) if options.law == 'rear' else _hold(rig, options)
    shared = {name: flatten(rig)[name] for name in ('front.length', 'front.spokes', 'rear.length', 'rear.spokes', 'S0')}
    parameters = {'law': options.law, **found.parameters, **shared}
    tell(options, _summary_lines(found), _json_record(found, parameters))
    if options.out:
        write_text(options.out, yaml_text({'/**': {'ros__parameters': parameters}}), options.force)
        print(f'written: {options.out}')
    return 0


def _hold(rig: RigParams, options: argparse.Namespace) -> _Found:
    damped = rig._replace(b=rig.b + options.damping)
    about = plant(damped, options.target, options.delay, options.max_force)
    chosen = law(about, options.method, 0.01 * SyncParams().band_percent, options.max_force)
    chosen = eased(chosen, about, 0.01 * options.uncertain)
    state = chosen.state
    report = [
        f'aim           θ2 = {math.degrees(state.theta2):.3f}°, θ1′ = {state.omega1:.4f} rad/s, '
        f'θ2′ = {state.omega2:.4f} rad/s at the strike; steady force {chosen.force:.4g} N',
        f'gain          {chosen.gain[0]:.4g} N·s/rad, {chosen.gain[1]:.4g} N/rad, {chosen.gain[2]:.4g} N·s/rad',
    ]
    if chosen.gain_before:
        report.append(f'gain before   {chosen.gain_before:.4g}, for a delay of {1000.0 * about.delay:.0f} ms')
    parameters = {
        'hold.state': [float(value) for value in chosen.state],
        'hold.gain': [float(value) for value in chosen.gain],
        'hold.force': float(chosen.force),
        'hold.gain_before': float(chosen.gain_before),
        'hold.middle': float(chosen.middle),
        'damping': float(options.damping),
        'limits.max_force': float(options.max_force),
    }
    return _Found(parameters, report, about.point.multipliers, about.closed(chosen), margins(about, chosen))


def _rear(rig: RigParams, options: argparse.Namespace) -> _Found:
    gains = hub_gains(rig, options.delay, options.max_torque)
    loop = HubLoop(rig, gains)
    report = [
        f'gain          {gains.stiffness:.4g} N·m/rad, {gains.damping:.4g} N·m·s/rad',
        f'free gait     {min(gains.free_speeds):.4f} to {max(gains.free_speeds):.4f} rad/s',
    ]
    if gains.delay:
        report.append(f'predictor     for a delay of {1000.0 * gains.delay:.0f} ms')
    told = {
        f'hub.{name}': list(value) if isinstance(value, tuple) else float(value)
        for name, value in gains._asdict().items()
    }
    parameters = {**told, 'limits.max_torque': float(options.max_torque)}
    return _Found(parameters, report, loop.multipliers(0.0), loop.multipliers(), loop.margins())


def _summary_lines(found: _Found) -> Iterator[str]:
    yield from found.report
    yield f'multipliers   {_moduli(found.without)} without the law'
    yield f'              {_moduli(found.closed)} with it'
    yield f'unstable      {_edge(found.edges.gain, "times this", "gain")}; {_edge(found.edges.delay, "s of", "delay")}'


def _moduli(values: Any) -> str:
    return ', '.join(f'{abs(value):.4f}' for value in values)


def _edge(value: float, unit: str, name: str) -> str:
    return f'from {value:.3g} {unit} {name} on' if math.isfinite(value) else f'at no {name} that was looked at'


def _json_record(found: _Found, parameters: dict[str, Any]) -> dict[str, Any]:
    """Everything for a program, in SI units and radians."""
    return {
        'parameters': parameters,
        'open_loop_multipliers': [abs(value) for value in found.without],
        'closed_loop_multipliers': [abs(value) for value in found.closed],
        'unstable_gain_factor': found.edges.gain if math.isfinite(found.edges.gain) else None,
        'unstable_delay': found.edges.delay if math.isfinite(found.edges.delay) else None,
    }

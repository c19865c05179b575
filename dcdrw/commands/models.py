"""`dcdrw models`: what the single wheel and the rigidly coupled pair do on a rig's slope."""

import argparse
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dcdrw.console import add_json, check_json, tell, tell_where
from dcdrw.drawings.figure_files import add_formats, figure_files, write_figure
from dcdrw.files import add_force, refuse_existing, to_json, write_text
from dcdrw.suite.parameter_file import add_rig_options, chosen_params
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams
from dcdrw_sim.figures import model_figures
from dcdrw_sim.figures.style import PAGE, for_print, new_figure
from dcdrw_sim.relatives.comparison import GAITS, compare
from dcdrw_sim.relatives.footfall_order import steady_contacts
from dcdrw_sim.relatives.rigid_pair import NEAR_TOGETHER

PICTURES = 'wheel', 'pair', 'footfalls'

_EPILOG = """\
The single wheel is McGeer's rimless wheel. The rigid pair has a bar as long as D0 in the coupler's place (Smith and
Berkemeier): its phase never changes. Phases are in percent of a step; "pull" is the greatest impulse at a strike that
only a foot held to the ground can give, in percent of what the striking foot gets.
The pictures: wheel.png (basin; speed against slope), pair.png (speed and energy per metre against phase),
footfalls.png (gait diagrams). models.json holds the numbers, in SI units and radians.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Tell what the models that the coupled pair builds on do on its slope.'
    parser.epilog = _EPILOG
    add_rig_options(parser)
    parser.add_argument('--out', type=Path, metavar='DIR', help='draw the pictures and write models.json there, too')
    add_formats(parser)
    add_json(parser)
    add_force(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    rig = chosen_params(options).rig.resolved()
    check_json(options)
    if options.out:
        new_figure(1, 1)
        files = figure_files(options.out, PICTURES, options.formats)
        refuse_existing([options.out / 'models.json', *files], options.force)
    found = compare(rig)
    tell(options, summary_lines(found), found)
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        write_text(options.out / 'models.json', to_json(found), options.force)
        with for_print():
            for name, figure in draw(rig, found).items():
                write_figure(figure, options.out, name, options.formats, options.force)
        tell_where(options, f'numbers and pictures are in {options.out}')
    return 0


def summary_lines(found: dict[str, Any]) -> Iterator[str]:
    """Lines for a person."""
    wheels = found['wheels']
    if wheels[FRONT] == wheels[REAR]:
        yield from _wheel_lines('single wheel', wheels[FRONT], found['parameters']['slope'])
    else:
        for name, wheel in wheels.items():
            yield from _wheel_lines(f'{name} wheel by itself', wheel, found['parameters']['slope'])
    yield from _pair_lines(found['rigid_pair'])
    coupled = found['coupled_pair']
    yield 'coupled pair, to compare'
    yield (
        f'  none: {coupled["trouble"]}'
        if 'trouble' in coupled
        else f'  settles at {100 * coupled["phase"]:.1f} %, {coupled["velocity"]:.4f} m/s'
        if coupled['stable']
        else f'  its gait at {100 * coupled["phase"]:.1f} % is not stable'
    )
    yield 'footfalls, 1 front left, 2 front right, 3 rear left, 4 rear right'
    for gait in found['footfalls']:
        yield (
            f'  {100 * gait["phase"]:3.0f} %   {gait["order"]}   a rear foot leads the front one of its side by '
            f'{100 * gait["rear_lead"]:.1f} % of a stride'
        )


def _wheel_lines(heading: str, wheel: dict[str, Any], slope: float) -> Iterator[str]:
    yield heading
    if wheel['velocity'] is None:
        yield f'  limit cycle   none on {math.degrees(slope):.4g}°'
    else:
        yield (
            f'  limit cycle   {wheel["velocity"]:.4f} m/s, a step in {wheel["period"]:.4f} s; '
            f'{wheel["omega_after_strike"]:.4f} rad/s after a strike, {wheel["omega_before_strike"]:.4f} before'
        )
        yield f'  loses         {wheel["energy_per_metre"]:.4g} J/m at strikes'
    yield f'  multiplier    {wheel["multiplier"]:.4f}, cos² 2α: left of a deviation after a step'
    yield (
        f'  slopes        above {math.degrees(wheel["gentlest_slope"]):.4g}° it rolls, from '
        f'{math.degrees(wheel["slope_without_standing"]):.4g}° on it cannot stand; from '
        f'{math.degrees(wheel["slope_of_lift_off"]):.4g}° on a real foot would lift off'
    )
    if slope < wheel['slope_without_standing']:
        yield f'  passes apex   above {wheel["omega_to_pass"]:.4f} rad/s after a strike, else it comes to stand'
        if wheel['uphill_bands']:
            bands = ', '.join(f'{low:.3f} to {high:.3f}' for low, high in wheel['uphill_bands'])
            yield f'  sent uphill   comes back to roll from {bands} rad/s, ...; between, to stand'


def _pair_lines(pair: dict[str, Any]) -> Iterator[str]:
    if 'trouble' in pair:
        yield 'rigid pair'
        yield f'  none: {pair["trouble"]}'
        return
    yield f'rigid pair, a bar of {pair["bar"]:.4g} m'
    yield '                          deviation  rolls    at the speed of 50 %'
    yield '  phase     speed   step   left      above    slope    loss      pull'
    yield '  [%]       [m/s]   [s]    per step  [°]      [°]      [J/m]     [%]'
    for gait in pair['phases']:
        phase = {0.0: '0 at once', NEAR_TOGETHER: '0 in turn'}.get(gait['phase'], f'{100 * gait["phase"]:.0f}')
        yield (
            f'  {phase:<10}{_number(gait["velocity"], 4):<8}{_number(gait["period"], 4):<7}'
            f'{_number(gait["multiplier"], 4):<10}{_degrees(gait["gentlest_slope"]):<9}'
            f'{_degrees(gait["slope_at_velocity_of_50_percent"]):<9}'
            f'{_number(gait["energy_per_metre_at_velocity_of_50_percent"], 3):<10}'
            f'{_number(None if gait["pull"] is None else 100 * gait["pull"], 1)}'
        ).rstrip()
    if fastest := pair.get('fastest'):
        yield f'  fastest at {100 * fastest["phase"]:.2f} %: {fastest["velocity"]:.4f} m/s'


def draw(rig: RigParams, found: dict[str, Any]) -> dict[str, Any]:
    """The pictures as matplotlib figures, by their names.

    Raises:
        ValueError: matplotlib is not installed.

    """
    wheels = {FRONT: rig.front} if rig.front == rig.rear else {FRONT: rig.front, REAR: rig.rear}
    drawn = {}
    drawn['wheel'] = figure = new_figure(PAGE, 3.2 * len(wheels))
    for (name, wheel), (basin, speed) in zip(
        wheels.items(), figure.subplots(len(wheels), 2, squeeze=False), strict=True
    ):
        model_figures.draw_basin(basin, wheel, rig.slope, rig.gravity)
        model_figures.draw_wheel_speed(speed, wheel, rig.slope, rig.gravity)
        speed.set_title('a single wheel' if len(wheels) == 1 else f'the {name} wheel by itself')
    if 'fastest' in found['rigid_pair']:
        drawn['pair'] = figure = new_figure(PAGE, 3.0)
        speed, energy = figure.subplots(1, 2)
        coupled = found['coupled_pair']
        model_figures.draw_speed(speed, rig, (coupled['phase'], coupled['velocity']) if coupled.get('stable') else None)
        model_figures.draw_energy(energy, rig)
    drawn['footfalls'] = figure = new_figure(PAGE, 4.0)
    for axes, phase in zip(figure.subplots(2, 2, sharex=True, sharey=True).flat, GAITS, strict=True):
        model_figures.draw_hildebrand(axes, steady_contacts(phase, 2), title=f'p = {100 * phase:.0f} %')
        axes.set_xlim(0.0, 2.0)
        axes.label_outer()
    return drawn


def _number(value: float | None, digits: int) -> str:
    return '-' if value is None else f'{value:.{digits}f}'


def _degrees(value: float | None) -> str:
    return _number(None if value is None else math.degrees(value), 3)

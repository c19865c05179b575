"""`dcdrw design`: which spring and which dashpot to buy for a rig, and what if they are not what they say."""

import argparse
import math
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from dcdrw.console import Bar, add_json, check_json, positive, tell, tell_where
from dcdrw.drawings.design_card import draw_card
from dcdrw.drawings.figure_files import add_formats, figure_files, write_figure
from dcdrw.files import add_force, refuse_existing, to_json, write_csv, write_text
from dcdrw.pairs_table import COLUMNS, load_record, order_record, pair_lines, pair_records, working
from dcdrw.parts_list import PartsList, read_parts
from dcdrw.suite.parameter_file import add_rig_options, chosen_params, read_uncertainty
from dcdrw.trials.monitored import monitored
from dcdrw_msgs_py.quantity import flatten
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.values import Floats
from dcdrw_msgs_py.words import counted
from dcdrw_sim.figures.style import for_print, new_figure
from dcdrw_sim.identification.unknowns import knowledge, unknowns_of
from dcdrw_sim.model.scaling import nondimensional
from dcdrw_sim.model.start import start
from dcdrw_sim.study.design import (
    CASES,
    GRID,
    PART_TOLERANCE,
    VARIED,
    WIDEST,
    WORK,
    Assessment,
    Margin,
    Task,
    Variation,
    assess,
    mesh,
    score,
    search,
)
from dcdrw_sim.study.loads import Order, half_step_distance, order
from dcdrw_sim.study.outlook import CANDIDATES, DRAWN, FINAL, Outlook, outlook, surest
from dcdrw_sim.study.parts import DASHPOT, SPRING, Pair, Part, rank
from dcdrw_sim.study.sweep import default_seconds
from dcdrw_sim.study.verdict import Verdict
from dcdrw_tracker.gait.sync import SyncParams

STIFFNESS = 1e-4, 1.0
"""What is searched by default, without dimensions."""
DAMPING = 1e-2, 1e2
NEAR = 0.2
"""A slope that is gentler than the rig's by less than this part is near: a level, or a floor, may be off by so much."""
SLOPE_SHOWN = math.radians(0.05)
"""Two slopes nearer than this are told as one."""
LEAST_PRELOAD = 0.005
"""Of a spring, as a length [m]: less is none."""
SEED = 1
"""Of the rigs that are drawn: the same every time."""
AFTERWARDS = 30.0
"""The monitor sees so much more of a motion than it takes to come into step, in √(ℓ/g)."""
FASTEST, FORGIVING, SUREST, GIVEN = 'fastest', 'most forgiving', 'surest', 'given'

_EPILOG = """\
Steps are those of the front wheel to synchronization, as the monitor counts them: until the error stays within the band
at every instant, from the worst of nine initial phases. A coupler whose limit cycle swings beyond the band never comes
into step. Strike steps look at the strikes of the front wheel only. Before a coupler is recommended, the monitor's own
core has seen it come into step from each start.

The fastest coupler needs fewest steps. The most forgiving needs fewest where k and b are each off by the tolerance
either way and the slope is a tenth gentler than thought: where parts are bought by their data sheets, take this one.

Where the rig file tells how well the rig is known (dcdrw identify writes that), couplers are also judged on rigs that
are as likely; the surest is the best on the worst of these.

--available takes a table with a heading, kind,value,name, and a row for each part, separated by commas, semicolons,
tabs or bars (config/parts.csv shows one). Kind is spring or dashpot, or damper; units stand in the heading (value
[N/mm]), in a column unit, or in the cell (0.1 N·s/mm), else they are N/m and N·s/m. Where it has columns max_force,
max_stroke and max_speed, no pair is recommended that asks for more of a part; from a column free_length, the card tells
which rods to add. Every pair is judged, in the place of the search, and those that come into step are listed, the best
first; --out writes all of them to pairs.csv.

examples:
  dcdrw design                                            for the paper's rig
  dcdrw design --mass 12 --length 0.9 --slope-deg 2.5 --out design
  dcdrw design --available parts.csv --out design         the best pairs among those on sale
  dcdrw design --k 5.25 --b 100                           judge a coupler beside the best ones
"""


Steps = tuple[int | None, ...]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Find the coupler that synchronizes a rig fastest, and the one that forgives most.'
    parser.epilog = _EPILOG
    add_rig_options(parser)
    coupler = parser.add_argument_group('the coupler')
    for name, unit in (('k', 'N/m'), ('b', 'N·s/m')):
        coupler.add_argument(f'--{name}-min', type=positive, metavar=unit, help=argparse.SUPPRESS)
        coupler.add_argument(f'--{name}-max', type=positive, metavar=unit, help=f'search no further (and --{name}-min)')
    coupler.add_argument('--available', type=Path, metavar='PARTS.csv', help='choose among these parts')
    coupler.add_argument(
        '--tolerance',
        type=positive,
        default=100.0 * PART_TOLERANCE,
        metavar='PERCENT',
        help='what k and b may be off by (default: %(default)g)',
    )
    parser.add_argument(
        '--band',
        type=positive,
        default=SyncParams().band_percent,
        metavar='PERCENT',
        help="in step is within ± this of 50 %% (default: %(default)g, the monitor's)",
    )
    parser.add_argument(
        '--seconds',
        type=positive,
        metavar='SECONDS',
        help='how long a trial may last; what takes longer is not in step (default: 200 √(ℓ/g), about a minute)',
    )
    parser.add_argument('--out', type=Path, metavar='DIR', help='write the card and design.json there')
    add_formats(parser, 'pdf', 'png')
    add_json(parser)
    add_force(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    if (options.k is None) != (options.b is None):
        raise ValueError('give --k and --b together')
    if options.k is not None and not (options.k > 0.0 and options.b > 0.0):
        raise ValueError(f'--k and --b must be > 0, got {options.k:g} and {options.b:g}')
    if not options.tolerance < 100.0:
        raise ValueError(f'--tolerance must be below 100 %, got {options.tolerance:g}')
    if not options.band < 50.0:
        raise ValueError(f'--band must be below 50 %, got {options.band:g}')
    task = _task(options)
    tolerance = options.tolerance / 100.0
    offer = read_parts(options.available) if options.available else PartsList()
    parts = offer.parts
    check_json(options)
    if options.out:
        new_figure(1, 1, 'a card')
        files = figure_files(options.out, ['card'], options.formats)
        tables = [options.out / 'pairs.csv'] if parts else []
        refuse_existing([options.out / 'design.json', *tables, *files], options.force)
    ranked: list[Pair] = []
    with Bar('judging', 'couplers') as bar:
        k, b = _bounds(options, task.rig)
        if parts:
            if options.out:  # for the card
                bar.begin(GRID**2)
                grid = score(task, *mesh(k, b), report=bar.more)
            bar.begin((CASES + 1) * offer.pairs)
            ranked = rank(task, parts, tolerance, bar.more)
            best = list(_best(ranked))
        else:
            bar.begin(WORK)
            grid, *best = search(task, k, b, tolerance, bar.more)
    chosen = {name: assess(task, *pair, tolerance) for name, pair in zip((FASTEST, FORGIVING), best, strict=True)}
    drawn = _drawn(options, task.rig)
    if drawn:
        if parts:
            pairs = (working(ranked) or ranked)[:CANDIDATES]
            ks, bs = np.array([(pair.spring.value, pair.dashpot.value) for pair in pairs]).T
        else:
            candidates = grid.order()[:CANDIDATES]
            ks, bs = grid.k[candidates], grid.b[candidates]
        few = {name: column[:DRAWN] for name, column in drawn.items()}
        chosen[SUREST] = assess(task, *surest(task, ks, bs, few), tolerance)
    if options.k:
        chosen[GIVEN] = assess(task, options.k, options.b, tolerance)
    seen = {name: by_monitor(task, found) for name, found in chosen.items()}
    found = json_record(task, chosen, seen, parts, tolerance)
    if parts:
        found |= {'pairs': pair_records(ranked), 'skipped': list(offer.skipped)}
    outlooks = {name: outlook(task, one.k, one.b, drawn) for name, one in chosen.items()} if drawn else {}
    for name, one in outlooks.items():
        found['couplers'][name.replace(' ', '_')]['outlook'] = one._asdict()
    lines = chain(
        summary_lines(task, chosen, seen, parts, tolerance),
        _hint(task, chosen, seen),
        _outlook_lines(outlooks),
        _offer_lines(ranked, offer, len(task.phases)),
    )
    tell(options, lines, found)
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        write_text(options.out / 'design.json', to_json(found), options.force)
        for path in tables:
            write_csv(path, COLUMNS, map(dict.values, pair_records(ranked)), options.force)
        texts = _texts(task, chosen, parts, tolerance, outlooks)
        on_sale = {kind: [part.value for part in parts if part.kind == kind] for kind in (SPRING, DASHPOT)}
        large = {name: _sentence(warnings(task, found)) for name, found in chosen.items()}
        with for_print():
            card = draw_card(_rig_line(task), texts, large, task, grid, chosen, on_sale)
        write_figure(card, options.out, 'card', options.formats, options.force)
        tell_where(options, f'\nThe card and all numbers are in {options.out}.')
    return 0


def by_monitor(task: Task, found: Assessment) -> Steps:
    """Steps to synchronization from each start, as the monitor's core counts them; None where it sees none."""
    if math.isnan(found.time):  # some start never comes into step, whatever the monitor sees of the others
        return (None,) * len(task.phases)
    rig = task.rig._replace(k=found.k, b=found.b)
    seconds = found.time + AFTERWARDS * nondimensional(rig)[1].time
    params = SyncParams(band_percent=task.band_percent)
    return tuple([monitored(*start(rig, phase), seconds, params).steps_to_synchronization for phase in task.phases])


def recommended(found: Assessment, seen: Steps) -> bool:
    """Whether a coupler brings the rig into step for good from each start, and the monitor agrees to the step."""
    return found.verdict is Verdict.IN_STEP and seen == found.steps


def _task(options: argparse.Namespace) -> Task:
    rig = chosen_params(options).rig
    return Task(rig, options.seconds or default_seconds(rig), options.band)


def _bounds(options: argparse.Namespace, rig: RigParams) -> Iterator[tuple[float, float]]:
    scales = nondimensional(rig)[1]
    for name, unit, (least, most) in (('k', scales.stiffness, STIFFNESS), ('b', scales.damping, DAMPING)):
        high = getattr(options, f'{name}_max') or unit * most
        low = getattr(options, f'{name}_min') or min(unit * least, high)
        if low > high:
            raise ValueError(f'--{name}-min {low:g} is above --{name}-max {high:g}')
        yield low, high


def _best(pairs: list[Pair]) -> tuple[tuple[float, float], tuple[float, float]]:
    """k and b of the fastest and of the most forgiving pair, among those that work where any does."""
    good = working(pairs) or pairs
    fastest, forgiving = good[0], min(good, key=lambda pair: pair.rank_if_off)
    return (fastest.spring.value, fastest.dashpot.value), (forgiving.spring.value, forgiving.dashpot.value)


def _drawn(options: argparse.Namespace, rig: RigParams) -> dict[str, Floats]:
    """Columns of rigs that are as likely as the rig file says; empty where it says nothing."""
    uncertainty = read_uncertainty(options.rig) if options.rig else None
    if not uncertainty:
        return {}
    unstated = [unknown.name for unknown in unknowns_of(rig) if unknown.name not in uncertainty.errors]
    known = knowledge(rig, unstated, uncertainty, str(options.rig))
    return known.draw(FINAL, SEED) if known.unknowns else {}


def _outlook_lines(outlooks: dict[str, Outlook]) -> Iterator[str]:
    if outlooks:
        yield ''
        yield f'On {FINAL} rigs as likely as this one is known:'
    for name, one in outlooks.items():
        yield f'  {name:<14} {_likely(one)}'


def _likely(one: Outlook) -> str:
    late = '' if math.isnan(one.late_steps) else f'; nine of ten within {counted(round(one.late_steps), "step")}'
    half = '' if math.isnan(one.median_steps) else f', half of them within {counted(round(one.median_steps), "step")}'
    return f'in step from every start on {100.0 * one.in_step:.0f} %{half}{late}'


def _hint(task: Task, chosen: dict[str, Assessment], seen: dict[str, Steps]) -> Iterator[str]:
    """Where no coupler is recommended, and the spring's mounting may be why."""
    rig = task.rig.resolved()
    off = rig.D0 - half_step_distance(rig)
    if abs(off) > LEAST_PRELOAD and not any(recommended(found, seen[name]) for name, found in chosen.items()):
        yield ''
        yield (
            f'No coupler is recommended for a spring that is without force at D0 = {rig.D0:.3f} m. With '
            f'{1e3 * abs(off):.0f} mm {"less" if off > 0.0 else "more"} of rods it is so at 50 %: try it, as '
            f'D0: {rig.D0 - off:.3f} in the rig file.'
        )


def _offer_lines(ranked: list[Pair], offer: PartsList, starts: int) -> Iterator[str]:
    if ranked:
        yield ''
        yield from pair_lines(ranked, starts)
    for reason in offer.skipped:
        yield f'skipped, {reason}'


def summary_lines(
    task: Task,
    chosen: dict[str, Assessment],
    seen: dict[str, Steps],
    parts: Sequence[Part],
    tolerance: float,
) -> Iterator[str]:
    """Lines for a person; `seen` is what the monitor says of each."""
    yield _rig_line(task)
    starts = counted(len(task.phases), 'start')
    yield f'In step: within ±{task.band_percent:g} % of 50 % at every instant, from the worst of {starts}.'
    for name, found in chosen.items():
        yield ''
        yield f'{name:<16} {_coupler(task, found, parts)}'
        if recommended(found, seen[name]):
            yield f'  {"monitor":<14} synchronized from each of {starts}, in as many steps'
        else:
            yield f'  {"monitor":<14} NOT RECOMMENDED: not synchronized for good from each of the starts'
        for heading, content in told(task, found, parts, tolerance):
            yield f'  {heading:<14} {content}'


def told(task: Task, found: Assessment, parts: Sequence[Part], tolerance: float) -> Iterator[tuple[str, str]]:
    """What there is to say of a coupler: headings and contents."""
    if math.isnan(found.worst_steps):
        settling = sum(not math.isnan(steps) for steps in found.steps)
        yield 'steps', f'{settling} of {len(found.steps)} starts come into step; the worst: {found.verdict.meaning}'
    else:
        yield 'steps', f'{found.worst_steps:.0f} from the worst start, {found.time:.1f} s'
    if not any(map(math.isnan, found.strike_steps)):
        yield 'strike steps', f'{max(found.strike_steps):.0f} from the worst start, looking at strikes only'
    yield (
        'from each',
        ' '.join(
            f'{100 * phase:.0f} %: {_number(steps)}' for phase, steps in zip(task.phases, found.steps, strict=True)
        ),
    )
    if not math.isnan(found.multiplier):
        yield (
            'limit cycle',
            (
                f'swings from {50.0 + found.swing[0]:.2f} to {50.0 + found.swing[1]:.2f} %, at {found.speed:.3f} m/s; '
                f'a step leaves {100 * found.multiplier:.1f} % of a small error; '
                f'the damper takes {found.damper_loss:.2f} J/m'
            ),
        )
    yield from _bought(task, found, parts)
    yield 'margins', 'in step with ' + ', '.join(f'{name} {_margin(one)}' for name, one in found.margins.items())
    slope = found.margins['slope']
    yield (
        'gentlest slope',
        f'{math.degrees(slope.low * task.rig.slope):.2f}°'
        + (f'; on a gentler one: {slope.low_verdict.meaning}' if slope.low_verdict else '')
        + ('' if math.isnan(found.stall_slope) else f'; stalls at {math.degrees(found.stall_slope):.2f}° and below'),
    )
    off = f'{100 * tolerance:.0f} %'
    by_name = {(variation.parameter, variation.factor < 1.0): variation for variation in found.sensitivity}
    yield (
        f'if {off} off',
        '; '.join(
            f'{name} less: {_outcome(by_name[name, True])}, more: {_outcome(by_name[name, False])}' for name in VARIED
        ),
    )


def _bought(task: Task, found: Assessment, parts: Sequence[Part]) -> Iterator[tuple[str, str]]:
    """What spring and dashpot must be like."""
    loads, rig = found.loads, task.rig.resolved()
    if not math.isnan(loads.force):
        yield (
            'bears',
            f'{loads.force:.1f} N at most (spring {loads.spring_force:.1f}, damper {loads.damper_force:.1f}), '
            f'{1e3 * loads.stroke:.0f} mm of stroke ({loads.shortest:.3f} to {loads.longest:.3f} m between the hubs), '
            f'{loads.speed:.2f} m/s in the damper'
            + ('' if math.isnan(loads.heat) else f', {loads.heat:.0f} J of heat a minute'),
        )
    ordered, half = _order(task, found, parts), half_step_distance(rig)
    if not math.isnan(ordered.free_length):
        more, least = '', ordered.least_free_length
        if ordered.free_length == least:
            more = ' or more'
        elif ordered.free_length < least and math.isinf(_spring(parts, found.k).max_stroke):
            more = f', TOO SHORT: at least {1e3 * least:.0f} mm bear this'
        stretched = (
            f'it is lengthened by up to {1e3 * ordered.lengthened:.0f} mm and shortened by up to '
            f'{1e3 * ordered.shortened:.0f} mm'
        )
        yield 'spring', f'free length {1e3 * ordered.free_length:.0f} mm{more}; {stretched}'
    rods = '' if math.isnan(ordered.rods) else f'{1e3 * ordered.rods:.0f} mm of rods and eyes; '
    yield (
        'mounting',
        f'{rods}without force where the hubs are D0 = {rig.D0:.3f} m apart, '
        + (
            'as at 50 %: no preload'
            if abs(half - rig.D0) < LEAST_PRELOAD
            else f'and it {"pulls" if half > rig.D0 else "pushes"} with {abs(ordered.preload):.2g} N at 50 %, '
            f'where they are {half:.3f} m apart'
        ),
    )


def _order(task: Task, found: Assessment, parts: Sequence[Part]) -> Order:
    """The spring to order; its free length is that on the list where it has one."""
    return order(task.rig, found.k, found.loads, _spring(parts, found.k).free_length)


def _spring(parts: Sequence[Part], k: float) -> Part:
    """The first one of this stiffness on the list, or one of which nothing more is known."""
    return next((part for part in parts if part.kind == SPRING and part.value == k), Part(SPRING, k))


def warnings(task: Task, found: Assessment) -> Iterator[str]:
    """What to print large: a slope not far below the rig's on which the pair stalls, or leaves the band."""
    stall, least = found.stall_slope, found.margins['slope'].low * task.rig.slope
    near = (1.0 - NEAR) * task.rig.slope
    if found.verdict is Verdict.IN_STEP and least > max(near, stall + SLOPE_SHOWN):
        yield f'in step only above {math.degrees(least):.2f}°'
    if stall > near:
        yield f'stalls at {math.degrees(stall):.2f}° and below'


def _sentence(parts: Iterator[str]) -> str:
    text = ', '.join(parts)
    return text[:1].upper() + text[1:]


def _texts(
    task: Task,
    chosen: dict[str, Assessment],
    parts: Sequence[Part],
    tolerance: float,
    outlooks: dict[str, Outlook],
) -> dict[str, str]:
    """The card's words."""
    return {
        name: '\n'.join(
            [
                f'{name.upper()}   {_coupler(task, found, parts)}',
                *(
                    f'{heading}: {content}'
                    for heading, content in told(task, found, parts, tolerance)
                    if heading != 'from each'
                ),
                *([f'of {FINAL} rigs as likely: {_likely(outlooks[name])}'] if outlooks else []),
            ]
        )
        for name, found in chosen.items()
    }


def json_record(
    task: Task,
    chosen: dict[str, Assessment],
    seen: dict[str, Steps],
    parts: Sequence[Part],
    tolerance: float,
) -> dict[str, Any]:
    """Everything for a program; SI units and radians but where a name says otherwise; null where there is none."""
    scales = nondimensional(task.rig)[1]
    return {
        'parameters': {name: value for name, value in flatten(task.rig.resolved()).items() if name not in ('k', 'b')},
        'task': {
            'seconds': task.seconds,
            'band_percent': task.band_percent,
            'tolerance': tolerance,
            'starts_percent': [100.0 * phase for phase in task.phases],
        },
        'couplers': {
            name.replace(' ', '_'): {
                'k': found.k,
                'b': found.b,
                'k_nondimensional': found.k / scales.stiffness,
                'b_nondimensional': found.b / scales.damping,
                **(
                    {'spring': _named(parts, SPRING, found.k), 'dashpot': _named(parts, DASHPOT, found.b)}
                    if parts and name != GIVEN
                    else {}
                ),
                'recommended': recommended(found, seen[name]),
                'monitor_steps': list(seen[name]),
                'verdict': found.verdict.name.lower(),
                'worst_steps': found.worst_steps,
                'worst_time': found.time,
                'steps': list(found.steps),
                'strike_steps': list(found.strike_steps),
                'swing_percent': [50.0 + error for error in found.swing],
                'multiplier': found.multiplier,
                'speed': found.speed,
                'damper_loss': found.damper_loss,
                'loads': load_record(found),
                'hub_distance_at_rest': task.rig.resolved().D0,
                **order_record(_order(task, found, parts)),
                'stall_slope': found.stall_slope,
                'margins': {
                    name: {
                        'low': margin.low,
                        'high': margin.high,
                        **{
                            f'{side}_verdict': verdict and verdict.name.lower()
                            for side, verdict in (('low', margin.low_verdict), ('high', margin.high_verdict))
                        },
                    }
                    for name, margin in found.margins.items()
                },
                'sensitivity': [
                    {
                        'parameter': variation.parameter,
                        'factor': variation.factor,
                        'verdict': variation.verdict.name.lower(),
                        'worst_steps': variation.steps,
                    }
                    for variation in found.sensitivity
                ],
            }
            for name, found in chosen.items()
        },
    }


def _rig_line(task: Task) -> str:
    rig = task.rig
    same = rig.front == rig.rear
    wheels = [f'{wheel.length:.4g} m, {wheel.mass:.4g} kg, {wheel.spokes:g} spokes' for wheel in (rig.front, rig.rear)]
    return (
        f'Two wheels of {wheels[0]}' if same else f'A front wheel of {wheels[0]}, a rear one of {wheels[1]}'
    ) + f', on {math.degrees(rig.slope):.3g}°.'


def _coupler(task: Task, found: Assessment, parts: Sequence[Part]) -> str:
    names = ', '.join(filter(None, (_named(parts, SPRING, found.k), _named(parts, DASHPOT, found.b))))
    scales = nondimensional(task.rig)[1]
    return (
        f'k = {found.k:.4g} N/m, b = {found.b:.4g} N·s/m   (k̂ = {found.k / scales.stiffness:.3g}, '
        f'b̂ = {found.b / scales.damping:.3g})' + (f'   {names}' if names else '')
    )


def _named(parts: Sequence[Part], kind: str, value: float) -> str:
    return next((part.name for part in parts if part.kind == kind and part.value == value), '')


def _margin(margin: Margin) -> str:
    low = f'{margin.low:.2f}' if margin.low_verdict is not None else f'{1 / WIDEST:.2f} or less'
    high = f'{margin.high:.2f}' if margin.high_verdict is not None else f'{min(margin.high, WIDEST):.0f} or more'
    return f'{low} to {high} times'


def _outcome(variation: Variation) -> str:
    return variation.verdict.name.lower() if math.isnan(variation.steps) else f'{variation.steps:.0f}'


def _number(steps: float) -> str:
    return '–' if math.isnan(steps) else f'{steps:.0f}'

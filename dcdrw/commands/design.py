"""`dcdrw design`: which spring and which dashpot to buy for a rig, and what if they are not what they say."""

import argparse
import math
from collections.abc import Iterator
from itertools import product, zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dcdrw.console import Bar, add_json, check_json, positive, tell, tell_where
from dcdrw.drawings.design_card import draw_card
from dcdrw.drawings.figure_files import add_formats, figure_files, write_figure
from dcdrw.files import add_force, refuse_existing, to_json, write_text
from dcdrw.suite.parameter_file import add_rig_options, chosen_params
from dcdrw.trials.monitored import monitored
from dcdrw_msgs_py.quantity import flatten
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.text_file import read_rows
from dcdrw_sim.figures.style import new_figure
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
    forgiving_order,
    mesh,
    score,
    search,
)
from dcdrw_sim.study.sweep import default_seconds
from dcdrw_sim.study.verdict import Verdict
from dcdrw_tracker.gait.sync import SyncParams

STIFFNESS = 1e-4, 1.0
"""What is searched by default, without dimensions."""
DAMPING = 1e-2, 1e2
MOST_PARTS = 20_000
"""Pairs of parts that are judged in minutes."""
AFTERWARDS = 30.0
"""The monitor sees so much more of a motion than it takes to come into step, in √(ℓ/g)."""
FASTEST, FORGIVING, GIVEN = 'fastest', 'most forgiving', 'given'

_EPILOG = """\
Steps are those of the front wheel to synchronization, as the monitor counts them: until the error stays within the band
at every instant, from the worst of nine initial phases. A coupler whose limit cycle swings beyond the band never comes
into step. Strike steps look at the strikes of the front wheel only. Before a coupler is recommended, the monitor's own
core has seen it come into step from each start.

The fastest coupler needs fewest steps. The most forgiving needs fewest where k and b are each off by the tolerance
either way and the slope is a tenth gentler than thought: where parts are bought by their data sheets, take this one.

--available takes a table with a header: kind,value,name, a row for each part; kind is spring (value in N/m) or dashpot
(value in N·s/m); name may be left out. Every pair of them is judged, in the place of the search.

examples:
  dcdrw design                                            for the paper's rig
  dcdrw design --mass 12 --length 0.9 --slope-deg 2.5 --out design
  dcdrw design --available parts.csv --out design         the best pair among those on sale
  dcdrw design --k 5.25 --b 100                           judge a coupler beside the best ones
"""


Steps = tuple[int | None, ...]


class Part(NamedTuple):
    """A spring or a dashpot on sale."""

    kind: str
    value: float
    """[N/m] or [N·s/m]"""
    name: str


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
    parts = read_parts(options.available) if options.available else []
    check_json(options)
    if options.out:
        new_figure(1, 1, 'a card')
        files = figure_files(options.out, ['card'], options.formats)
        refuse_existing([options.out / 'design.json', *files], options.force)
    with Bar('judging', 'couplers') as bar:
        k, b = _bounds(options, task.rig)
        if parts:
            bar.begin(GRID**2)
            grid = score(task, *mesh(k, b), report=bar.more)
            pairs = _best_parts(task, parts, tolerance, bar)
        else:
            bar.begin(WORK)
            grid, *pairs = search(task, k, b, tolerance, bar.more)
    chosen = {name: assess(task, *pair, tolerance) for name, pair in zip((FASTEST, FORGIVING), pairs, strict=True)}
    if options.k:
        chosen[GIVEN] = assess(task, options.k, options.b, tolerance)
    seen = {name: by_monitor(task, found) for name, found in chosen.items()}
    found = json_record(task, chosen, seen, parts, tolerance)
    tell(options, summary_lines(task, chosen, seen, parts, tolerance), found)
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        write_text(options.out / 'design.json', to_json(found), options.force)
        texts = _texts(task, chosen, parts, tolerance)
        on_sale = {kind: [part.value for part in _of(parts, kind)] for kind in ('spring', 'dashpot')}
        card = draw_card(_rig_line(task), texts, task, grid, chosen, on_sale)
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


def read_parts(path: Path) -> list[Part]:
    """Read a table of parts.

    Raises:
        ValueError: it is none, has a row that makes no sense, or lacks springs or dashpots.
        OSError: it cannot be read.

    """
    rows = read_rows(path)
    _, names = next(rows, (0, []))
    if not {'kind', 'value'} <= set(names):
        raise ValueError(f'{path} must begin with the header kind,value,name, got {",".join(names)[:80]!r}')
    parts = [_part(dict(zip_longest(names, row[: len(names)])), f'{path}, line {line}') for line, row in rows]
    for kind in ('spring', 'dashpot'):
        if not any(part.kind == kind for part in parts):
            raise ValueError(f'{path} has no {kind}')
    if len(_of(parts, 'spring')) * len(_of(parts, 'dashpot')) > MOST_PARTS:
        raise ValueError(f'{path} makes more than {MOST_PARTS} pairs: leave out what is out of the question')
    return parts


def _part(row: dict[str, Any], place: str) -> Part:
    kind = (row['kind'] or '').strip().lower()
    if kind not in ('spring', 'dashpot'):
        raise ValueError(f'{place}: kind must be spring or dashpot, got {row["kind"]!r}')
    try:
        value = positive((row['value'] or '').strip())
    except argparse.ArgumentTypeError as error:
        raise ValueError(f'{place}: value {error}') from None
    return Part(kind, value, (row.get('name') or '').strip())


def _of(parts: list[Part], kind: str) -> list[Part]:
    return [part for part in parts if part.kind == kind]


def _task(options: argparse.Namespace) -> Task:
    rig = chosen_params(options).rig
    return Task(rig, default_seconds(rig), options.band)


def _bounds(options: argparse.Namespace, rig: RigParams) -> Iterator[tuple[float, float]]:
    scales = nondimensional(rig)[1]
    for name, unit, (least, most) in (('k', scales.stiffness, STIFFNESS), ('b', scales.damping, DAMPING)):
        high = getattr(options, f'{name}_max') or unit * most
        low = getattr(options, f'{name}_min') or min(unit * least, high)
        if low > high:
            raise ValueError(f'--{name}-min {low:g} is above --{name}-max {high:g}')
        yield low, high


def _best_parts(task: Task, parts: list[Part], tolerance: float, bar: Bar) -> list[tuple[float, float]]:
    ks, bs = (
        np.array(column)
        for column in zip(
            *product((part.value for part in _of(parts, 'spring')), (part.value for part in _of(parts, 'dashpot'))),
            strict=True,
        )
    )
    bar.begin(len(ks))
    first = score(task, ks, bs, report=bar.more).order()[0]
    bar.begin(len(ks) * CASES)
    near = forgiving_order(task, ks, bs, tolerance, bar.more)[0]
    return [(float(ks[index]), float(bs[index])) for index in (first, near)]


def summary_lines(
    task: Task,
    chosen: dict[str, Assessment],
    seen: dict[str, Steps],
    parts: list[Part],
    tolerance: float,
) -> Iterator[str]:
    """Lines for a person; `seen` is what the monitor says of each."""
    yield _rig_line(task)
    starts = len(task.phases)
    yield f'In step: within ±{task.band_percent:g} % of 50 % at every instant, from the worst of {starts} starts.'
    for name, found in chosen.items():
        yield ''
        yield f'{name:<16} {_coupler(task, found, parts)}'
        if recommended(found, seen[name]):
            yield f'  {"monitor":<14} synchronized from each of {starts} starts, in as many steps'
        else:
            yield f'  {"monitor":<14} NOT RECOMMENDED: not synchronized for good from each of the starts'
        for heading, content in told(task, found, tolerance):
            yield f'  {heading:<14} {content}'


def told(task: Task, found: Assessment, tolerance: float) -> Iterator[tuple[str, str]]:
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
    yield 'margins', '; '.join(f'{name} {_margin(margin)}' for name, margin in found.margins.items())
    slope = found.margins['slope']
    yield (
        'gentlest slope',
        (
            f'{math.degrees(slope.low * task.rig.slope):.2f}°'
            + (f'; on a gentler one: {slope.low_verdict.meaning}' if slope.low_verdict else '')
        ),
    )
    off = f'{100 * tolerance:.0f} %'
    by_name = {(variation.parameter, variation.factor < 1.0): variation for variation in found.sensitivity}
    yield (
        f'if {off} off',
        '; '.join(
            f'{name} less: {_outcome(by_name[name, True])}, more: {_outcome(by_name[name, False])}' for name in VARIED
        ),
    )


def _texts(task: Task, chosen: dict[str, Assessment], parts: list[Part], tolerance: float) -> dict[str, str]:
    """The card's words."""
    return {
        name: '\n'.join(
            [
                f'{name.upper()}   {_coupler(task, found, parts)}',
                *(
                    f'{heading}: {content}'
                    for heading, content in told(task, found, tolerance)
                    if heading != 'from each'
                ),
            ]
        )
        for name, found in chosen.items()
    }


def json_record(
    task: Task,
    chosen: dict[str, Assessment],
    seen: dict[str, Steps],
    parts: list[Part],
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
                    {'spring': _named(parts, 'spring', found.k), 'dashpot': _named(parts, 'dashpot', found.b)}
                    if parts and name != GIVEN
                    else {}
                ),
                'recommended': recommended(found, seen[name]),
                'monitor_steps': list(seen[name]),
                'verdict': found.verdict.name.lower(),
                'worst_steps': _known(found.worst_steps),
                'worst_time': _known(found.time),
                'steps': [_known(steps) for steps in found.steps],
                'strike_steps': [_known(steps) for steps in found.strike_steps],
                'swing_percent': [_known(50.0 + error) for error in found.swing],
                'multiplier': _known(found.multiplier),
                'speed': _known(found.speed),
                'damper_loss': _known(found.damper_loss),
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
                        'worst_steps': _known(variation.steps),
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
    wheels = [f'{wheel.length:g} m, {wheel.mass:g} kg, {wheel.spokes:g} spokes' for wheel in (rig.front, rig.rear)]
    return (
        f'Two wheels of {wheels[0]}' if same else f'A front wheel of {wheels[0]}, a rear one of {wheels[1]}'
    ) + f', on {math.degrees(rig.slope):.3g}°.'


def _coupler(task: Task, found: Assessment, parts: list[Part]) -> str:
    names = ', '.join(filter(None, (_named(parts, 'spring', found.k), _named(parts, 'dashpot', found.b))))
    scales = nondimensional(task.rig)[1]
    return (
        f'k = {found.k:.4g} N/m, b = {found.b:.4g} N·s/m   (k̂ = {found.k / scales.stiffness:.3g}, '
        f'b̂ = {found.b / scales.damping:.3g})' + (f'   {names}' if names else '')
    )


def _named(parts: list[Part], kind: str, value: float) -> str:
    return next((part.name for part in parts if part.kind == kind and part.value == value), '')


def _margin(margin: Margin) -> str:
    low = f'{margin.low:.2f}' if margin.low_verdict is not None else f'<{1 / WIDEST:.2f}'
    high = f'{margin.high:.2f}' if margin.high_verdict is not None else f'>{min(margin.high, WIDEST):.0f}'
    return f'×{low} to ×{high}'


def _outcome(variation: Variation) -> str:
    return variation.verdict.name.lower() if math.isnan(variation.steps) else f'{variation.steps:.0f}'


def _number(steps: float) -> str:
    return '–' if math.isnan(steps) else f'{steps:.0f}'


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value

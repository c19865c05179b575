"""The table of springs with dashpots, ranked: for a person, for a spreadsheet, for a program."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from dcdrw_msgs_py.words import counted
from dcdrw_sim.study.design import Assessment
from dcdrw_sim.study.loads import Loads, Order
from dcdrw_sim.study.parts import Pair
from dcdrw_sim.study.verdict import Verdict

COLUMNS = (
    *('rank', 'spring', 'k', 'dashpot', 'b', 'worst_steps', 'worst_time', 'worst_steps_if_off'),
    *(*Loads._fields, 'stroke'),
    *(f'spring_{name}' for name in Order._fields),
    *('stall_slope', 'stall_slope_sought'),
)
"""Of a pair, in SI units."""
SHOWN = 12
"""Pairs that a person is shown."""


def pair_records(pairs: Sequence[Pair]) -> list[dict[str, Any]]:
    """The pairs that work, the best first, in SI units; NaN where there is no such number."""
    records = []
    for rank, pair in enumerate(working(pairs), 1):
        parts = pair.spring.name, pair.spring.value, pair.dashpot.name, pair.dashpot.value
        judged = rank, *parts, pair.steps, pair.time, pair.steps_if_off
        values = *judged, *load_record(pair).values(), *pair.order, pair.stall_slope, pair.stall_slope_sought
        records.append(dict(zip(COLUMNS, values, strict=True)))
    return records


def load_record(coupler: Pair | Assessment) -> dict[str, float]:
    """What a coupler bears, as `Loads`, in SI units; NaN where there is no such number."""
    return {**coupler.loads._asdict(), 'stroke': coupler.loads.stroke}


def order_record(ordered: Order) -> dict[str, float]:
    """The spring to order, as `Order`, in SI units; NaN where there is no such number."""
    return {f'spring_{name}': value for name, value in ordered._asdict().items()}


def working(pairs: Sequence[Pair]) -> list[Pair]:
    """The pairs that come into step from every start, and that all rated limits allow."""
    return [pair for pair in pairs if pair.works]


def pair_lines(pairs: Sequence[Pair], starts: int) -> Iterator[str]:
    """The table for a person."""
    good = working(pairs)
    yield f'{len(good)} of {len(pairs)} pairs come into step from each of {starts} starts, within all rated limits'
    if good:
        yield (
            '      k [N/m]  b [N·s/m]  steps  if off  force [N]  stroke [mm]  speed [m/s]  heat [J/min]  '
            'spring [mm]  stalls [°]  parts'
        )
    for rank, pair in enumerate(good[:SHOWN], 1):
        loads, off = pair.loads, '–' if math.isnan(pair.steps_if_off) else f'{pair.steps_if_off:.0f}'
        stalls = '–' if math.isnan(pair.stall_slope) else f'{math.degrees(pair.stall_slope):.2f}'
        yield (
            f'{rank:4}  {pair.spring.value:7.4g}  {pair.dashpot.value:9.4g}  {pair.steps:5.0f}  {off:>6}'
            f'  {loads.force:9.1f}  {1e3 * loads.stroke:11.0f}  {loads.speed:11.2f}  {loads.heat:12.0f}  '
            f'{1e3 * pair.order.free_length:11.0f}  {stalls:>10}  '
            + ', '.join(filter(None, (pair.spring.name, pair.dashpot.name)))
        ).rstrip()
    if good:
        yield '      spring: its free length, or the least that bears this; stalls: on this slope and gentler ones'
    if len(good) > SHOWN:
        yield f'      and {len(good) - SHOWN} more: --out writes all of them to pairs.csv, --json tells them'
    sought = sum(pair.stall_slope_sought for pair in good)
    if sought < len(good):
        yield f'      on which slope a pair stalls is sought of the best {sought} only, for the wheels differ'
    beyond = Counter(limit for pair in pairs if pair.verdict is Verdict.IN_STEP for limit in pair.exceeded)
    for limit, count in beyond.items():
        yield f'      left out, beyond the {limit}: {counted(count, "pair")}'

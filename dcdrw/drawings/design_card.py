"""The card of a design: one page to keep beside the rig."""

import math
import re
from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np

from dcdrw_sim.figures.style import BAND, BLUE, ORANGE, PINK, POINTS, VERMILION, new_figure
from dcdrw_sim.study.design import GRID, Assessment, Scores, Task
from dcdrw_sim.study.verdict import Verdict

A4 = 8.27, 11.69
"""[inch]; what needs more is on a longer page."""
TOP, PLOTS = 0.7, 5.2
"""Heights of the title, and of the plots at least [inch]."""
COLOURS = VERMILION, BLUE, PINK, ORANGE
"""Colours of the couplers, in their order."""
MARKERS = '*', 'o', 'D', 's'
LETTERS = 130
"""Of a line."""
LINE = 0.138
"""Height of a line of POINTS [inch]."""
LEFT, WIDTH = 0.05, 0.92
"""Of the frame about what is said of a coupler, as parts of the page."""
LARGE, LARGE_POINTS = 2.3, 16
"""Lines that large print takes, and its size."""
LONGEST = 60
"""Steps that the page shows."""


def draw_card(
    title: str,
    lines: dict[str, str],
    large: dict[str, str],
    task: Task,
    grid: Scores,
    chosen: dict[str, Assessment],
    on_sale: Mapping[str, Sequence[float]],
) -> Any:
    """The card as a matplotlib figure.

    Args:
        title: what it is for.
        lines: what is said of each coupler, by its name.
        large: what of it is printed large; empty where nothing is.
        task: what they were judged by.
        grid: the couplers of the first look.
        chosen: what was found, by name.
        on_sale: stiffnesses of springs and dampings of dashpots on sale; may be none.

    Raises:
        ValueError: matplotlib is not installed.

    """
    boxes = [
        _Box(large[name], _wrapped(text), colour) for (name, text), colour in zip(lines.items(), COLOURS, strict=False)
    ]
    height = max(A4[1], TOP + LINE * sum(box.lines for box in boxes) + PLOTS)
    figure = new_figure(A4[0], height, 'a card')
    below = _write(figure, height, title, boxes)
    figure.get_layout_engine().set(w_pad=0.15, h_pad=0.12, rect=(0.03, 0.02, 0.94, below - 0.03))
    top, middle, bottom = figure.subplots(3, 1, height_ratios=(2.6, 1.8, 1.8))
    _draw_map(top, grid, chosen, on_sale)
    _draw_paths(middle, task, chosen)
    _draw_sensitivity(bottom, chosen)
    return figure


class _Box(NamedTuple):
    """What is said of a coupler."""

    large: str
    text: str
    colour: str

    @property
    def lines(self) -> float:
        """The room that it takes, in lines, with its frame."""
        return self.text.count('\n') + 2.5 + (LARGE if self.large else 0.0)


def _wrapped(text: str) -> str:
    kept = re.sub(r'(?<=\d) (?=(?:J|N|mm|m|s)\b|%)', '\N{NO-BREAK SPACE}', text)  # a number and its unit
    return '\n'.join(fill(line, LETTERS, subsequent_indent='    ') for line in kept.split('\n'))


def _write(figure: Any, height: float, title: str, boxes: list[_Box]) -> float:
    """Write the words; returns where they end, as a part of the page."""
    from matplotlib.patches import Rectangle

    line, place = LINE / height, 1.0 - TOP / height
    figure.text(0.5, 1.0 - 0.6 * TOP / height, title, ha='center', fontsize=13, fontweight='bold')
    for box in boxes:
        figure.text(0.06, place, box.large, va='top', fontsize=LARGE_POINTS, fontweight='bold', color=VERMILION)
        below = place - (LARGE * line if box.large else 0.0)
        figure.text(0.06, below, box.text, va='top', fontsize=POINTS, linespacing=1.25)
        place -= box.lines * line
        corner, tall = (LEFT, place + 0.9 * line), (box.lines - 0.5) * line
        figure.add_artist(Rectangle(corner, WIDTH, tall, fill=False, edgecolor=box.colour, linewidth=1.2))
    return place


def _draw_map(axes: Any, grid: Scores, chosen: dict[str, Assessment], on_sale: Mapping[str, Sequence[float]]) -> None:
    """Steps from the worst start over k and b."""
    k, b, steps, verdict = (column.reshape(GRID, GRID) for column in (grid.k, grid.b, grid.steps, grid.verdict))
    image = axes.pcolormesh(
        b,
        k,
        np.ma.masked_invalid(np.minimum(steps, LONGEST)),
        cmap='cividis_r',
        shading='nearest',
        vmin=0,
        vmax=LONGEST,
        rasterized=True,
    )
    stalls = (verdict >= Verdict.STALLS).astype(float)
    if 0.0 < stalls.mean() < 1.0:
        axes.contourf(b, k, stalls, levels=[0.5, 1.5], colors=['0.88'], hatches=['////'])
    figure = axes.figure
    figure.colorbar(image, ax=axes, label='steps, worst start', extend='max', pad=0.01)
    for name, colour, marker in zip(chosen, COLOURS, MARKERS, strict=False):
        axes.plot(
            chosen[name].b,
            chosen[name].k,
            marker,
            color=colour,
            markeredgecolor='white',
            markersize=9,
            label=name,
            linestyle='none',
            clip_on=False,
            zorder=3,
        )
    for kind, line in (('spring', axes.axhline), ('dashpot', axes.axvline)):
        for value in on_sale[kind]:
            line(value, color='0.35', linewidth=0.5)
    axes.set(
        xscale='log',
        yscale='log',
        xlim=(b.min(), b.max()),
        ylim=(k.min(), k.max()),
        xlabel='b [N·s/m]',
        ylabel='k [N/m]',
    )
    axes.set_title('white: some start is never in step; hatched: a wheel stalls', loc='left')
    _legend(axes)


def _legend(axes: Any) -> None:
    axes.legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False, borderaxespad=0.1)


def _draw_paths(axes: Any, task: Task, chosen: dict[str, Assessment]) -> None:
    """The error at each strike of the front wheel, from every start."""
    scale, band = -100.0 / (2.0 * task.rig.rear.alpha), task.band_percent
    axes.axhspan(-band, band, color=BAND, alpha=0.18, linewidth=0, label=f'±{band:g} %')
    shown = 1
    for (name, found), colour, style in zip(chosen.items(), COLOURS, ('-', '--', ':', '-.'), strict=False):
        for number, path in enumerate(found.paths):
            error = scale * path[~np.isnan(path)]
            axes.plot(
                error, style, color=colour, linewidth=1.0, marker='.', markersize=3, label=name if number == 0 else None
            )
        shown = max(shown, min(LONGEST, 3 * (1 if math.isnan(found.worst_steps) else int(found.worst_steps)) + 6))
    axes.set(xlim=(0, shown), ylim=(-50, 50), xlabel='steps of the front wheel', ylabel='error [% of a step]')
    _legend(axes)


def _draw_sensitivity(axes: Any, chosen: dict[str, Assessment]) -> None:
    """Steps where one thing is off."""
    width = 0.8 / len(chosen)
    known = [
        variation.steps
        for found in chosen.values()
        for variation in found.sensitivity
        if not math.isnan(variation.steps)
    ]
    highest = max(known, default=1.0)
    for row, ((name, found), colour) in enumerate(zip(chosen.items(), COLOURS, strict=False)):
        for place, variation in enumerate(found.sensitivity):
            x = place + (row - (len(chosen) - 1) / 2) * width
            if math.isnan(variation.steps):
                axes.text(
                    x,
                    0.02 * highest,
                    variation.verdict.name.lower(),
                    rotation=90,
                    ha='center',
                    va='bottom',
                    color=colour,
                )
            else:
                axes.bar(x, variation.steps, 0.9 * width, color=colour, label=name if place == 0 else None)
    labels = [
        f'{variation.parameter} {100 * (variation.factor - 1):+.0f} %'
        for variation in next(iter(chosen.values())).sensitivity
    ]
    axes.set_xticks(range(len(labels)), labels)
    axes.set(ylabel='steps, worst start', xlim=(-0.5, len(labels) - 0.5), ylim=(0, 1.1 * highest))
    axes.locator_params(axis='y', integer=True)
    axes.set_title('what if one is off', loc='left')

"""Drawing of what would explain the paper's trial; each function draws into the matplotlib axes given to it."""

import math
from typing import Any

import numpy as np

from dcdrw_msgs_py.in_step import BAND_PERCENT
from dcdrw_sim.figures.style import BAND, BLACK, BLUE, ORANGE, VERMILION
from dcdrw_sim.study.riddle import SPANS, START, STEPS, Course, causes, course_of

SHOWN = 10
"""Strikes on the left."""
COLOURS = BLACK, VERMILION, BLUE, ORANGE
"""Of the causes that are told apart, the first ones; all others are grey."""


def draw_riddle(strikes: Any, times: Any) -> None:
    """Phase at the first strikes from 21.6 %, and against time, where the causes part."""
    for axes in (strikes, times):
        axes.axhspan(50.0 - BAND_PERCENT, 50.0 + BAND_PERCENT, color=BAND, alpha=0.18, linewidth=0)
    found = [(cause.name, course_of(cause)) for cause in causes()]
    for number, (name, one) in enumerate(found):
        told = number < len(COLOURS)
        style = {'color': COLOURS[number] if told else '0.7', 'zorder': 3 if told else 1}
        label = (
            name
            if told
            else 'mass, gyration, restitution, friction, one-way damper'
            if number == len(COLOURS)
            else None
        )
        strikes.plot(range(SHOWN + 1), [100.0 * START, *_phases(one)[:SHOWN]], marker='.', label=label, **style)
        if told:
            times.plot(*_cut(one), marker='.', markersize=3, linewidth=0.8, **style)
    strikes.axvline(STEPS, color='0.5', linestyle=':', zorder=0)
    strikes.set(xlabel='steps of the front wheel', ylabel='phase at strikes [% of a step]', xlim=(0, SHOWN))
    times.axvspan(0.0, SPANS[0], color='0.92', zorder=0, linewidth=0)
    times.set(xlabel='time [s]; grey: what the paper shows', xlim=(0, SPANS[-1]))
    strikes.figure.legend(loc='outside upper center', ncols=3, frameon=False)


def _cut(found: Course) -> tuple[Any, Any]:
    """Times and phases at strikes, cut where the phase begins anew at 0 %."""
    wraps = np.flatnonzero(abs(np.diff(found.strikes)) > 50.0) + 1
    return np.insert(found.strike_times, wraps, math.nan), 50.0 + np.insert(found.strikes, wraps, math.nan)


def _phases(found: Course) -> list[float]:
    return [50.0 + error for error in found.strikes.tolist()]

"""The figures of a report: trials over one another, and how the error of each dies out."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dcdrw.trials.day import SIMULATED, RecordedTrial
from dcdrw.trials.figure import SCREEN
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.figures.style import BAND, BLACK, BLUE, GREEN, ORANGE, PINK, SKY, VERMILION, new_figure

_COLOURS = BLUE, VERMILION, GREEN, PINK, SKY, ORANGE, BLACK
MOST_POINTS = 1500
"""Points of a curve: more than a page shows."""


def colour(number: int) -> str:
    """The colour of a trial in every figure."""
    return _COLOURS[number % len(_COLOURS)]


def dashes(trial: RecordedTrial) -> str:
    """The line of a trial: dashed where it was measured."""
    return '-' if trial.source == SIMULATED else '--'


def draw_steps(trials: Sequence[tuple[int, RecordedTrial]]) -> Any:
    """Phase differences at the strikes of the front wheel; the curve of trial n has the id `steps` n."""
    figure, axes = _axes()
    _shade_band(axes, max(trial.analysis.params.sync.band_percent for _, trial in trials))
    for number, trial in trials:
        steps, errors = _seen_errors(trial)
        axes.plot(
            steps,
            50.0 + errors,
            linestyle=dashes(trial),
            marker='.',
            markersize=5,
            linewidth=1.2,
            color=colour(number),
            gid=f'steps{number}',
        )
    axes.set(xlabel='steps of the front wheel', ylabel='phase [% of a step]')
    return figure


def draw_times(trials: Sequence[tuple[int, RecordedTrial]]) -> Any:
    """Phase differences against time; the curve of trial n has the id `time` n."""
    figure, axes = _axes()
    _shade_band(axes, max(trial.analysis.params.sync.band_percent for _, trial in trials))
    for number, trial in trials:
        axes.plot(*_thinned(trial), linestyle=dashes(trial), linewidth=1.2, color=colour(number), gid=f'time{number}')
    axes.set(xlabel='time [s]', ylabel='phase [% of a step]')
    return figure


def draw_decay(trial: RecordedTrial) -> Any:
    """The error at each strike of the front wheel, and the geometric decay fitted to it."""
    figure, axes = _axes(2.6)
    band = trial.analysis.params.sync.band_percent
    steps, errors = _seen_errors(trial)
    axes.axhspan(-band, band, color=BAND, alpha=0.18, linewidth=0, label=f'±{band:g} %')
    axes.axhline(0.0, color='0.85', linewidth=0.8, zorder=0)
    axes.plot(steps, errors, 'o', color=BLUE, markersize=4, label='error')
    limit, start, ratio, first = trial.decay
    if not math.isnan(limit):
        fine = np.linspace(first, max(steps[-1] - 1, 1), 400)
        axes.plot(
            fine + 1,
            limit + start * ratio ** (fine - first),
            color=VERMILION,
            linewidth=1.2,
            label=f'{limit:+.1f} % {start:+.1f} % · {ratio:.3f}ᵏ, of the last steps',
        )
    axes.set(xlabel='steps of the front wheel', ylabel='error [% of a step]')
    axes.legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1)
    return figure


def _shade_band(axes: Any, band: float) -> None:
    axes.axhspan(50 - band, 50 + band, color=BAND, alpha=0.18, linewidth=0, label=f'±{band:g} % of 50 %')
    axes.legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), frameon=False, borderaxespad=0.1)


def _seen_errors(trial: RecordedTrial) -> tuple[Floats, Floats]:
    """Strikes of the front wheel, as many as a page shows, and the error there [%]; NaN where it fell into a gap."""
    errors = np.array([error if seen else math.nan for _, error, seen in trial.analysis.strike_errors()])
    every = len(errors) // MOST_POINTS + 1
    return np.arange(1.0, len(errors) + 1)[::every], errors[::every]


def _thinned(trial: RecordedTrial) -> tuple[Floats, Floats]:
    """Time [s] and phase [% of a step] of as many samples as a page shows, cut at gaps and where the phase wraps."""
    motion = trial.analysis.judged
    phase = 100.0 * motion.phi / trial.analysis.pitch
    cuts = np.union1d(motion.gaps, np.flatnonzero(np.abs(np.diff(phase)) > 50.0) + 1)
    every = max(len(phase) // MOST_POINTS, 1)
    kept = np.union1d(np.arange(0, len(phase), every), [*cuts, *(cuts - 1)]).astype(int)
    places = np.searchsorted(kept, cuts)
    return np.insert(motion.seconds[kept], places, math.nan), np.insert(phase[kept], places, math.nan)


def _axes(height: float = 3.3) -> tuple[Any, Any]:
    figure = new_figure(SCREEN, height)
    axes = figure.subplots()
    axes.spines[['top', 'right']].set_visible(False)
    axes.margins(x=0.01)
    axes.locator_params(axis='x', integer=True)
    return figure, axes

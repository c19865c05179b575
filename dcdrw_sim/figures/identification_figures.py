"""The figure of an identification: each trial over the model, what is left of it, and the parameters' profiles."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.rolling import stance
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.figures.style import BLACK, ORANGE, PAGE, WHEELS, new_figure
from dcdrw_sim.identification.findings import NORMAL_90, Finding, Profile
from dcdrw_sim.identification.fit import Explained, Fit

COLUMNS = 4
"""Panels side by side."""
NARROW = 1e-2
"""Of its value: a parameter whose profile is narrower is drawn from its value on."""
RAISED = str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹')


def draw_identification(fit: Fit, found: Sequence[Finding], profiles: Sequence[Profile]) -> Any:
    """Rows of phase, residuals over time and over the stance angle, one for each trial; then a profile each.

    Raises:
        ValueError: matplotlib is not installed.

    """
    lower = math.ceil(len(profiles) / COLUMNS)
    figure = new_figure(PAGE, 2.1 * len(fit.trials) + 1.7 * lower, 'the figure of an identification')
    grid = figure.add_gridspec(len(fit.trials) + lower, COLUMNS, height_ratios=[2.1] * len(fit.trials) + [1.7] * lower)
    for row, trial in enumerate(fit.trials):
        _draw_phase(figure.add_subplot(grid[row, :2]), fit, trial, row)
        _draw_left(figure.add_subplot(grid[row, 2]), trial)
        _draw_over_stance(figure.add_subplot(grid[row, 3]), fit, trial)
    by_name = {finding.name: finding for finding in found}
    for index, profile in enumerate(profiles):
        axes = figure.add_subplot(grid[len(fit.trials) + index // COLUMNS, index % COLUMNS])
        _draw_profile(axes, by_name[profile.name], profile)
        if index % COLUMNS == 0:
            axes.set_ylabel('deviance')
    return figure


def _draw_phase(axes: Any, fit: Fit, trial: Explained, row: int) -> None:
    alphas = np.array([fit.known.rig.front.alpha, fit.known.rig.rear.alpha])
    seconds = trial.samples.seconds + trial.samples.begins
    measured = trial.samples.rotations / (2.0 * alphas)
    modelled = (trial.samples.rotations - trial.residuals) / (2.0 * alphas)
    for phase, style in (
        (measured, {'color': ORANGE, 'lw': 3.0, 'label': 'trial'}),
        (modelled, {'color': BLACK, 'lw': 0.8, 'label': 'model'}),
    ):
        axes.plot(seconds, 100.0 * (phase[:, 0] - phase[:, 1] + trial.samples.steps), **style)
    axes.axhline(50.0, color='0.8', lw=0.6, zorder=0)
    axes.set(xlabel='time [s]', ylabel='phase difference [%]', title=f'trial {row + 1} and the model')
    axes.legend(frameon=False)


def _power(values: Floats) -> int:
    """Of ten, by which values are divided so that their axis needs no offset; 0 where that is short anyway."""
    largest = float(np.abs(values).max(initial=0.0))
    power = math.floor(math.log10(largest)) if largest else 0
    return 0 if -3 < power < 4 else power


def _scaled(unit: str, power: int) -> str:
    """A unit, times a power of ten."""
    return ' '.join(filter(None, (f'10{str(power).translate(RAISED)}' if power else '', unit)))


def _draw_left(axes: Any, trial: Explained) -> None:
    seconds = trial.samples.seconds + trial.samples.begins
    power = _power(np.degrees(trial.residuals))
    for wheel, name in enumerate((FRONT, REAR)):
        kept = ~trial.outliers[:, wheel]
        axes.plot(seconds[kept], np.degrees(trial.residuals[kept, wheel]) / 10.0**power, '.', ms=2, color=WHEELS[name])
    left = int(trial.outliers.sum())
    axes.set(
        xlabel='time [s]',
        ylabel=f'residual [{_scaled("°", power)}]',
        title=f'rms {math.degrees(trial.noise):.3f}°, {left} left out',
    )


def _draw_over_stance(axes: Any, fit: Fit, trial: Explained) -> None:
    power = _power(np.degrees(trial.residuals))
    for wheel, (name, of) in enumerate(((FRONT, fit.known.rig.front), (REAR, fit.known.rig.rear))):
        kept = ~trial.outliers[:, wheel]
        _, theta = stance(of.alpha, trial.samples.rotations[kept, wheel])
        residuals = np.degrees(trial.residuals[kept, wheel]) / 10.0**power
        axes.plot(np.degrees(theta), residuals, '.', ms=2, color=WHEELS[name], alpha=0.3)
        edges = np.linspace(-of.alpha, of.alpha, 13)
        which = np.digitize(theta, edges) - 1
        middles, means = zip(
            *((0.5 * (edges[i] + edges[i + 1]), residuals[which == i].mean()) for i in range(12) if (which == i).any()),
            strict=True,
        )
        axes.plot(np.degrees(middles), means, color=WHEELS[name], lw=2.0, label=name)
    axes.set(xlabel='stance angle θ [°]', ylabel=f'residual [{_scaled("°", power)}]')
    axes.legend(loc='lower center', bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False, borderaxespad=0.1)


def _draw_profile(axes: Any, finding: Finding, profile: Profile) -> None:
    origin = finding.value if np.ptp(profile.values) < NARROW * abs(finding.value) else 0.0
    power = _power(profile.values - origin)
    values, low, high = ((at - origin) / 10.0**power for at in (profile.values, finding.low, finding.high))
    axes.plot(values, profile.deviance, 'o-', color=BLACK)
    axes.axhline(NORMAL_90**2, color='0.7', lw=0.8)
    axes.axvspan(low, high, color='0.93', zorder=0)
    label = ' '.join(filter(None, (_scaled(finding.unit, power), f'from {origin:.4g}' if origin else '')))
    axes.set(title=f'{finding.name.replace("_", " ")}\n{finding.source.value}', xlabel=label or ' ', ylim=(-0.2, 6.0))
    axes.locator_params(axis='x', nbins=3)

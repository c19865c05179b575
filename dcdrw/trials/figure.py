"""The picture of a trial: stance angles, phase difference, gait diagram and coupler force against time."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from dcdrw.trials.analysis import Analysis, Floats
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import SECOND
from dcdrw_sim.figures.style import BAND, BLACK, WHEELS, new_figure, save

_FORCE = '#555555'


def draw_trial(trial: Analysis, title: str, path: Path) -> None:
    """Draw a trial into a PNG, PDF or SVG file, by the ending of its name.

    Raises:
        ValueError: matplotlib is not installed.

    """
    figure = new_figure(10, 9)
    angles, phase, gait, force = figure.subplots(4, 1, sharex=True, height_ratios=(3, 3, 1.3, 2))
    time = trial.motion.seconds
    _draw_angles(angles, trial, time)
    _draw_phase(phase, trial, time)
    _draw_gait(gait, trial, time)
    _draw_force(force, trial, time)
    force.set_xlabel('time [s]')
    if len(time):
        force.set_xlim(0.0, max(float(time[-1]), 1e-3))
    figure.suptitle(title, wrap=True)
    for axes in (angles, phase, gait, force):
        axes.spines[['top', 'right']].set_visible(False)
    figure.align_ylabels()
    save(figure, path)


def _legend(axes: Any) -> None:
    axes.legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1)


def _second(trial: Analysis, stamp_ns: int) -> float:
    return float(stamp_ns - trial.motion.stamp_ns[0]) / SECOND


def _broken(angle: Floats, step: float) -> Floats:
    """The angle in degrees, cut where it wraps: a strike is a jump, not a motion."""
    degrees = np.degrees(angle)
    degrees[np.abs(np.diff(degrees, prepend=degrees[:1])) > step / 2] = math.nan
    return degrees


def _draw_angles(axes: Any, trial: Analysis, time: Floats) -> None:
    motion = trial.motion
    for wheel, theta, name in ((FRONT, motion.theta1, 'θ₁ front'), (REAR, motion.theta2, 'θ₂ rear')):
        axes.plot(
            time,
            _broken(theta, math.degrees(trial.pitch)),
            color=WHEELS[wheel],
            label=name,
            linewidth=1.3,
            linestyle='-' if wheel == FRONT else '--',
        )
    axes.axhline(0.0, color='0.85', zorder=0, linewidth=0.8)
    axes.set_ylabel('stance angle [°]')
    _legend(axes)


def _draw_phase(axes: Any, trial: Analysis, time: Floats) -> None:
    step = math.degrees(trial.pitch)
    band = trial.params.sync.band_percent / 100.0 * step
    axes.axhspan(
        step / 2 - band,
        step / 2 + band,
        color=BAND,
        alpha=0.18,
        linewidth=0,
        label=f'±{trial.params.sync.band_percent:g} % of 50 %',
    )
    axes.axhline(step / 2, color=BAND, linewidth=1)
    axes.plot(time, _broken(trial.motion.phi, step), color=BLACK, linewidth=1.3, label='φ')
    for fall in trial.footfalls:
        if fall.wheel == FRONT and fall.steps == trial.status.steps_to_synchronization:
            axes.axvline(
                _second(trial, fall.stamp_ns),
                color=BAND,
                linestyle=':',
                linewidth=1.5,
                label=f'from step {fall.steps} on',
            )
    axes.set_ylim(0.0, step)
    axes.set_ylabel('phase difference φ [°]')
    percent = axes.secondary_yaxis('right', functions=(lambda deg: deg / step * 100, lambda p: p / 100 * step))
    percent.set_ylabel('[% of a step]')
    _legend(axes)


def _draw_gait(axes: Any, trial: Analysis, time: Floats) -> None:
    """Each bar is one stance, from a footfall to the next of that wheel; the legs alternate in shade."""
    end = float(time[-1]) if len(time) else 0.0
    for row, wheel in enumerate((REAR, FRONT)):
        falls = [(0.0, 0)] + [
            (_second(trial, fall.stamp_ns), fall.steps) for fall in trial.footfalls if fall.wheel == wheel
        ]
        for (begin, steps), (until, _) in zip(falls, [*falls[1:], (end, 0)], strict=True):
            axes.barh(
                row,
                until - begin,
                left=begin,
                height=0.6,
                color=WHEELS[wheel],
                alpha=0.85 if steps % 2 else 0.35,
                linewidth=0,
            )
        axes.plot(
            [time for time, _ in falls[1:]],
            [row + 0.42] * (len(falls) - 1),
            'v',
            color=WHEELS[wheel],
            markersize=4,
            clip_on=False,
        )
    axes.set_yticks((0, 1), (REAR, FRONT))
    axes.set_ylim(-0.4, 1.6)
    axes.set_ylabel('stances')


def _draw_force(axes: Any, trial: Analysis, time: Floats) -> None:
    known = ~np.isnan(trial.motion.coupler_force)
    axes.axhline(0.0, color='0.85', zorder=0, linewidth=0.8)
    axes.set_ylabel('coupler force [N]')
    if known.any():
        axes.plot(time[known], trial.motion.coupler_force[known], color=_FORCE, linewidth=1.0)
    else:
        axes.text(0.5, 0.5, 'the source does not tell the coupler force', transform=axes.transAxes, ha='center')

"""The picture of a trial: stance angles, phase difference, gait diagram and coupler force against time."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from dcdrw.summary import SECOND, TrialData, pitch
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_tracker.sync import SyncStatus

# Okabe and Ito's palette: told apart by the colour-blind, and in grey by lightness.
_COLOURS = {FRONT: '#0072B2', REAR: '#D55E00'}
_PHASE, _BAND, _FORCE = '#000000', '#009E73', '#555555'


def draw_trial(data: TrialData, status: SyncStatus, title: str, path: Path) -> None:
    """Draw a trial into a PNG, PDF or SVG file, by the ending of its name.

    Raises:
        ValueError: matplotlib is not installed.

    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise ValueError('a picture needs matplotlib: pip install matplotlib') from None
    figure = Figure(figsize=(10, 9), layout='constrained')
    FigureCanvasAgg(figure)
    angles, phase, gait, force = figure.subplots(4, 1, sharex=True, height_ratios=(3, 3, 1.3, 2))
    start_ns = data.phases[0].stamp_ns if data.phases else 0
    _draw_angles(angles, data, start_ns)
    _draw_phase(phase, data, status, start_ns)
    _draw_gait(gait, data, start_ns)
    _draw_force(force, data, start_ns)
    force.set_xlabel('time [s]')
    if data.phases:
        force.set_xlim(0.0, max((data.phases[-1].stamp_ns - start_ns) / SECOND, 1e-3))
    figure.suptitle(title, wrap=True)
    for axes in (angles, phase, gait, force):
        axes.spines[['top', 'right']].set_visible(False)
    figure.align_ylabels()
    figure.savefig(path, dpi=120)


def _legend(axes: Any) -> None:
    axes.legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1)


def _times(stamps: Any, start_ns: int) -> Any:
    return (np.array(stamps, dtype=np.int64) - start_ns) / SECOND


def _draw_angles(axes: Any, data: TrialData, start_ns: int) -> None:
    time = _times([phase.stamp_ns for phase in data.phases], start_ns)
    for wheel, name in ((FRONT, 'θ₁ front'), (REAR, 'θ₂ rear')):
        theta = np.degrees([getattr(phase, wheel).angle for phase in data.phases])
        strikes = np.abs(np.diff(theta, prepend=theta[:1])) > math.degrees(pitch(data)) / 2
        theta[strikes] = math.nan  # a strike is a jump, not a motion
        axes.plot(time, theta, color=_COLOURS[wheel], label=name, linewidth=1.3,
                  linestyle='-' if wheel == FRONT else '--')
    axes.axhline(0.0, color='0.85', zorder=0, linewidth=0.8)
    axes.set_ylabel('stance angle [°]')
    _legend(axes)


def _draw_phase(axes: Any, data: TrialData, status: SyncStatus, start_ns: int) -> None:
    time = _times([phase.stamp_ns for phase in data.phases], start_ns)
    step = math.degrees(pitch(data))
    phi = np.degrees([phase.phi.angle for phase in data.phases])
    phi[np.abs(np.diff(phi, prepend=phi[:1])) > step / 2] = math.nan
    band = data.params.sync.band_percent / 100.0 * step
    axes.axhspan(step / 2 - band, step / 2 + band, color=_BAND, alpha=0.18, linewidth=0,
                 label=f'±{data.params.sync.band_percent:g} % of 50 %')
    axes.axhline(step / 2, color=_BAND, linewidth=1)
    axes.plot(time, phi, color=_PHASE, linewidth=1.3, label='φ')
    for fall in data.footfalls:
        if fall.wheel == FRONT and fall.steps == status.steps_to_synchronization:
            axes.axvline((fall.stamp_ns - start_ns) / SECOND, color=_BAND, linestyle=':', linewidth=1.5,
                         label=f'from step {fall.steps} on')
    axes.set_ylim(0.0, step)
    axes.set_ylabel('phase difference φ [°]')
    percent = axes.secondary_yaxis('right', functions=(lambda deg: deg / step * 100, lambda p: p / 100 * step))
    percent.set_ylabel('[% of a step]')
    _legend(axes)


def _draw_gait(axes: Any, data: TrialData, start_ns: int) -> None:
    """Each bar is one stance, from a footfall to the next of that wheel; the legs alternate in shade."""
    end = (data.phases[-1].stamp_ns - start_ns) / SECOND if data.phases else 0.0
    for row, wheel in enumerate((REAR, FRONT)):
        falls = [(0.0, 0)] + [((fall.stamp_ns - start_ns) / SECOND, fall.steps)
                              for fall in data.footfalls if fall.wheel == wheel]
        for (begin, steps), (until, _) in zip(falls, [*falls[1:], (end, 0)], strict=True):
            axes.barh(row, until - begin, left=begin, height=0.6, color=_COLOURS[wheel],
                      alpha=0.85 if steps % 2 else 0.35, linewidth=0)
        axes.plot([time for time, _ in falls[1:]], [row + 0.42] * (len(falls) - 1), 'v', color=_COLOURS[wheel],
                  markersize=4, clip_on=False)
    axes.set_yticks((0, 1), (REAR, FRONT))
    axes.set_ylim(-0.4, 1.6)
    axes.set_ylabel('stances')


def _draw_force(axes: Any, data: TrialData, start_ns: int) -> None:
    known = [joints for joints in data.joints if not math.isnan(joints.coupler.force)]
    axes.axhline(0.0, color='0.85', zorder=0, linewidth=0.8)
    axes.set_ylabel('coupler force [N]')
    if known:
        axes.plot(_times([joints.stamp_ns for joints in known], start_ns),
                  [joints.coupler.force for joints in known], color=_FORCE, linewidth=1.0)
    else:
        axes.text(0.5, 0.5, 'the source does not tell the coupler force', transform=axes.transAxes, ha='center')

"""The picture of a trial: stance angles, phase difference, gait, coupler force and synchronizer against time."""

import math
from itertools import pairwise
from pathlib import Path
from textwrap import wrap
from typing import Any, NamedTuple

import numpy as np

from dcdrw.trials.acts import stretches
from dcdrw.trials.analysis import Analysis
from dcdrw.trials.motion import MotionTable, thinned
from dcdrw_control.sync.safety import State
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.rolling import rear_side
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.figures.style import (
    BAND,
    BLACK,
    COLUMN,
    GREEN,
    ORANGE,
    SKY,
    VERMILION,
    WHEELS,
    for_print,
    new_figure,
    save,
)

SCREEN = 9.0
"""Width on a screen [inch]; on a printed page its letters are of POINTS still."""
CLOSE = 10
"""Steps per inch from which on lines and marks are drawn finer, so that they do not run into one another."""
MOST_DRAWN = 8192
"""Rows of a motion that are drawn at most: several for each dot of the picture's width."""
MOST_STANCES = 400
"""Of more stances of a wheel each would be as wide as a dot: they are drawn as one."""
LETTERS = 15
"""Letters of POINTS that an inch of a title's line holds."""
_FORCE = '#555555'
ACTS = 0.8
"""Height of the panel of the synchronizer's states, as those of the others in `trial_figure`."""
ACTS_LABEL = 'synchro-\nnizer'
STATES = {
    State.DISABLED: '0.8',
    State.ARMED: SKY,
    State.ACTIVE: GREEN,
    State.RAMP_DOWN: ORANGE,
    State.FAULT: VERMILION,
}
"""Colours of the synchronizer's states."""
FEET = {1: '1 left', 2: '2 right', 3: '3 left', 4: '4 right'}
"""Of the person in front, and of the robot behind."""


def draw_trial(trial: Analysis, title: str, path: Path) -> None:
    """Draw a trial into a PNG, PDF or SVG file, by the ending of its name.

    Raises:
        ValueError: matplotlib is not installed.

    """
    with for_print():
        save(trial_figure(trial, title, COLUMN), path)


def trial_figure(trial: Analysis, title: str, width: float = SCREEN) -> Any:
    """The picture. Where samples are missing, curves and stances break and footfalls are left out.

    Args:
        trial: what to draw.
        title: above it.
        width: of the picture [inch].

    Raises:
        ValueError: as `draw_trial`.

    """
    course = _Course.of(trial, width)
    force_known = bool(np.isfinite(course.motion.coupler_force).any())
    title = _in_lines(title, width)
    height = 4.2 + 0.31 * width if force_known else 3.5 + 0.26 * width
    drawn = [_draw_angles, _draw_phase, _draw_feet if course.person else _draw_gait]
    ratios = [3.0, 3.0, 1.3]
    if force_known:
        drawn.append(_draw_force)
        ratios.append(2.0)
    if trial.acts:
        drawn.append(_draw_acts)
        ratios.append(ACTS)
        height *= 1.0 + ACTS / sum(ratios)
    figure = new_figure(width, height + 0.16 * (title.count('\n') + 1))
    panels = figure.subplots(len(drawn), 1, sharex=True, height_ratios=ratios)
    for draw, axes in zip(drawn, panels, strict=True):
        draw(axes, course)
    last = panels[-1]
    last.set_xlabel('time [s]')
    if len(course.time):
        last.set_xlim(0.0, max(float(course.time[-1]), 1e-3))
    for axes in panels:
        axes.spines[['top', 'right']].set_visible(False)
        _shade_gaps(axes, course)
    figure.suptitle(title)
    figure.align_ylabels()
    return figure


class _Course(NamedTuple):
    """What of a trial is drawn: all of it, or where the stamps went back, the run that is judged."""

    trial: Analysis
    motion: MotionTable
    time: Floats
    """[s]"""
    pieces: list[tuple[float, float]]
    """Times between which no sample is missing [s]."""
    width: float
    """Of the picture [inch]."""

    @classmethod
    def of(cls, trial: Analysis, width: float) -> '_Course':
        motion = trial.motion
        if (np.diff(motion.stamp_ns) <= 0).any():
            motion = motion.rows(motion.restarts == motion.restarts[-1])
        motion = thinned(motion, MOST_DRAWN)
        time = motion.seconds
        edges = pairwise([0, *motion.gaps.tolist(), len(time)])
        pieces = [(time[first], time[last - 1]) for first, last in edges if last > first]
        return cls(trial, motion, time, pieces, width)

    @property
    def bars(self) -> list[tuple[float, float]]:
        """Begin and length of each piece [s]."""
        return [(begin, end - begin) for begin, end in self.pieces]

    @property
    def step(self) -> float:
        """φ of a whole step [°]."""
        return math.degrees(self.trial.pitch)

    @property
    def fine(self) -> float:
        """What lines and marks of steps are scaled by."""
        return min(1.0, max(CLOSE * self.width / max(self.trial.status.steps, 1), 0.2))

    @property
    def person(self) -> bool:
        """Whether a person walks in the place of the front wheel."""
        return self.trial.params.simulator.person.walks

    def line(self, values: Floats, jump: float = math.inf) -> tuple[Floats, Floats]:
        """Time and values of a curve, cut where samples are missing, and where it jumps by more than this."""
        cuts = np.union1d(self.motion.gaps, np.flatnonzero(np.abs(np.diff(values)) > jump) + 1)
        return np.insert(self.time, cuts, math.nan), np.insert(values, cuts, math.nan)

    def falls(self, wheel: str) -> list[tuple[float, int]]:
        """Time [s] and number of each footfall of a wheel that was seen."""
        start = self.motion.stamp_ns[0] if len(self.time) else 0
        falls = [
            (float(fall.stamp_ns - start) / SECOND, fall.steps) for fall in self.trial.footfalls if fall.wheel == wheel
        ]
        return [(second, steps) for second, steps in falls if any(begin <= second <= end for begin, end in self.pieces)]


def _in_lines(title: str, width: float) -> str:
    """Lines of about one length, that fit into a picture of this width [inch]."""
    lines = len(title) // int(LETTERS * width) + 1
    return '\n'.join(wrap(title, max(len(title) // lines + 10, 1)))


def _shade_gaps(axes: Any, course: _Course) -> None:
    gaps = [(end, begin - end) for (_, end), (begin, _) in pairwise(course.pieces)]
    axes.broken_barh(gaps, (0.0, 1.0), transform=axes.get_xaxis_transform(), color='0.5', alpha=0.16, zorder=0)


def _legend(axes: Any) -> None:
    legend = axes.legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False, borderaxespad=0.1)
    for line in legend.get_lines():
        line.set_linewidth(1.3)


def _draw_angles(axes: Any, course: _Course) -> None:
    motion = course.motion
    for wheel, theta, name in ((FRONT, motion.theta1, 'θ₁ front'), (REAR, motion.theta2, 'θ₂ rear')):
        axes.plot(
            *course.line(np.degrees(theta), course.step / 2),  # a strike is a jump, not a motion
            color=WHEELS[wheel],
            label=name,
            linewidth=1.3 * course.fine,
            linestyle='-' if wheel == FRONT else '--',
        )
    if len(course.pieces) > 1:
        axes.fill_between([], [], color='0.5', alpha=0.25, linewidth=0, label='no samples')
    axes.axhline(0.0, color='0.85', zorder=0, linewidth=0.8)
    axes.set_ylabel('stance angle [°]')
    _legend(axes)


def _draw_phase(axes: Any, course: _Course) -> None:
    step, params = course.step, course.trial.params.sync
    band = params.band_percent / 100.0 * step
    axes.axhspan(
        step / 2 - band,
        step / 2 + band,
        color=BAND,
        alpha=0.18,
        linewidth=0,
        label=f'±{params.band_percent:g} % of 50 %',
    )
    axes.axhline(step / 2, color=BAND, linewidth=1)
    axes.plot(
        *course.line(np.degrees(course.motion.phi), step / 2), color=BLACK, linewidth=1.3 * course.fine, label='φ'
    )
    status = course.trial.status
    entered = status.steps_to_synchronization
    for second in [second for second, steps in course.falls(FRONT) if steps == entered][-1:]:
        axes.axvline(second, color=BAND, linestyle=':', linewidth=1.5, label=f'from step {status.steps_text} on')
    axes.set_ylim(0.0, step)
    axes.set_ylabel('phase difference φ [°]')
    percent = axes.secondary_yaxis('right', functions=(lambda deg: deg / step * 100, lambda p: p / 100 * step))
    percent.set_ylabel('[% of a step]')
    _legend(axes)


def _draw_gait(axes: Any, course: _Course) -> None:
    """Each bar is one stance, from a footfall to the next of that wheel; the legs alternate in shade."""
    for row, wheel in enumerate((REAR, FRONT)):
        falls = course.falls(wheel)
        if len(falls) > MOST_STANCES:
            axes.broken_barh(course.bars, (row - 0.3, 0.6), color=WHEELS[wheel], alpha=0.6, linewidth=0)
            continue
        stances: tuple[list[tuple[float, float]], ...] = [], []
        for start, stop in course.pieces:
            inside = [(second, steps) for second, steps in falls if start <= second <= stop]
            first = inside[0][1] - 1 if inside else max([steps for second, steps in falls if second < start], default=0)
            for (begin, steps), (until, _) in pairwise([(start, first), *inside, (stop, 0)]):
                stances[steps % 2].append((begin, until - begin))
        for bars, alpha in zip(stances, (0.35, 0.85), strict=True):
            axes.broken_barh(bars, (row - 0.3, 0.6), color=WHEELS[wheel], alpha=alpha, linewidth=0)
        axes.plot(
            [second for second, _ in falls],
            [row + 0.42] * len(falls),
            'v',
            color=WHEELS[wheel],
            markersize=4 * course.fine,
            clip_on=False,
        )
    axes.set_yticks((0, 1), (REAR, FRONT))
    axes.set_ylim(-0.4, 1.6)
    axes.set_ylabel('stances')


def _draw_feet(axes: Any, course: _Course) -> None:
    """Hildebrand's diagram of the four feet, numbered in their rows: a bar from each footfall to the other foot's.

    A wheel's strikes are of the left and the right foot in turn. The front one begins with the left; of the rear one,
    that is left which leads it by a quarter stride as nearly as can be.
    """
    rows: dict[int, list[tuple[float, float]]] = {foot: [] for foot in FEET}
    falls = {wheel: course.falls(wheel) for wheel in (FRONT, REAR)}
    side = _rear_side(falls[FRONT], falls[REAR])
    for wheel, first, offset in ((FRONT, 1, 0), (REAR, 3, side)):
        for (begin, steps), (until, after) in pairwise(falls[wheel]):
            if after == steps + 1 and any(start <= begin and until <= stop for start, stop in course.pieces):
                rows[first + (steps + offset) % 2].append((begin, until - begin))
    for foot, bars in rows.items():
        wheel = FRONT if foot <= 2 else REAR
        bars = course.bars if len(falls[wheel]) > MOST_STANCES else bars
        axes.broken_barh(bars, (-foot - 0.35, 0.7), color=WHEELS[wheel], alpha=0.85, linewidth=0)
    axes.set_yticks([-foot for foot in FEET], list(FEET.values()))
    axes.set_ylim(-4.6, -0.4)
    axes.set_ylabel('feet')


def _rear_side(front: list[tuple[float, int]], rear: list[tuple[float, int]]) -> int:
    """`rear_side` by the first footfall that tells it."""
    for second, steps in rear:
        before = [number for begin, number in front if begin <= second]
        if before:
            return rear_side(before[-1], steps)
    return 0


def _draw_force(axes: Any, course: _Course) -> None:
    force = course.motion.coupler_force
    axes.axhline(0.0, color='0.85', zorder=0, linewidth=0.8)
    if not course.person:
        axes.set_ylabel('coupler force [N]')
        axes.plot(*course.line(force), color=_FORCE, linewidth=course.fine)
        return
    peak, rms = np.nanmax(np.abs(force)), math.sqrt(np.nanmean(force**2))
    axes.set_ylabel('on the person [N]')  # tension pulls back
    axes.plot(
        *course.line(-force),
        color=_FORCE,
        linewidth=course.fine,
        label=f'at most {peak:.1f} N, {rms:.1f} N rms, + forward',
    )
    _legend(axes)


def _draw_acts(axes: Any, course: _Course) -> None:
    """A bar for each state of the synchronizer, from when it was told on."""
    start_ns, end = int(course.motion.stamp_ns[0]) if len(course.time) else 0, max(course.time, default=0.0)
    told = stretches(course.trial.acts, start_ns, end)
    for state, colour in STATES.items():
        bars = [(one.begin, one.end - one.begin) for one in told if one.state == state.value]
        axes.broken_barh(bars, (0.0, 1.0), color=colour, linewidth=0, label=state.value if bars else None)
    axes.set_yticks([])
    axes.set_ylim(0.0, 1.0)
    axes.set_ylabel(ACTS_LABEL, rotation=0, ha='right', va='center')
    _legend(axes)

"""Maps of regimes and basins of attraction; each function draws into the matplotlib axes given to it."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.figures.style import BLACK, BLUE, VERMILION
from dcdrw_sim.figures.sweep_figures import label_coupler_axes
from dcdrw_sim.model.scaling import nondimensional
from dcdrw_sim.model.wheel import gentlest_slope
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.relatives.even_gait import gentlest_even_gait
from dcdrw_sim.study.regimes import Basin, gentlest_slopes, stall_bands, steepest_stall
from dcdrw_sim.study.verdict import Verdict

REGIMES = (
    ('walks in step', '#86BAE0', (Verdict.IN_STEP,)),
    ('walks, undecided when time is over', '#F0E442', (Verdict.UNDECIDED,)),
    ('walks about the goal, but swings beyond the band', '#A6D8C0', (Verdict.SWINGS,)),
    ('walks beside the goal', '#F4C27A', (Verdict.ELSEWHERE,)),
    ('stalls', '0.55', (Verdict.STALLS, Verdict.STANDS, Verdict.FALLS, Verdict.COLLIDES, Verdict.RACES)),
)
"""Name, colour, and the verdicts that make them; lightness tells them apart, too."""
CURVE_POINTS = 41
"""Points of a boundary."""


def draw_coupler_regimes(axes: Any, dataset: Any, shorter: float | None = None) -> None:
    """What becomes of a rig over k and b, with the stall band's edges by continuation.

    Args:
        axes: matplotlib axes.
        dataset: a sweep over k and b.
        shorter: the line within which pairs are in step after this time [s], to be drawn, too.

    """
    from dcdrw_sim.study.sweep_dataset import sweep_of

    rig = sweep_of(dataset).rig.resolved()
    _draw_regimes(axes, dataset.k, dataset.b, dataset.verdict.values.T)
    ks = np.geomspace(float(dataset.k[0]), float(dataset.k[-1]), CURVE_POINTS)
    low, high = stall_bands(spread(rig, CURVE_POINTS, {'k': ks}))
    axes.plot(ks, low.values, color=BLACK, linewidth=2, label='the limit cycle ends: fold')
    axes.plot(ks, high.values, color=BLACK, linewidth=2)
    swing = np.maximum(abs(dataset.cycle_low.values), abs(dataset.cycle_high.values)).T
    band = dataset.attrs['band_percent']
    axes.contour(dataset.k, dataset.b, swing, levels=[band], colors=VERMILION, linestyles='--', linewidths=1.5)
    axes.plot([], [], '--', color=VERMILION, linewidth=1.5, label=f'it swings to ±{band:g} % of a step from 50 %')
    if shorter:
        late = np.where(np.isfinite(dataset.time.values), dataset.time.values, 1e3 * shorter).T
        axes.contour(
            dataset.k, dataset.b, np.log(late / shorter), levels=[0.0], colors=BLUE, linestyles=':', linewidths=2
        )
        axes.plot([], [], ':', color=BLUE, linewidth=2, label=f'in step after {shorter:g} time units')
    label_coupler_axes(axes, dataset)


def draw_slope_regimes(axes: Any, dataset: Any) -> None:
    """What becomes of a rig over slope and damping, with the gentlest slope by continuation and in closed form.

    Args:
        axes: matplotlib axes.
        dataset: a sweep over slope_deg and b.

    """
    from dcdrw_sim.study.sweep_dataset import sweep_of

    rig = sweep_of(dataset).rig.resolved()
    _draw_regimes(axes, dataset.slope_deg, dataset.b, dataset.verdict.values.T)
    bs = np.geomspace(float(dataset.b[0]), float(dataset.b[-1]), CURVE_POINTS)
    exact = gentlest_slopes(spread(rig, CURVE_POINTS, {'b': bs}))
    axes.plot(np.degrees(exact.values), bs, color=BLACK, linewidth=2, label='the limit cycle ends: fold')
    plain, scales = nondimensional(rig)
    closed = [gentlest_even_gait(plain.front.alpha, plain.k, b / scales.damping).slope for b in bs]
    axes.plot(np.degrees(closed), bs, '--', color=BLUE, linewidth=1.5, label='the same in closed form')
    worst, slope = steepest_stall(rig)
    axes.plot(
        math.degrees(slope),
        worst,
        'D',
        color=VERMILION,
        markersize=7,
        label=f'steeper than {math.degrees(slope):.3f}° no damper stalls',
    )
    alone = math.degrees(gentlest_slope(rig.front, rig.rolling_resistance))
    axes.axvspan(
        0.0,
        alone,
        facecolor='none',
        edgecolor='0.8',
        hatch='xx',
        linewidth=0,
        zorder=0,
        label=f'below {alone:.3f}° no wheel rolls by itself',
    )
    axes.set_yscale('log')
    axes.set_xlim(0.0, float(dataset.slope_deg[-1]))
    axes.set_ylim(bs[0], bs[-1])
    axes.set_xlabel('slope γ [°]')
    axes.set_ylabel('damping b̂ = (b/m) √(ℓ/g)')


def draw_basin(axes: Any, rig: RigParams, basin: Basin, edge: tuple[Floats, Floats]) -> Any:
    """Steps to synchronization, or else strike steps, from every phase and speed; returns what a colour bar needs.

    Args:
        axes: matplotlib axes.
        rig: the rig, for the title.
        basin: its basin.
        edge: phases, and the least speeds from which it walks, as `least_speeds`.

    """
    from matplotlib.colors import ListedColormap

    phases, percent = 100.0 * basin.phases, 100.0 * basin.speeds
    stalls = np.where(basin.verdicts >= Verdict.STALLS, 1.0, math.nan)
    steps = basin.steps if np.isfinite(basin.steps).any() else basin.strike_steps
    mesh = axes.pcolormesh(phases, percent, steps.T, cmap='cividis_r', vmin=0.0, rasterized=True)
    axes.pcolormesh(phases, percent, stalls.T, cmap=ListedColormap(['0.75']), rasterized=True)
    axes.set_xlim(0.0, phases[-1])
    axes.set_ylim(percent[0], percent[-1])
    axes.plot(100.0 * edge[0], 100.0 * edge[1], color=VERMILION, linewidth=2, label='least speed, by bisection')
    axes.axhline(100.0, color=BLACK, linewidth=0.8, linestyle=':')
    axes.plot([], [], 's', color='0.75', markeredgecolor='0.4', markersize=9, label='stalls')
    axes.set_xlabel('phase at the start [% of a step]')
    axes.set_ylabel('speed of both wheels at the start\n[% of their uncoupled limit cycles]')
    plain = nondimensional(rig)[0]
    axes.set_title(f'k̂ = {plain.k:.3g}, b̂ = {plain.b:.3g}')
    axes.legend(loc='upper right', framealpha=1.0, edgecolor='none')
    return mesh


def label_regimes(axes: Any, room: Any = None, **where: Any) -> None:
    """A legend of the regimes and of the lines drawn; in the axes `room`, where they are given."""
    for name, colour, _ in REGIMES:
        axes.plot([], [], 's', color=colour, markersize=7, markeredgecolor='0.4', label=name)
    (room or axes).legend(*axes.get_legend_handles_labels(), **where)


def _draw_regimes(axes: Any, x: Any, y: Any, verdicts: NDArray[np.int8]) -> None:
    from matplotlib.colors import ListedColormap

    regimes = np.zeros(verdicts.shape)
    for number, (_, _, members) in enumerate(REGIMES):
        regimes[np.isin(verdicts, members)] = number
    axes.pcolormesh(
        x,
        y,
        regimes,
        cmap=ListedColormap([colour for _, colour, _ in REGIMES]),
        vmin=-0.5,
        vmax=len(REGIMES) - 0.5,
        rasterized=True,
    )

"""Drawings of the models that the coupled pair builds on; each function draws into the matplotlib axes given to it."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.figures.style import BLACK, BLUE, GREEN, ORANGE, VERMILION
from dcdrw_sim.model.wheel import gentlest_slope, limit_cycle_speed
from dcdrw_sim.relatives.footfall_order import FEET, Contact, order
from dcdrw_sim.relatives.rigid_pair import NEAR_TOGETHER, RigidPair, energy_per_metre, fastest_phase, slope_for_velocity
from dcdrw_sim.relatives.rimless_wheel import Fate, fate, limit_cycle_velocity, steepest_slope

_ROLLS, _STANDS = '#DCEFFA', '0.62'


def draw_basin(
    axes: Any, wheel: WheelParams, slope: float, gravity: float, pixels: tuple[int, int] = (120, 600)
) -> None:
    """Angle and speed from which a single wheel comes to roll, or to stand, with the limit cycle drawn in."""
    unit, alpha = math.sqrt(gravity / wheel.length), wheel.alpha
    thetas, omegas = np.linspace(-alpha, alpha, pixels[0]), np.linspace(-unit, 0.8 * unit, pixels[1])
    rolls = [[fate(wheel, slope, gravity, theta, omega) is Fate.ROLLS for theta in thetas] for omega in omegas]
    axes.contourf(np.degrees(thetas), omegas, np.array(rolls, float), levels=[-0.5, 0.5, 1.5], colors=[_STANDS, _ROLLS])
    angles = np.linspace(-alpha, alpha, 100)
    axes.plot(
        np.degrees(angles),
        limit_cycle_speed(wheel, slope, gravity, angles),
        color=BLUE,
        linewidth=2,
        label='limit cycle',
    )
    rest = slope < alpha
    axes.plot(
        np.degrees([-alpha, alpha]) if rest else [],
        [0.0, 0.0] if rest else [],
        's',
        color=BLACK,
        markersize=7,
        clip_on=False,
        zorder=5,
        label='at rest on two spokes',
    )
    axes.plot([], [], 's', color=_ROLLS, markersize=10, markeredgecolor='0.5', label='comes to roll')
    axes.plot([], [], 's', color=_STANDS, markersize=10, markeredgecolor='0.5', label='comes to stand')
    axes.set_xlim(*np.degrees([-alpha, alpha]))
    axes.set_xlabel('stance angle θ [°]')
    axes.set_ylabel('speed θ̇ [rad/s]')
    axes.legend(loc='lower center', bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)


def draw_wheel_speed(axes: Any, wheel: WheelParams, slope: float, gravity: float) -> None:
    """Mean speed of a single wheel against the slope, and the slopes where its behaviour changes."""
    least, most = gentlest_slope(wheel), steepest_slope(wheel)
    end = max(most, wheel.alpha, slope) * 1.15
    slopes = np.concatenate([least + np.geomspace(1e-9, 1e-3, 40), np.linspace(least + 2e-3, end, 120)])
    speeds = np.array([limit_cycle_velocity(wheel, value, gravity) for value in slopes])
    axes.plot(np.degrees(slopes), speeds, color=BLUE, linewidth=2)
    for value, text, style in (
        (least, 'rolls from here on', '--'),
        (most, 'a real foot would lift off', ':'),
        (wheel.alpha, 'cannot stand any more', '-.'),
    ):
        axes.axvline(
            math.degrees(value),
            color='0.35',
            linestyle=style,
            linewidth=1.2,
            label=f'{math.degrees(value):.2f}°: {text}',
        )
    here = limit_cycle_velocity(wheel, slope, gravity)
    if not math.isnan(here):
        axes.plot(
            math.degrees(slope),
            here,
            'o',
            color=VERMILION,
            markersize=7,
            label=f'{math.degrees(slope):.2f}°: {here:.3f} m/s',
        )
    axes.set_xlim(0.0, math.degrees(end))
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel('slope γ [°]')
    axes.set_ylabel('mean speed [m/s]')
    axes.legend(loc='lower right', framealpha=1.0, edgecolor='none')


def draw_speed(axes: Any, rig: RigParams, coupled: tuple[float, float] | None = None, points: int = 81) -> None:
    """Mean speed of the rigid pair against its phase, its maximum, and the pair that strikes with both at once.

    Args:
        axes: matplotlib axes.
        rig: as `RigidPair`.
        coupled: phase and mean speed of the coupled pair on its limit cycle, to be marked.
        points: phases drawn.

    Raises:
        ValueError: as `RigidPair` and `fastest_phase`.

    """
    phases = np.linspace(NEAR_TOGETHER, 1.0 - NEAR_TOGETHER, points)
    axes.plot(
        100.0 * phases,
        [RigidPair(rig, phase).gait().velocity for phase in phases],
        color=BLUE,
        linewidth=2,
        label='rigid bar',
    )
    best = fastest_phase(rig)
    top = RigidPair(rig, best).gait().velocity
    axes.plot(
        100.0 * best, top, 'D', color=VERMILION, markersize=7, label=f'fastest: {top:.3f} m/s at {100 * best:.1f} %'
    )
    together = RigidPair(rig, 0.0).gait().velocity
    if not math.isnan(together):
        axes.plot(
            [0.0, 100.0],
            [together] * 2,
            'o',
            color=BLACK,
            markersize=6,
            clip_on=False,
            label=f'both strike at once: {together:.3f} m/s',
        )
    if coupled:
        axes.plot(
            100.0 * coupled[0],
            coupled[1],
            '*',
            color=GREEN,
            markersize=13,
            label=f'spring and damper: {coupled[1]:.3f} m/s at {100 * coupled[0]:.1f} %',
        )
    _phase_axis(axes)
    axes.set_ylabel('mean speed [m/s]')


def draw_energy(axes: Any, rig: RigParams, points: int = 33) -> None:
    """Energy that the rigid pair's strikes take per metre, at the speed of 50 % on the rig's slope, against phase.

    On one slope every steady gait loses the same per metre, what the slope gives; so the speed is what is held, and
    the slope that it takes is what differs.

    Raises:
        ValueError: as `RigidPair`, or the slope is too gentle for a gait at 50 %.

    """
    velocity = RigidPair(rig, 0.5).gait().velocity
    if math.isnan(velocity):
        raise ValueError(f'slope {math.degrees(rig.slope):.4g}° is too gentle for the rigid pair at 50 %')
    phases = np.linspace(NEAR_TOGETHER, 1.0 - NEAR_TOGETHER, points)
    axes.plot(
        100.0 * phases,
        [_cost(rig, phase, velocity) for phase in phases],
        color=BLUE,
        linewidth=2,
        label=f'rigid bar, at {velocity:.3f} m/s',
    )
    axes.plot(
        [0.0, 100.0],
        [_cost(rig, 0.0, velocity)] * 2,
        'o',
        color=BLACK,
        markersize=6,
        clip_on=False,
        label='both strike at once',
    )
    _phase_axis(axes)
    axes.set_ylabel('energy lost per metre [J/m]')
    weight = energy_per_metre(rig._replace(slope=math.pi / 2))
    slope = axes.secondary_yaxis(
        'right',
        functions=(
            lambda cost: np.degrees(np.arcsin(np.clip(cost / weight, -1.0, 1.0))),
            lambda degrees: weight * np.sin(np.radians(degrees)),
        ),
    )
    slope.set_ylabel('slope that it takes [°]')


def draw_hildebrand(axes: Any, contacts: Sequence[Contact], unit: str = 'stride', title: str = '') -> None:
    """Hildebrand's gait diagram: a bar for each contact of each foot, the falls numbered by foot."""
    rows = (4, 2, 1, 3)  # from the bottom; Hildebrand sets the rear feet outside
    for contact in contacts:
        front, left = contact.foot in (1, 2), contact.foot in (1, 3)
        y = rows.index(contact.foot)
        axes.barh(
            y,
            contact.end - contact.start,
            left=contact.start,
            height=0.62,
            color=BLUE if front else ORANGE,
            edgecolor=BLACK,
            linewidth=0.8,
            hatch='' if left else '///',
        )
        axes.text(contact.start, y + 0.34, f' {contact.foot}', va='bottom', ha='left', clip_on=True)
    axes.set_yticks(range(4), [f'{FEET[foot]} {foot}' for foot in rows])
    axes.set_ylim(-0.5, 3.75)
    axes.set_xlabel(f'time [{unit}]')
    axes.set_title('   '.join(filter(None, (title, order(contacts)))))


def _cost(rig: RigParams, phase: float, velocity: float) -> float:
    return energy_per_metre(rig._replace(slope=slope_for_velocity(rig, phase, velocity)))


def _phase_axis(axes: Any) -> None:
    axes.axvline(50.0, color='0.8', linewidth=1, zorder=0)
    axes.set_xlim(0.0, 100.0)
    axes.set_xticks(range(0, 101, 25))
    axes.set_xlabel('phase p [% of a step]; half of it in % of a stride')
    axes.legend(loc='lower center', bbox_to_anchor=(0.5, 1.0), frameon=False)

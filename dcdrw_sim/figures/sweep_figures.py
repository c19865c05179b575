"""Drawings of a sweep over k and b, and of a single motion; each function draws into the matplotlib axes given to it.

Datasets are those of `dcdrw_sim.study.sweep_dataset`, over k and b. A coupler is valid in the paper's sense where
from every start |θ2| comes within the band at some section, and the pair walks on.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.rolling import phi_pitch, steps_ahead
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.figures.style import BLACK, BLUE, GREEN, ORANGE, PINK, SKY, VERMILION
from dcdrw_sim.map.regression import Regression, fit_affine, fit_raw
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.study.verdict import Verdict

EIGENVALUES = {
    'raw_eigenvalues': "the paper's regression (raw)",
    'affine_eigenvalues': 'regression with an offset',
    'multipliers': 'exact multiplier',
}
"""What can be drawn over k and b, and its name."""
STARTS = (BLUE, VERMILION, GREEN, ORANGE, SKY, PINK, BLACK, '#999999', '#882255')
"""Colours of the starts: Okabe and Ito's, and one more."""
SAMPLES = 4000
"""Samples of a motion that is drawn."""


class Best(NamedTuple):
    """The valid coupler with the smallest largest multiplier."""

    indices: tuple[int, int]
    k: float
    b: float
    multiplier: float


def is_valid(dataset: Any) -> NDArray[np.bool_]:
    """Which couplers are valid, shape (k, b): from every start |θ2| comes within the band, and the pair walks on."""
    valid: NDArray[np.bool_] = (dataset.enters.values == 1.0) & (dataset.verdict.values < Verdict.STALLS)
    return valid


def best_coupler(dataset: Any) -> Best:
    """The valid coupler that brings a small deviation back fastest.

    Raises:
        ValueError: no coupler is valid.

    """
    valid = is_valid(dataset) & dataset.stable.values
    if not valid.any():
        raise ValueError('no coupler of this sweep brings every start within the band')
    moduli = np.where(valid, dataset.multipliers.values[:, :, 0], math.inf)
    i, j = np.unravel_index(int(moduli.argmin()), moduli.shape)
    return Best((int(i), int(j)), float(dataset.k[i]), float(dataset.b[j]), float(moduli[i, j]))


def draw_trajectories(axes: Any, dataset: Any) -> None:
    """θ2 at the section, step by step, of every start of every valid coupler, coloured by where it starts."""
    from matplotlib.collections import LineCollection

    motions = np.degrees(dataset.section_theta2.values[is_valid(dataset)])
    steps = np.arange(motions.shape[-1])
    for start, phase in enumerate(dataset.start.values.tolist()):
        lines = [np.column_stack([steps, motion]) for motion in motions[:, start]]
        axes.add_collection(LineCollection(lines, colors=_colour(start), linewidths=0.4, alpha=0.25, rasterized=True))
        axes.plot([], [], color=_colour(start), label=f'{100 * phase:.0f} %')
    _draw_band(axes, dataset.attrs['theta2_band'])
    axes.set_xlim(0.0, max(float(np.isfinite(motions).any(axis=(0, 1)).sum()) - 1.0, 1.0))
    alpha = 180.0 / dataset.attrs['rear.spokes']
    axes.set_ylim(-alpha, alpha)
    axes.set_xlabel('steps of the front wheel')
    axes.set_ylabel('θ₂ at the section [°]')
    axes.set_title(f'{len(motions)} of {dataset.enters.size} couplers, {len(motions) * len(dataset.start)} motions')
    axes.legend(title='start', ncols=3, loc='upper right', framealpha=0.9, edgecolor='none')


def draw_eigenvalues(axes: Any, dataset: Any, name: str, norm: Any) -> Any:
    """The largest modulus of a set of EIGENVALUES at every valid coupler; returns what a colour bar needs."""
    moduli = dataset[name].values[:, :, 0]
    shown = is_valid(dataset) & np.isfinite(moduli)
    mesh = axes.pcolormesh(
        dataset.k, dataset.b, np.where(shown, moduli, math.nan).T, norm=norm, cmap='cividis', rasterized=True
    )
    stalls = dataset.verdict.values >= Verdict.STALLS
    axes.contourf(dataset.k, dataset.b, stalls.T.astype(float), levels=[0.5, 1.5], colors='none', hatches=['///'])
    axes.set_facecolor('0.93')
    span = f'{moduli[shown].min():.4f} to {moduli[shown].max():.4f}' if shown.any() else 'no coupler is valid'
    axes.set_title(f'{EIGENVALUES[name]}\n{span}')
    label_coupler_axes(axes, dataset)
    return mesh


def draw_best(axes: Any, dataset: Any, form: str) -> Regression:
    """θ2 at the section with the best coupler, and what a regression predicts from each start.

    Args:
        axes: matplotlib axes.
        dataset: with its trajectories.
        form: of the regression, `raw` (the paper's, x[m] = Aᵐ x[0]) or `affine` (with an offset).

    Raises:
        ValueError: no coupler is valid.

    """
    best = best_coupler(dataset)
    names = ('section_omega1', 'section_theta2', 'section_omega2', 'section_coupler_length')
    states = np.stack([dataset[name].values[best.indices] for name in names], axis=-1)
    motions = [motion[np.isfinite(motion).all(axis=1)] for motion in states]
    if form == 'affine':
        motions = [motion[:, :3] for motion in motions]
    found = fit_raw(motions) if form == 'raw' else fit_affine(motions)
    for start, motion in enumerate(motions):
        axes.plot(np.degrees(motion[:, 1]), 'o', color=_colour(start), markersize=2.5)
        axes.plot(np.degrees(predict(found, motion[0], len(motion))[:, 1]), color=_colour(start), linewidth=1.0)
    axes.plot([], [], 'o', color='0.4', markersize=3, label='simulated')
    axes.plot([], [], color='0.4', linewidth=1.0, label=f'predicted by the {form} regression')
    _draw_band(axes, dataset.attrs['theta2_band'])
    axes.set_xlabel('steps of the front wheel')
    axes.set_ylabel('θ₂ at the section [°]')
    axes.set_title(
        f'k̂ = {best.k:.3g}, b̂ = {best.b:.3g}: eigenvalue {abs(found.eigenvalues[0]):.4f}, '
        f'multiplier {best.multiplier:.4f}',
    )
    axes.legend(loc='upper right', framealpha=0.9, edgecolor='none')
    return found


def predict(regression: Regression, start: Floats, count: int) -> Floats:
    """The states that a regression predicts from a start on, shape (count, n)."""
    states = [start]
    for _ in range(count - 1):
        states.append(regression.matrix @ states[-1] + regression.offset)
    return np.array(states)


def draw_experiment(angles: Any, phase: Any, rig: RigParams, start: State, seconds: float, band_percent: float) -> None:
    """Stance angles and phase difference φ against time, as the paper shows those of its trials.

    Args:
        angles: matplotlib axes for θ1 and θ2.
        phase: matplotlib axes for φ.
        rig: the rig, its derived defaults filled in.
        start: the state at time 0, front wheel just after a strike.
        seconds: how long.
        band_percent: of a step, about 50 %.

    """
    motion = run(rig, start, seconds).at(np.linspace(0.0, seconds, SAMPLES))
    pitch = math.degrees(phi_pitch(rig.front, rig.rear))
    for theta, colour, style, name in (
        (motion.theta1, BLUE, '-', 'θ₁ front'),
        (motion.theta2, VERMILION, '--', 'θ₂ rear'),
    ):
        angles.plot(motion.time, _broken(np.degrees(theta), pitch), color=colour, linestyle=style, label=name)
    angles.set_ylabel('stance angle [°]')
    turns = steps_ahead(rig.front, rig.rear, motion.rotation1, motion.rotation2)
    band = band_percent / 100.0 * pitch
    phase.axhspan(
        0.5 * pitch - band,
        0.5 * pitch + band,
        color=GREEN,
        alpha=0.18,
        linewidth=0,
        label=f'±{band_percent:g} % (±{band:g}°) of 50 %',
    )
    phase.plot(motion.time, _broken((turns % 1.0) * pitch, pitch), color=BLACK, label='φ')
    phase.set_ylim(0.0, pitch)
    phase.set_ylabel('phase difference φ [°]')
    for axes in (angles, phase):
        axes.set_xlim(0.0, seconds)
        axes.set_xlabel('time [s]')
        axes.legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1)


def label_coupler_axes(axes: Any, dataset: Any) -> None:
    """Logarithmic axes of k and b, over the range of a sweep."""
    axes.set_xscale('log')
    axes.set_yscale('log')
    axes.set_xlim(float(dataset.k[0]), float(dataset.k[-1]))
    axes.set_ylim(float(dataset.b[0]), float(dataset.b[-1]))
    axes.set_xlabel('stiffness k̂ = kℓ/(mg)')
    axes.set_ylabel('damping b̂ = (b/m) √(ℓ/g)')


def _draw_band(axes: Any, band: float) -> None:
    axes.axhspan(-math.degrees(band), math.degrees(band), color='0.6', alpha=0.35, linewidth=0, zorder=0)


def _broken(degrees: Floats, pitch: float) -> Floats:
    """Cut where it wraps: a strike is a jump, not a motion."""
    return np.where(abs(np.diff(degrees, prepend=degrees[:1])) > 0.5 * pitch, math.nan, degrees)


def _colour(start: int) -> str:
    return STARTS[start % len(STARTS)]

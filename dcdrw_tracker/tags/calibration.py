"""What one roll before a standing camera tells: which way is downhill in the picture, each wheel's ℓ, and its zero.

While a wheel stands on a foot its hub is on a circle of radius ℓ about it, and the feet are σ = 2 ℓ sin α apart along
the slope. So the path of a hub is known from the rotations alone, but for a similarity (where, which way, ℓ), the zero
of the rotations, and the place of the hub from the tags. All but the zero has a closed form.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from dcdrw_msgs_py.rig import FRONT, REAR, WheelShape
from dcdrw_msgs_py.rolling import stance, step_length
from dcdrw_msgs_py.values import Floats
from dcdrw_msgs_py.words import counted
from dcdrw_tracker.tags.view_plane import PlaneAxes
from dcdrw_tracker.tags.wheel_view import PairView

Complexes = NDArray[np.complex128]

LONGEST_PAUSE = 0.3
"""A path ends where its wheel is hidden for longer: it may have turned by any number of steps meanwhile [s]."""
LEAST_STEPS = 4
"""Strikes that a path must have, else its arcs are too few."""
LARGEST_MISFIT = 0.01
"""A path that is further from a rolling wheel's, root mean square, is none [ℓ]."""
OUTLIER, OUTLIER_AT_LEAST = 5.0, 0.001
"""Places that are further from the path than so many medians, and than this [ℓ], do not count."""
SCAN = 24
"""Zeros within a step that are tried, before the best is refined."""
OTHER_SPOKES = range(4, 41)
"""Numbers of spokes that are tried where the configured one does not fit."""
LARGEST_ANGLE = math.radians(0.5)
"""Both hubs travel along one slope: no slope has directions that differ by more [rad]."""


class Estimate(NamedTuple):
    """A value and its standard error, told by leaving out one step after another (the jackknife)."""

    value: float
    spread: float


class WheelCalibration(NamedTuple):
    """What the path of one hub tells."""

    frames: int
    steps: int
    """Strikes."""
    turn: Estimate
    """Angle by which downhill is turned counter-clockwise in the picture from where slope and roll put it [rad]."""
    length: Estimate
    """ℓ, in the measure of the tags [m]; σ = 2 ℓ sin α."""
    zero: Estimate
    """What is to be added to ψ as it was seen, downhill being corrected [rad]."""
    tag_x: Estimate
    """How much further from the hub the tags are than was known, in the wheel's frame [m]."""
    tag_y: Estimate
    misfit: float
    """Root mean square distance of the hub from its path [m]."""


class Calibration(NamedTuple):
    """What a roll tells."""

    turn: Estimate
    """As `WheelCalibration.turn`, of both wheels together [rad]."""
    front: WheelCalibration
    rear: WheelCalibration

    def roll(self, axes: PlaneAxes) -> float:
        """Roll of the camera that puts downhill where it is [rad]; `axes` are those of the views."""
        up = math.cos(self.turn.value) * axes.up - math.sin(self.turn.value) * axes.right
        return math.atan2(-up[0], -up[1])


def calibrate(views: Sequence[PairView], front: WheelShape, rear: WheelShape) -> Calibration:
    """Calibrate from the views of one roll, whose camera stood still.

    Raises:
        ValueError: a hub's path is too short, or not that of a rolling wheel: what may be wrong is told.

    """
    first, second = (_calibrate(name, views, shape) for name, shape in ((FRONT, front), (REAR, rear)))
    apart = math.degrees(first.turn.value - second.turn.value)
    if abs(apart) > math.degrees(LARGEST_ANGLE):
        raise ValueError(
            f'the hubs do not travel along one slope: their directions are {abs(apart):.1f}° apart; does '
            'the camera stand still, and is it calibrated?'
        )
    weight1, weight2 = (max(wheel.turn.spread, 1e-9) ** -2 for wheel in (first, second))
    turn = Estimate(
        (weight1 * first.turn.value + weight2 * second.turn.value) / (weight1 + weight2), (weight1 + weight2) ** -0.5
    )
    return Calibration(
        turn,
        *(
            wheel._replace(
                zero=Estimate(
                    wheel.zero.value - wheel.turn.value + turn.value, math.hypot(wheel.zero.spread, turn.spread)
                )
            )
            for wheel in (first, second)
        ),
    )


def rolled_path(alpha: float, psi: Floats) -> Complexes:
    """Path of the hub of a wheel with ℓ = 1, from its foot at ψ = 0: downhill + 1j along the slope's normal."""
    spoke, theta = stance(alpha, psi)
    return np.asarray(step_length(1.0, alpha) * spoke + 1j * np.exp(-1j * theta))


class _Path(NamedTuple):
    """Where a hub was seen at which rotation."""

    psi: Floats
    """As it was seen, without jumps [rad]."""
    hub: Complexes
    """Downhill + 1j along the slope's normal [m]."""

    def rows(self, part: NDArray[np.bool_]) -> '_Path':
        return _Path(self.psi[part], self.hub[part])

    def fit(self, alpha: float, zero: float) -> tuple[Complexes, Complexes]:
        """Coefficients and residuals of hub = start + scale · path(ψ + zero) + off · exp(−iψ), by least squares."""
        terms = np.stack((np.ones_like(self.hub), rolled_path(alpha, self.psi + zero), np.exp(-1j * self.psi)), axis=1)
        coefficients = np.asarray(np.linalg.lstsq(terms, self.hub, rcond=None)[0], np.complex128)
        return coefficients, np.asarray(self.hub - terms @ coefficients, np.complex128)

    def misfit(self, alpha: float, zero: float) -> float:
        """Root mean square of the residuals [m]."""
        return math.sqrt(float((np.abs(self.fit(alpha, zero)[1]) ** 2).mean()))

    def best_zero(self, alpha: float) -> float:
        """The zero that fits best, within half a step."""
        tried = np.linspace(-alpha, alpha, SCAN, endpoint=False).tolist()
        return self.refined_zero(alpha, min(tried, key=lambda zero: self.misfit(alpha, zero)))

    def refined_zero(self, alpha: float, zero: float) -> float:
        """The zero that fits best, near one that nearly does."""
        near = 2.0 * alpha / SCAN
        return float(
            minimize_scalar(
                lambda near: self.misfit(alpha, near),
                bounds=(zero - near, zero + near),
                method='bounded',
                options={'xatol': 1e-7},
            ).x
        )

    def solve(self, alpha: float, near: float) -> Floats:
        """What is sought: turn, length, zero, tag_x, tag_y."""
        zero = self.refined_zero(alpha, near)
        _, scale, off = self.fit(alpha, zero)[0].tolist()
        turn = -float(np.angle(scale))
        off *= np.exp(1j * (zero + turn))
        return np.array((turn, abs(scale), zero + turn, off.real, off.imag))


def _calibrate(name: str, views: Sequence[PairView], shape: WheelShape) -> WheelCalibration:
    path, alpha = _longest_path(name, views), shape.alpha
    zero = path.best_zero(alpha)
    zero -= 2.0 * alpha * round((zero - float(np.angle(path.fit(alpha, zero)[0][1]))) / (2.0 * alpha))
    off = np.abs(path.fit(alpha, zero)[1])
    path = path.rows(off <= max(OUTLIER * float(np.median(off)), OUTLIER_AT_LEAST * shape.length))
    cells, _ = stance(alpha, path.psi + zero)
    steps = int(np.ptp(cells))
    if steps < LEAST_STEPS:
        raise ValueError(
            f'the {name} wheel takes {counted(steps, "step")} before the camera, but {LEAST_STEPS} are needed: film '
            'a longer way, from further off or with a wider lens'
        )
    found = path.solve(alpha, zero)
    _check(name, path, shape, steps, found)
    others = np.array([path.rows(cells != cell).solve(alpha, zero) for cell in np.unique(cells)])
    spreads = np.sqrt((len(others) - 1) * ((others - others.mean(axis=0)) ** 2).mean(axis=0))
    turn, length, zeroed, tag_x, tag_y = map(Estimate, found.tolist(), spreads.tolist())
    return WheelCalibration(len(path.psi), steps, turn, length, zeroed, tag_x, tag_y, path.misfit(alpha, zero))


def _longest_path(name: str, views: Sequence[PairView]) -> _Path:
    """The longest way that the wheel was seen to roll without a pause."""
    seen = [
        (view.stamp_ns * 1e-9, wheel.rotation, complex(*wheel.hub)) for view in views if (wheel := getattr(view, name))
    ]
    if not seen:
        raise ValueError(f'the {name} wheel was not seen')
    time, rotation, hub = (np.array(column) for column in zip(*seen, strict=True))
    cuts = np.flatnonzero(np.diff(time) > LONGEST_PAUSE) + 1
    paths = [
        _Path(np.unwrap(part), place) for part, place in zip(np.split(rotation, cuts), np.split(hub, cuts), strict=True)
    ]
    return max(paths, key=lambda path: float(np.ptp(path.psi)))


def _check(name: str, path: _Path, shape: WheelShape, steps: int, found: Floats) -> None:
    """Refuse what is not the path of a rolling wheel."""
    went, rolled = float(np.ptp(path.hub.real)), steps * shape.step_length
    if not 0.5 < went / rolled < 2.0:
        raise ValueError(
            f'the hub of the {name} wheel travels {went:.2f} m in {counted(steps, "step")}, not about {rolled:.2f} '
            f'm: the camera must stand still, not follow the pair; else see size and {name}.length'
        )
    misfit = path.misfit(shape.alpha, path.best_zero(shape.alpha))
    if misfit <= LARGEST_MISFIT * shape.length:
        return
    misfits = {spokes: path.misfit(math.pi / spokes, path.best_zero(math.pi / spokes)) for spokes in OTHER_SPOKES}
    best = min(misfits, key=misfits.__getitem__)
    why = (
        f'it fits a wheel of {best} spokes, not {shape.spokes:g} ({name}.spokes)'
        if misfits[best] <= LARGEST_MISFIT * shape.length
        else 'does the camera stand still, and is it calibrated?'
    )
    raise ValueError(
        f'the hub of the {name} wheel does not travel as that of a rolling wheel: it is '
        f'{1e3 * misfit:.0f} mm off; {why}'
    )

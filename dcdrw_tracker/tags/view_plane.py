"""How the wheels' plane lies before the camera: learned from the tags themselves.

Both wheels turn in parallel planes, which stand still before a tripod. So of all that a frame shows, only the planes'
common normal is shared, and it takes two numbers; all else of a tag is a similarity within its plane, which has a
closed form.
"""

import math
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.values import Floats

Complexes = NDArray[np.complex128]

WINDOW = 160
"""Tags from which the normal is learned."""
KEEP_EVERY = 8
"""Once the window is full, one tag in so many is kept, so that the window spans seconds."""
NOISE_PX = 0.05
"""Least error of a corner [px]; a better fit is luck."""
OUTLIER_PX = 0.5
"""Residuals beyond this count less and less [px]."""
STEEPEST = math.radians(60.0)
"""The plane is sought within this angle of face-on [rad]."""
PRIOR_PX = 0.1
"""Face-on is preferred by as much as this residual at 45° [px]; it decides where the tags do not."""
RIVAL = 9.0
"""A second answer is out of the race when its cost, in variances, is higher by this."""


class Observation(NamedTuple):
    """One tag in one frame."""

    wheel: str
    """Its wheel, which keeps its distance from the camera."""
    rays: Floats
    """Undistorted x/z and y/z of its corners, (4, 2)."""
    shape: Complexes
    """Its corners as seen face-on, from any origin, (4,) [m]."""


class PlaneAxes(NamedTuple):
    """The axes of a view, unit vectors in the camera's optical frame."""

    right: Floats
    """Horizontal within the plane."""
    up: Floats
    normal: Floats
    """Unit vector from the camera to the plane."""

    def flatten(self, rays: Floats) -> Complexes:
        """Where rays (..., 2) meet the plane at distance 1: right + 1j up, from the point nearest to the camera."""
        points = np.concatenate((rays, np.ones_like(rays[..., :1])), axis=-1)
        ahead = np.maximum(points @ self.normal, 1e-3)
        return np.asarray((points @ self.right + 1j * (points @ self.up)) / ahead)

    def unflatten(self, flat: Complexes) -> Floats:
        """Inverse of `flatten`."""
        points = self.normal + flat.real[..., None] * self.right + flat.imag[..., None] * self.up
        return np.asarray(points[..., :2] / np.maximum(points[..., 2:], 1e-3))


def axes(slant: Floats, roll: float = 0.0) -> PlaneAxes:
    """Axes of the plane whose normal is (a, b, 1), `slant` being (a, b).

    The plane holds the plumb line, and the camera leans to its right by `roll` [rad]; so up follows.
    """
    normal = np.array((*slant, 1.0))
    normal /= np.linalg.norm(normal)
    level = np.array((math.cos(roll), -math.sin(roll), 0.0))
    up = np.cross(level, normal)
    up /= np.linalg.norm(up)
    return PlaneAxes(np.cross(normal, up), up, normal)


def fit_similarity(shape: Complexes, flat: Complexes) -> tuple[Complexes, Complexes]:
    """Least-squares c and s of flat = c + s · shape, over the last axis."""
    middle, centre = shape.mean(axis=-1, keepdims=True), flat.mean(axis=-1, keepdims=True)
    arms = shape - middle
    s = ((flat - centre) * arms.conj()).sum(axis=-1, keepdims=True) / (np.abs(arms) ** 2).sum(axis=-1, keepdims=True)
    return (centre - s * middle)[..., 0], s[..., 0]


class ViewPlane:
    """Learns the normal of the wheels' planes from the tags of one frame after another."""

    def __init__(self, focal: float) -> None:
        """Start face-on; `focal` is the camera's focal length [px]."""
        self.slant = np.zeros(2)
        """The normal is (a, b, 1)."""
        self.uncertainty = math.inf
        """Standard deviation of the normal [rad]; half a turn about the line of sight is told apart, or counts."""
        self._focal = focal
        self._window: deque[Observation] = deque(maxlen=WINDOW)
        self._seen = 0
        self._solve_at = 2

    def feed(self, observations: Iterable[Observation]) -> None:
        """Take the tags of a frame; now and then, and often at first, this makes the normal anew."""
        for one in observations:
            if len(self._window) < WINDOW or self._seen % KEEP_EVERY == 0:
                self._window.append(one)
            self._seen += 1
        if self._seen >= self._solve_at:
            self._solve()
            self._solve_at = min(2 * self._seen, self._seen + WINDOW)

    def axes(self, roll: float = 0.0) -> PlaneAxes:
        """The axes of the view; see `axes`."""
        return axes(self.slant, roll)

    def _solve(self) -> None:
        rays = np.array([one.rays for one in self._window])
        shape = np.array([one.shape for one in self._window])
        names = sorted({one.wheel for one in self._window})
        wheel = np.array([[one.wheel == name for one in self._window] for name in names], float)
        focal = self._focal

        def residuals(slant: Floats) -> Floats:
            view = axes(slant)
            flat = view.flatten(rays)
            c, s = fit_similarity(shape, flat)
            off = (view.unflatten(c[:, None] + s[:, None] * shape) - rays) * focal
            # A wheel keeps its distance, so its tags keep their scale: weighed as the corners are from which it comes.
            scale = np.log(np.abs(s))
            mean = wheel.T @ ((wheel @ scale) / wheel.sum(axis=1))
            arm = np.sqrt((np.abs(flat - flat.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)) * focal
            return np.concatenate((off.ravel(), (scale - mean) * arm, PRIOR_PX * slant))

        steepest = math.tan(STEEPEST)

        from scipy.optimize import least_squares  # a second to import, and few need it

        def solve(start: Floats) -> tuple[float, Floats, Floats]:
            done = least_squares(
                residuals,
                start,
                loss='soft_l1',
                f_scale=OUTLIER_PX,
                bounds=(-steepest, steepest),
                x_scale=0.1,
                xtol=1e-6,
                ftol=1e-6,
                max_nfev=30,
            )
            return float(done.cost), done.x, done.jac

        # Seen from afar a plane and its mirror about the line of sight look alike: both are tried.
        across = rays.mean(axis=(0, 1))
        best = min((solve(start) for start in self._starts()), key=lambda answer: answer[0])
        mirror = solve(np.clip(2.0 * across - best[1], -0.9 * steepest, 0.9 * steepest))
        if mirror[0] < best[0]:
            best, mirror = mirror, best
        cost, self.slant, jacobian = best
        variance = max(2.0 * cost / (4 * len(rays)), NOISE_PX**2)  # of 8 numbers of a tag its similarity takes 4
        spread = variance * np.linalg.inv(jacobian.T @ jacobian + 1e-12 * np.eye(2))
        apart = float(np.linalg.norm(mirror[1] - self.slant))
        rivals = 2.0 * (mirror[0] - cost) < RIVAL * variance
        self.uncertainty = math.hypot(math.sqrt(float(np.trace(spread))), 0.5 * apart if rivals else 0.0)

    def _starts(self) -> list[Floats]:
        if math.isfinite(self.uncertainty):
            return [self.slant]
        return [np.array((a, b)) for a, b in ((0.0, 0.0), (0.5, 0.0), (-0.5, 0.0), (0.0, 0.4), (0.0, -0.4))]

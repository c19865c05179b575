"""What a frame says of each wheel: its rotation and where its hub is."""

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.camera import Camera
from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.tagging import Mount, corners, seen, unseen
from dcdrw_msgs_py.values import Floats
from dcdrw_tracker.tags.detector import Detection
from dcdrw_tracker.tags.view_plane import Observation, PlaneAxes, ViewPlane, fit_similarity

Complexes = NDArray[np.complex128]


class PairViewParams(NamedTuple):
    """How the camera stands, and what is not a view of a wheel."""

    roll_deg: Annotated[
        float, Quantity('how far the camera leans to its right, by its level', 'deg', low=-180.0, high=180.0, live=True)
    ] = 0.0
    max_error: Annotated[
        float, Quantity("reprojection error beyond which a tag is refused, of the tag's side", above=0.0, live=True)
    ] = 0.06


class WheelView(NamedTuple):
    """One wheel, as one frame shows it."""

    rotation: float
    """ψ modulo 2π, from the slope normal [rad]."""
    hub: tuple[float, float]
    """Along the slope downhill and along its normal [m], from the point of the wheel's plane that is nearest to the
    camera; so the hubs of both wheels are comparable, however far each is."""
    error_px: float
    """Root mean square of the reprojection error [px]."""
    tags: int
    """How many tags it was made from."""
    size_px: float
    """Their mean side [px]."""


class PairView(NamedTuple):
    """Both wheels, as one frame shows them; None for a wheel that is not seen."""

    stamp_ns: int
    front: WheelView | None
    rear: WheelView | None


class _Tag(NamedTuple):
    """A tag in a frame, beside what it is on the wheel."""

    mount: Mount
    shape: Complexes
    """Corners on the wheel at ψ = 0 as seen face-on, from the hub (4,) [m]."""
    rays: Floats
    """(4, 2)."""
    side: float
    """[px]"""


class PairViewer:
    """Turns the tags of each frame into views of both wheels, and learns meanwhile how the wheels' plane lies."""

    def __init__(
        self, mounts: Iterable[Mount], camera: Camera, slope: float, params: PairViewParams | None = None
    ) -> None:
        self.params = params or PairViewParams()
        self.slope = slope
        """γ [rad]."""
        self._camera = camera
        self._focal = math.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1])
        self.plane = ViewPlane(self._focal)
        self.refused = 0
        """Tags that fitted neither the plane nor their wheel."""
        self._tags: Mapping[int, tuple[Mount, Complexes]] = {
            mount.id: (mount, seen(corners(mount))) for mount in mounts
        }

    def view(self, stamp_ns: int, detections: Iterable[Detection]) -> PairView:
        """Both wheels in a frame; tags that are not mounted are ignored."""
        known = [one for one in detections if one.id in self._tags]
        rays = self._camera.rays(np.concatenate([one.corners for one in known])) if known else np.empty((0, 2))
        tags = [
            _Tag(*self._tags[one.id], own, one.side)
            for one, own in zip(known, rays.reshape(-1, 4, 2), strict=True)
            if np.isfinite(own).all()
        ]
        self.plane.feed(Observation(tag.mount.wheel, tag.rays, tag.shape) for tag in tags)
        axes = self.plane.axes(math.radians(self.params.roll_deg))
        front, rear = (self._wheel([tag for tag in tags if tag.mount.wheel == wheel], axes) for wheel in (FRONT, REAR))
        return PairView(stamp_ns, front, rear)

    def _wheel(self, tags: list[_Tag], axes: PlaneAxes) -> WheelView | None:
        """The view that most tags agree on, or None. Of two that disagree neither is believed."""
        if not tags:
            return None
        view = self._fit(tags, axes)
        while view.error_px > self.params.max_error * view.size_px:
            if len(tags) < 3:
                self.refused += len(tags)
                return None
            self.refused += 1
            without = {i: self._fit(tags[:i] + tags[i + 1 :], axes) for i in range(len(tags))}
            worst = min(without, key=lambda i: without[i].error_px)
            view, tags = without[worst], tags[:worst] + tags[worst + 1 :]
        return view

    def _fit(self, tags: list[_Tag], axes: PlaneAxes) -> WheelView:
        """One similarity of all corners: flat = c + s · shape. Its turn is ψ + γ, and 1/|s| the plane's distance."""
        shape = np.concatenate([tag.shape for tag in tags])
        rays = np.concatenate([tag.rays for tag in tags])
        c, s = fit_similarity(shape, axes.flatten(rays))
        off = (axes.unflatten(c + s * shape) - rays) * self._focal
        error_px = math.sqrt(float((off**2).sum(axis=1).mean()))
        size_px = sum(tag.side for tag in tags) / len(tags)
        rotation = (float(np.angle(s)) - self.slope) % math.tau
        along, normal = unseen(c / abs(s), slope=self.slope).tolist()
        return WheelView(rotation, (along, normal), error_px, len(tags), size_px)

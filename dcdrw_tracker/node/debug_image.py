"""A picture of what the tracker sees: each tag's outline and id, the hubs, the spokes, and the stance legs."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.camera import Camera
from dcdrw_msgs_py.frame import Picture
from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.rig import FRONT, WheelShape
from dcdrw_msgs_py.rolling import stance
from dcdrw_msgs_py.tagging import Mount, corners, seen
from dcdrw_tracker.node.tag_tracker import Tracked
from dcdrw_tracker.tags.detector import Detection
from dcdrw_tracker.tags.view_plane import PlaneAxes, fit_similarity
from dcdrw_tracker.tags.wheel_view import WheelView

Points = NDArray[np.int32]

FRONT_COLOUR, REAR_COLOUR, TOP_COLOUR, STANCE_COLOUR = (240, 160, 30), (30, 120, 255), (60, 60, 255), (90, 230, 90)
"""Blue, green, red."""
SHIFT = 4
"""Bits of a pixel's fraction that OpenCV draws with."""


def draw(
    image: Picture, tracked: Tracked, mounts: Mapping[int, Mount], camera: Camera, shapes: tuple[WheelShape, WheelShape]
) -> Picture:
    """A copy of a frame in colour, with what was made of it drawn over it.

    Args:
        image: the frame, grey or BGR.
        tracked: what it brought.
        mounts: the tags, by their ids.
        camera: that made it.
        shapes: of the front wheel and of the rear one.

    """
    cv2 = opencv()
    picture = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy()
    for view, shape, colour in zip(tracked.view[1:], shapes, (FRONT_COLOUR, REAR_COLOUR), strict=True):
        own = [one for one in tracked.detections if (mounts[one.id].wheel == FRONT) == (colour == FRONT_COLOUR)]
        if view is not None and own:
            _draw_wheel(cv2, picture, _Wheel(own, mounts, camera, tracked.axes), view, shape, colour)
        for one in own:
            _draw_tag(cv2, picture, one, colour)
    return np.asarray(picture, np.uint8)


class _Wheel:
    """Maps the plane of a wheel's feet to pixels, by its tags and how far they are before it."""

    def __init__(self, own: list[Detection], mounts: Mapping[int, Mount], camera: Camera, axes: PlaneAxes) -> None:
        shape = np.concatenate([seen(corners(mounts[one.id])) for one in own])
        flat = axes.flatten(camera.rays(np.concatenate([one.corners for one in own])))
        self._fit = fit_similarity(shape, flat)
        self._standoff = mounts[own[0].id].standoff
        self._camera, self._axes = camera, axes

    def pixels(self, points: Any) -> Points | None:
        """Pixels of points of the wheel's frame (N, 2) [m], in units of 1/2^SHIFT; None where it is not in view."""
        c, s = self._fit
        # The tags are 1/|s| from the camera [m], the feet further by the standoff; both are brought to distance 1.
        rays = self._axes.unflatten((c + s * seen(points)) / (1.0 + abs(s) * self._standoff))
        pixels = self._camera.project(np.column_stack((rays, np.ones(len(rays)))))
        if not (np.abs(pixels) < 1e5).all():
            return None
        return np.asarray(np.rint(pixels * 2**SHIFT), np.int32)


def _draw_wheel(
    cv2: Any, picture: Any, wheel: _Wheel, view: WheelView, shape: WheelShape, colour: tuple[int, int, int]
) -> None:
    pitch = 2.0 * shape.alpha
    standing = -pitch * stance(shape.alpha, view.rotation)[0]  # the spoke on which it stands
    angles = standing + pitch * np.arange(round(math.tau / pitch))
    feet = -shape.length * np.column_stack((np.sin(angles), np.cos(angles)))
    for index, foot in reversed(list(enumerate(feet))):
        line = wheel.pixels(((0.0, 0.0), foot))
        if line is not None:
            width, tint = (4, STANCE_COLOUR) if index == 0 else (1, colour)
            cv2.line(picture, line[0].tolist(), line[1].tolist(), tint, width, cv2.LINE_AA, SHIFT)
    if (hub := wheel.pixels(((0.0, 0.0),))) is not None:
        cv2.circle(picture, hub[0].tolist(), 7 << SHIFT, colour, 2, cv2.LINE_AA, SHIFT)
        theta = math.degrees(view.rotation + standing)
        x, y = (hub[0] >> SHIFT).tolist()
        _write(cv2, picture, f'{theta:+.1f} deg', (x + 14, y - 60), STANCE_COLOUR)


def _draw_tag(cv2: Any, picture: Any, one: Detection, colour: tuple[int, int, int]) -> None:
    outline = np.rint(one.corners * 2**SHIFT).astype(np.int32)
    cv2.polylines(picture, [outline], True, colour, 2, cv2.LINE_AA, SHIFT)
    cv2.line(picture, outline[0].tolist(), outline[1].tolist(), TOP_COLOUR, 3, cv2.LINE_AA, SHIFT)
    x, y = np.rint(one.corners.max(axis=0)).astype(int).tolist()
    _write(cv2, picture, str(one.id), (x + 4, y + 4), colour)


def _write(cv2: Any, picture: Any, text: str, place: tuple[int, int], colour: tuple[int, int, int]) -> None:
    for tint, width in (((0, 0, 0), 4), (colour, 1)):  # dark about bright: readable on any ground
        cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.7, tint, width, cv2.LINE_AA)

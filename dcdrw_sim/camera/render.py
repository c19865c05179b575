"""Draws the rig as a camera sees it. Tags are exact to a fraction of a pixel; all else is there to look at."""

import math
from collections.abc import Iterable
from functools import lru_cache
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.camera import Camera
from dcdrw_msgs_py.frame import Picture
from dcdrw_msgs_py.opencv import opencv, tag_cells
from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import FRONT, REAR, WheelShape
from dcdrw_msgs_py.samples import JointSample
from dcdrw_msgs_py.tagging import Mount, TagParams, corners
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.camera.scene import (
    CameraPose,
    Footing,
    SceneParams,
    ViewParams,
    WheelPlace,
    camera_pose,
    rotations_after,
    speed,
)

Colour = tuple[int, int, int]
"""Blue, green, red."""

BOTH = 'both'
HIDDEN = {'': (), FRONT: (0,), REAR: (1,), BOTH: (0, 1)}


class LookParams(NamedTuple):
    """What a real camera does to a picture, and what may stand before it."""

    exposure: Annotated[
        float, Quantity('exposure time, about the stamp: what moves is blurred', 's', low=0.0, high=0.1, live=True)
    ] = 0.004
    blur_px: Annotated[
        float, Quantity('blur of the lens, one standard deviation', 'px', low=0.0, high=20.0, live=True)
    ] = 0.0
    noise: Annotated[
        float, Quantity('noise of the sensor, one standard deviation; white is 255', low=0.0, high=50.0, live=True)
    ] = 2.0
    brightness: Annotated[float, Quantity('factor; white is clipped', low=0.05, high=4.0, live=True)] = 1.0
    occlude: Annotated[
        str, Quantity('whose tags somebody hides who stands before the camera: front, rear, both or nobody', live=True)
    ] = ''
    occlude_from: Annotated[float, Quantity('when, after the first frame', 's', low=0.0, live=True)] = 5.0
    occlude_for: Annotated[float, Quantity('for how long', 's', low=0.0, live=True)] = 0.5
    occlude_every: Annotated[float, Quantity('how often; 0: once', 's', low=0.0, live=True)] = 0.0
    image_seed: Annotated[int, Quantity('of the noise', low=0)] = 0

    def check_occluder(self) -> None:
        """Refuse an occluder that hides nobody.

        Raises:
            ValueError: no such wheel.

        """
        if self.occlude not in HIDDEN:
            raise ValueError(f'occlude must be {", ".join(filter(None, HIDDEN))} or empty, got {self.occlude!r}')

    def hidden(self, time: float) -> tuple[int, ...]:
        """Whose tags are hidden at a time after the first frame [s]: 0 the front wheel's, 1 the rear's."""
        since = time - self.occlude_from
        if self.occlude_every and since >= 0.0:
            since %= self.occlude_every
        return HIDDEN[self.occlude] if 0.0 <= since < self.occlude_for else ()


# Okabe and Ito's palette, as in the figures.
_WHEELS: tuple[Colour, Colour] = ((178, 114, 0), (0, 94, 213))
_HUB, _STEEL, _SPRING, _MARK, _MARK_5, _PERSON = (
    (62, 60, 58),
    (120, 116, 112),
    (84, 84, 90),
    (128, 162, 190),
    (44, 66, 96),
    (58, 50, 48),
)
_WALL, _BASE, _FLOOR, _PLANK, _PLANK_SIDE, _NOTHING = (
    (226, 229, 230),
    (190, 194, 196),
    (158, 165, 170),
    (142, 182, 214),
    (98, 136, 170),
    (0, 0, 0),
)
_INK, _PAPER = 25, 235

# In the wheels' length ℓ.
_PLANK_HALF, _PLANK_THICK, _FLOOR_BELOW, _WALL_BEHIND = 0.45, 0.10, 0.30, 1.6
_SPOKE_AT_HUB, _SPOKE_AT_FOOT, _HUB_RADIUS, _FOOT_RADIUS, _AXLE_RADIUS = 0.015, 0.010, 0.075, 0.026, 0.02
_MARK_HALF, _MARKS_REACH = 0.006, 12.0
_MOST_SPOKES = 360

WHITE_BORDER = 1
"""Cells of white around the black square; a tag needs one."""

_SHIFT = 8
"""Fractional bits of the corners that OpenCV's polygons take."""
_CELL = 32
"""Texels of a tag's cell."""
_PIXEL_SIGMA = 0.3
"""A pixel gathers light over its area: the standard deviation of a box of one pixel is 0.29 [px]."""
_MOTION_PX = 2.0
"""What moves further than this while the shutter is open is drawn several times, and averaged [px]."""
_MOST_EXPOSURES = 24
_NOISE_SHIFT = 64
"""The noise is drawn once, and laid over each frame at a random shift up to this [px]."""


class Renderer:
    """Draws frames of one camera.

    Args:
        scene: the rig.
        view: the tripod.
        look: exposure, blur, noise, occluder.
        tags: which tags are mounted where.
        camera: the lens and the sensor.
        colour: blue, green and red, else grey.

    Raises:
        ValueError: OpenCV is missing, or a tag or an occluder is impossible.

    """

    def __init__(
        self, scene: SceneParams, view: ViewParams, look: LookParams, tags: TagParams, camera: Camera, colour: bool
    ) -> None:
        look.check_occluder()
        self._cv2 = opencv()
        self._scene, self._look, self._camera, self._colour = scene, look, camera, colour
        self._unit = scene.hub_height
        view = view.resolved(scene)
        self._follow = view.follow
        self._pose = camera_pose(scene, view)
        if not view.follow:
            self._pose = self._pose.moved(view.place)
        self._scale = float(camera.matrix[0, 0]) / view.distance
        self._tags = [_Tag(mount, tags.family, scene.tag_plane(mount)) for mount in scene.mounts(tags)]
        self._ends = [
            max([tag.plane for tag in self._tags if tag.wheel == wheel], default=plane)
            for wheel, plane in enumerate(scene.wheel_planes)
        ]
        self._rays = _pixel_rays(*camera[:2], camera.matrix.tobytes(), camera.distortion.tobytes())
        self._sight = 1.05 * float(np.hypot(*np.nan_to_num(self._rays, nan=0.0).reshape(-1, 2).T).max())
        self._tag_rays = np.nan_to_num(self._rays, nan=1e6)  # no tag there
        pieces = 1 if camera.is_straight else 6  # of what is straight but in the picture
        wheels = [_wheel_outlines(shape, self._unit, pieces) for shape in scene.wheels]
        self._wheels = [np.concatenate([points for points, _ in outlines]) for outlines in wheels]
        front, rear = (
            [(len(points), _WHEELS[i] if own else _HUB, 0.0) for points, own in outlines]
            for i, outlines in enumerate(wheels)
        )
        self._layout = [
            *rear,
            *((len(points), colour, width) for points, colour, width in _coupler(1.0)),
            *front,
            *[(2, _STEEL, 2.0 * _AXLE_RADIUS)] * 2,
        ]
        self._background = self._cast()
        if not view.follow:
            self._draw_marks(self._background, self._pose)
        self._random = np.random.default_rng(look.image_seed)
        self._noise = self._make_noise() if look.noise else None

    def pose(self, places: tuple[WheelPlace, WheelPlace]) -> CameraPose:
        """Where the camera is when the wheels are at these places."""
        return self._pose.moved(0.5 * (places[0].along + places[1].along)) if self._follow else self._pose

    def draw(self, footing: Footing, joints: JointSample, time: float = 0.0) -> Picture:
        """The frame whose exposure has its middle at a sample.

        Args:
            footing: where the wheels stand.
            joints: the sample; by its speeds the wheels turn while the shutter is open.
            time: since the first frame [s], for the occluder.

        """
        pose = self.pose(footing.places(*rotations_after(joints, 0.0)))
        frame: Picture = self._background.copy()
        if self._follow:
            self._draw_marks(frame, pose)
        exposures = self._exposures(joints)
        if exposures == 1:
            self._draw_rig(frame, footing.places(*rotations_after(joints, 0.0)))
        else:
            sums, still = np.zeros(frame.shape, np.uint16), frame.copy()
            for part in (np.arange(exposures) + 0.5) / exposures - 0.5:
                np.copyto(frame, still)
                self._draw_rig(frame, footing.places(*rotations_after(joints, part * self._look.exposure)))
                np.add(sums, frame, out=sums)
            self._cv2.convertScaleAbs(sums, frame, 1.0 / exposures)
        hidden = self._look.hidden(time)
        if hidden:
            self._draw_person(frame, footing.places(*rotations_after(joints, 0.0)), hidden)
        return self._develop(frame)

    def tag_pixels(self, footing: Footing, joints: JointSample) -> dict[int, Floats]:
        """Where the corners of each tag's black square are in the picture, as `corners` orders them, (4, 2) [px]."""
        places = footing.places(*rotations_after(joints, 0.0))
        pose = self.pose(places)
        return {
            tag.mount.id: self._camera.project(pose.optical(places[tag.wheel].points(corners(tag.mount), tag.plane)))
            for tag in self._tags
        }

    def _exposures(self, joints: JointSample) -> int:
        """How often to draw what moves: a wheel's top moves at twice the hub's speed."""
        fastest = max(
            abs(speed(turn)) * shape.length
            for turn, shape in zip((joints.front, joints.rear), self._scene.wheels, strict=True)
        )
        moved = 2.0 * fastest * self._look.exposure * self._scale
        return min(max(math.ceil(moved / _MOTION_PX), 1), _MOST_EXPOSURES)

    def _draw_rig(self, frame: Picture, places: tuple[WheelPlace, WheelPlace]) -> None:
        """Draw from far to near: the rear wheel, the coupler, the front wheel, the axles' ends, the tags."""
        pose, (front_plane, rear_plane) = self.pose(places), self._scene.wheel_planes
        front, rear = places
        axles = [
            (place.along, left, place.above)
            for place, near, end in ((rear, rear_plane, self._ends[1]), (front, front_plane, self._ends[0]))
            for left in (near, end)
        ]
        points = np.concatenate(
            (
                rear.points(self._wheels[1], rear_plane),
                self._coupler_points(rear, front),
                front.points(self._wheels[0], front_plane),
                axles,
            )
        )
        self._paint(frame, pose.optical(points), self._layout)
        self._draw_tags(frame, pose, places)

    def _coupler_points(self, rear: WheelPlace, front: WheelPlace) -> Floats:
        start = complex(rear.along, rear.above)
        line = complex(front.along, front.above) - start
        length = max(abs(line), 1e-9 * self._unit)
        points = np.concatenate([points for points, _, _ in _coupler(length / self._unit)])
        placed = start + (points[:, 0] + 1j * points[:, 1]) * (line / length * self._unit)
        return np.stack((placed.real, np.zeros(len(placed)), placed.imag), axis=-1)

    def _paint(self, frame: Picture, optical: Floats, layout: Iterable[tuple[int, Colour, float]]) -> None:
        """Draw shapes whose points follow each other: how many, the colour, and a line's width [ℓ], or 0 to fill."""
        cv2, pixels, first = self._cv2, np.rint(self._pixels(optical) * (1 << _SHIFT)).astype(np.int32), 0
        for count, colour, width in layout:
            shape, first = pixels[first : first + count], first + count
            if width:
                thickness = max(1, round(width * self._unit * self._scale))
                cv2.polylines(frame, [shape], False, self._ink(colour), thickness, cv2.LINE_AA, _SHIFT)
            else:
                cv2.fillPoly(frame, [shape], self._ink(colour), cv2.LINE_AA, _SHIFT)

    def _draw_marks(self, frame: Picture, pose: CameraPose) -> None:
        """Draw a mark across the slope every step length of the front wheel, and a stronger one every five."""
        step, unit = self._scene.front.step_length, self._unit
        middle, reach = pose.position[0], _MARKS_REACH * unit
        w, h = _PLANK_HALF * unit, _PLANK_THICK * unit
        numbers = np.arange(math.ceil((middle - reach) / step), math.floor((middle + reach) / step) + 1)
        d = _MARK_HALF * unit
        top, side = ([(-d, a, b), (d, a, b), (d, w, c), (-d, w, c)] for a, b, c in ((-w, 0, 0), (w, 0, -h)))
        points = np.tile([*top, *side], (len(numbers), 1, 1))
        points[..., 0] += step * numbers[:, None]
        marks = pose.optical(points)
        depth = marks[..., 2]
        visible = ((depth > 0.1 * unit) & (np.abs(marks[..., :2]).max(axis=-1) < 1.5 * self._sight * depth)).all(axis=1)
        self._paint(
            frame,
            marks[visible].reshape(-1, 3),
            ((4, _MARK if number % 5 else _MARK_5, 0.0) for number in numbers[visible] for _ in range(2)),
        )

    def _draw_tags(self, frame: Picture, pose: CameraPose, places: tuple[WheelPlace, WheelPlace]) -> None:
        optical = pose.optical([places[tag.wheel].points(tag.points, tag.plane) for tag in self._tags])
        outlines, axes = optical[:, :4], optical[:, 4:]
        depth = outlines[..., 2]
        visible = ((depth > 0.05 * self._unit) & (np.hypot(*outlines.T[:2]).T < self._sight * depth)).all(axis=1)
        pixels = self._camera.project(outlines.reshape(-1, 3)).reshape(-1, 4, 2)
        for i in np.flatnonzero(visible):
            self._draw_tag(frame, pixels[i], axes[i], self._tags[i])

    def _draw_tag(self, frame: Picture, outline: Floats, axes: Floats, tag: '_Tag') -> None:
        """Look up each pixel's ray on the tag, in a texture that is as blurred as a pixel is large."""
        cv2 = self._cv2
        left, top = np.clip((np.floor(outline.min(axis=0)) - 2).astype(int), 0, None)
        right, bottom = np.clip(np.ceil(outline.max(axis=0)).astype(int) + 3, 0, None)
        part = frame[top:bottom, left:right]
        if not part.size:
            return
        origin, right_end, lower_end = axes
        from_metres = np.column_stack((right_end - origin, lower_end - origin, origin))
        to_texels = tag.metres_to_texels @ np.linalg.inv(from_metres)
        texels = cv2.perspectiveTransform(np.ascontiguousarray(self._tag_rays[top:bottom, left:right]), to_texels)
        texels_per_pixel = _CELL * tag.cells / (tag.mount.size * self._camera.matrix[0, 0] / origin[2])
        patch = cv2.remap(tag.texture(_PIXEL_SIGMA * texels_per_pixel), texels, None, cv2.INTER_LINEAR)
        grey, through = patch[..., 0], 255 - patch[..., 1]
        if self._colour:
            grey, through = cv2.merge([grey] * 3), cv2.merge([through] * 3)
        part[:] = cv2.add(cv2.multiply(part, through, scale=1.0 / 255.0), grey)

    def _draw_person(self, frame: Picture, places: tuple[WheelPlace, WheelPlace], hidden: tuple[int, ...]) -> None:
        """Draw somebody right before the camera: head and body hide the tags of a wheel."""
        cv2, pose = self._cv2, self.pose(places)
        for wheel in hidden:
            seen = [
                self._pixels(pose.optical(places[wheel].points(tag.points[:4], tag.plane)))
                for tag in self._tags
                if tag.wheel == wheel
            ]
            if not seen:
                continue
            low, high = np.min(seen, axis=(0, 1)), np.max(seen, axis=(0, 1))
            (x, y), w = 0.5 * (low + high), 0.75 * float((high - low).max())
            shoulder, ink = y - 1.1 * w, self._ink(_PERSON)
            body = np.array(
                [
                    (x - w, shoulder + 0.5 * w),
                    (x - 0.7 * w, shoulder),
                    (x + 0.7 * w, shoulder),
                    (x + w, shoulder + 0.5 * w),
                    (x + 0.85 * w, self._camera.height),
                    (x - 0.85 * w, self._camera.height),
                ]
            )
            cv2.fillPoly(frame, [np.rint(body).astype(np.int32)], ink, cv2.LINE_AA)
            cv2.ellipse(
                frame,
                (round(x), round(shoulder - 0.55 * w)),
                (round(0.42 * w), round(0.55 * w)),
                0.0,
                0.0,
                360.0,
                ink,
                cv2.FILLED,
                cv2.LINE_AA,
            )

    def _develop(self, frame: Picture) -> Picture:
        """Lens and sensor."""
        cv2, look = self._cv2, self._look
        if look.blur_px:
            cv2.GaussianBlur(frame, (0, 0), look.blur_px, frame)
        if look.brightness != 1.0:
            cv2.convertScaleAbs(frame, frame, look.brightness)
        if self._noise is not None:
            down, across = self._random.integers(_NOISE_SHIFT, size=2)
            for change, noise in zip((cv2.add, cv2.subtract), self._noise, strict=True):
                change(frame, noise[down : down + frame.shape[0], across : across + frame.shape[1]], frame)
        return frame

    def _make_noise(self) -> tuple[Picture, Picture]:
        height, width, *channels = self._background.shape
        noise = self._look.noise * self._random.standard_normal(
            (height + _NOISE_SHIFT, width + _NOISE_SHIFT, *channels), dtype=np.float32
        )
        noise = np.clip(np.rint(noise), -255.0, 255.0)
        return np.maximum(noise, 0.0).astype(np.uint8), np.maximum(-noise, 0.0).astype(np.uint8)

    def _cast(self) -> Picture:
        """The background: wall, floor and slope, by each pixel's ray; by sixteen where two surfaces meet."""
        picture = self._surfaces(self._rays)
        down, across = (np.asarray(np.gradient(self._rays, axis=axis)) for axis in (0, 1))
        seam = np.zeros(picture.shape[:2], bool)
        for axis in (0, 1):
            changes = np.abs(np.diff(picture, axis=axis)).max(axis=-1) > 6.0
            seam |= np.insert(changes, 0, False, axis=axis) | np.insert(changes, changes.shape[axis], False, axis=axis)
        parts = np.array((-0.375, -0.125, 0.125, 0.375), np.float32)
        picture[seam] = np.mean(
            [self._surfaces(self._rays[seam] + i * down[seam] + j * across[seam]) for i in parts for j in parts], axis=0
        )
        colours = np.rint(picture).astype(np.uint8)
        return colours if self._colour else np.asarray(self._cv2.cvtColor(colours, self._cv2.COLOR_BGR2GRAY), np.uint8)

    def _surfaces(self, rays: NDArray[np.float32]) -> NDArray[np.float32]:
        """The colours (..., 3) that are seen along rays (..., 2)."""
        (_, y0, z0), slope = (float(value) / self._unit for value in self._pose.position), self._scene.slope
        axes = self._pose.rotation.astype(np.float32)
        x, y, z = (rays[..., 0] * axes[0, i] + rays[..., 1] * axes[1, i] + axes[2, i] for i in range(3))
        up = math.cos(slope) * z - math.sin(slope) * x
        with np.errstate(divide='ignore', invalid='ignore'):
            wall, floor = (-_WALL_BEHIND - y0) / y, -(math.cos(slope) * z0 + _FLOOR_BELOW) / up
            top, side = -z0 / z, (_PLANK_HALF - y0) / y
            side_z, rise = z0 + side * z, z0 + wall * up  # about the height up the wall
        light = np.clip(0.88 + 0.05 * np.nan_to_num(rise), 0.8, 1.0)[..., None]
        colours: NDArray[np.float32] = light * np.array(_WALL, np.float32)
        colours[rise < -_FLOOR_BELOW + 0.12] = _BASE
        nearest = np.where(wall > 0.0, wall, np.inf)
        for colour, far, there in (
            (_FLOOR, floor, floor > 0.0),
            (_PLANK, top, (top > 0.0) & (np.abs(y0 + top * y) <= _PLANK_HALF)),
            (_PLANK_SIDE, side, (side > 0.0) & (side_z <= 0.0) & (side_z >= -_PLANK_THICK)),
        ):
            there = there & (far < nearest)
            colours[there] = colour
            nearest = np.where(there, far, nearest)
        colours[~np.isfinite(nearest)] = _NOTHING
        return colours

    def _pixels(self, optical: Floats) -> Floats:
        """Pixels of points in the optical frame; what is out of sight goes to its edge, where the lens still holds."""
        rays = optical[:, :2] / np.maximum(optical[:, 2:], 0.05 * self._unit)
        beyond = np.maximum(np.hypot(*rays.T) / self._sight, 1.0)
        return self._camera.project(np.column_stack((rays / beyond[:, None], np.ones(len(rays)))))

    def _ink(self, colour: Colour) -> Any:
        blue, green, red = colour
        return colour if self._colour else round(0.114 * blue + 0.587 * green + 0.299 * red)


class _Tag:
    """One tag as a texture: its grey values times what they cover, and how much they cover."""

    def __init__(self, mount: Mount, family: str, plane: float) -> None:
        self.mount, self.wheel = mount, 0 if mount.wheel == FRONT else 1
        self.plane = plane
        """To the left of the middle between the wheels [m]."""
        black = tag_cells(family, mount.id)
        self.cells = len(black)
        board = np.where(np.pad(black, WHITE_BORDER, constant_values=True), _PAPER, _INK)
        around = np.pad(np.stack((board, np.full_like(board, 255)), axis=-1), ((1, 1), (1, 1), (0, 0)))
        self._sharp = np.kron(around, np.ones((_CELL, _CELL, 1), int)).astype(np.uint8)
        self._textures: dict[int, Picture] = {}
        square = corners(mount)
        board = square.mean(axis=0) + (square - square.mean(axis=0)) * (1 + 2 * WHITE_BORDER / self.cells)
        self.points = np.stack(
            (
                *board,
                square[0],
                square[0] + (square[1] - square[0]) / mount.size,
                square[0] + (square[3] - square[0]) / mount.size,
            )
        )
        """In the wheel's frame: the corners of the white square, then the upper left one of the black square, and a
        metre from there to the right and down."""
        texels = self.cells * _CELL / mount.size
        edge = (1 + WHITE_BORDER) * _CELL - 0.5  # a texel's centre has whole coordinates
        self.metres_to_texels = np.array(((texels, 0.0, edge), (0.0, texels, edge), (0.0, 0.0, 1.0)))

    def texture(self, sigma: float) -> Picture:
        """The texture blurred by a standard deviation [texels], to within 10 %; from two cells on, nothing is left."""
        level = round(math.log(min(max(sigma, 0.1), 2.0 * _CELL)) / 0.1)
        if level not in self._textures:
            self._textures[level] = np.asarray(
                opencv().GaussianBlur(self._sharp, (0, 0), math.exp(0.1 * level)), np.uint8
            )
        return self._textures[level]


@lru_cache(maxsize=4)
def _pixel_rays(width: int, height: int, matrix: bytes, distortion: bytes) -> NDArray[np.float32]:
    """The ray of each pixel, (height, width, 2); NaN where the lens shows nothing."""
    camera = Camera(width, height, np.frombuffer(matrix).reshape(3, 3), np.frombuffer(distortion))
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)
    return camera.rays(pixels).reshape(height, width, 2).astype(np.float32)


def _wheel_outlines(shape: WheelShape, unit: float, pieces: int) -> list[tuple[Floats, bool]]:
    """The outlines of a wheel's parts in its own frame (N, 2) [m], and whether each has the wheel's own colour.

    A number of spokes that is not whole is rounded down.
    """
    outlines: list[tuple[Floats, bool]] = []
    foot = _FOOT_RADIUS * unit
    radii = np.linspace(0.0, shape.length - foot, pieces + 1)
    halves = unit * np.linspace(_SPOKE_AT_HUB, _SPOKE_AT_FOOT, pieces + 1)
    spoke = np.concatenate((radii + 1j * halves, (radii - 1j * halves)[::-1]))
    circle = np.exp(1j * np.linspace(0.0, math.tau, 24, endpoint=False))
    for number in range(min(int(shape.spokes), _MOST_SPOKES)):
        # Spoke 0 stands on the ground at ψ = 0; the next one does at ψ = 2α, so it is as much further ahead.
        ahead = np.exp(1j * (-0.5 * math.pi + 2.0 * shape.alpha * number))
        outlines += [(_plane(spoke * ahead), True), (_plane((shape.length - foot + foot * circle) * ahead), False)]
    return [*outlines, (_plane(_HUB_RADIUS * unit * circle), False)]


def _coupler(length: float) -> list[tuple[Floats, Colour, float]]:
    """Spring above, damper below the line from hub to hub: points along and above it, colour, width or 0 [ℓ]."""
    size = min(1.0, length / 0.9)  # where there is little room
    inset, offset = 0.13 * size, 0.06
    start, end, coil = inset, length - inset, 0.1 * size
    turns = np.linspace(start + coil, end - coil, 22)
    zigzag = offset + 0.032 * np.concatenate(((0.0,), np.resize((1.0, -1.0), 20), (0.0,)))
    spring = [(start, offset), *zip(turns, zigzag, strict=True), (end, offset)]
    a, b, low, high = start + 0.12 * size, start + 0.45 * size, -offset - 0.026, -offset + 0.026
    parts: list[tuple[list[tuple[Any, Any]], Colour, float]] = [
        ([(0.0, 0.0), (start, 0.0)], _STEEL, 0.016),
        ([(start, -offset), (start, offset)], _STEEL, 0.016),
        ([(start, -offset), (end, -offset)], _STEEL, 0.016),
        ([(end, -offset), (end, offset)], _STEEL, 0.016),
        ([(end, 0.0), (length, 0.0)], _STEEL, 0.016),
        ([(a, low), (b, low), (b, high), (a, high)], _HUB, 0.0),
        (spring, _SPRING, 0.010),
    ]
    return [(np.array(points), colour, width) for points, colour, width in parts]


def _plane(points: NDArray[np.complex128]) -> Floats:
    return np.stack((points.real, points.imag), axis=-1)

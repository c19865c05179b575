"""The rig before a camera: where the wheels, their tags and the camera are. No pictures, no ROS.

All places are in the slope's frame [m]: first along the slope downhill from the rear wheel's first foothold, then to
the left, then outward along the slope's normal. The camera stands on the rig's left and looks to the right, so
downhill is the picture's left, and a wheel that rolls downhill turns counter-clockwise in the picture.
"""

import math
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dcdrw_msgs_py.camera import Camera, pinhole, read_camera
from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import FRONT, RigParams, Slope, StanceDistance, WheelShape
from dcdrw_msgs_py.rolling import regular_stance_distance, stance, stance_distance_by_hubs
from dcdrw_msgs_py.samples import JointSample, Turn
from dcdrw_msgs_py.tagging import SPACING, Mount, TagParams, mounts
from dcdrw_msgs_py.values import Floats

LONGEST = 100.0
"""A coupler longer than this is not a measurement [ℓ]."""
FASTEST = 1e3
"""A speed above this is not a measurement [rad/s]."""


class SceneParams(NamedTuple):
    """What a camera sees of the rig."""

    front: WheelShape = WheelShape()
    rear: WheelShape = WheelShape()
    S0: StanceDistance = math.nan
    slope: Slope = RigParams().slope
    spacing: Annotated[
        float,
        Quantity(
            'from the plane of the rear wheel to that of the front wheel, which is nearer '
            'to the camera: the wheels overlap as seen from the side',
            'm',
            low=0.0,
            high=100.0,
            live=True,
            derived=f'{SPACING:g} ℓ',
        ),
    ] = math.nan

    @property
    def wheels(self) -> tuple[WheelShape, WheelShape]:
        """Front and rear."""
        return self.front, self.rear

    @property
    def hub_height(self) -> float:
        """How high the hubs are about: the mean ℓ, the measure of all that is drawn [m]."""
        return 0.5 * (self.front.length + self.rear.length)

    @property
    def wheel_planes(self) -> tuple[float, float]:
        """Where the planes of the front and of the rear wheel are, to the left of the middle between them [m]."""
        half = 0.5 * (SPACING * self.hub_height if math.isnan(self.spacing) else self.spacing)
        return half, -half

    def mounts(self, tags: TagParams) -> tuple[Mount, ...]:
        """The tags, each with how far it is before its wheel.

        Raises:
            ValueError: as `dcdrw_msgs_py.tagging.mounts`.

        """
        return mounts(tags.resolved(self.hub_height, self.spacing))

    def tag_plane(self, mount: Mount) -> float:
        """Where a tag's plane is, to the left of the middle between the wheels [m]."""
        return self.wheel_planes[mount.wheel != FRONT] + mount.standoff


class ViewParams(NamedTuple):
    """The camera and its tripod."""

    camera: Annotated[
        str,
        Quantity(
            'camera_info file (as config/camera.yaml); where none is named, the next five parameters make the camera'
        ),
    ] = ''
    image_width: Annotated[int, Quantity('width of the picture', 'px', low=16, high=8192)] = 1280
    image_height: Annotated[int, Quantity('height of the picture', 'px', low=16, high=8192)] = 720
    field_of_view_deg: Annotated[float, Quantity('angle of view across the width', '°', low=5.0, high=120.0)] = 60.0
    k1: Annotated[float, Quantity('radial distortion of the lens, of the second order', low=-1.0, high=1.0)] = 0.0
    k2: Annotated[float, Quantity('radial distortion of the lens, of the fourth order', low=-1.0, high=1.0)] = 0.0
    distance: Annotated[
        float,
        Quantity(
            "level distance from the middle between the wheels' planes",
            'm',
            above=0.0,
            high=1000.0,
            live=True,
            derived='3.8 ℓ, so that the pair fills the picture',
        ),
    ] = math.nan
    height: Annotated[
        float,
        Quantity(
            'of the camera above the slope where it aims',
            'm',
            low=0.0,
            high=20.0,
            live=True,
            derived='as high as the hubs',
        ),
    ] = math.nan
    pan_deg: Annotated[
        float,
        Quantity(
            'oblique view: how far the tripod stands to the downhill side, seen from where it aims; 0 is face-on',
            '°',
            low=-75.0,
            high=75.0,
            live=True,
        ),
    ] = 0.0
    tilt_deg: Annotated[
        float, Quantity('how far the camera looks down', '°', low=-80.0, high=80.0, live=True, derived='at the hubs')
    ] = math.nan
    roll_deg: Annotated[
        float, Quantity('how far the camera leans to its right', '°', low=-180.0, high=180.0, live=True)
    ] = 0.0
    follow: Annotated[
        bool,
        Quantity(
            'move along the slope with the pair, as on a dolly, or beside a treadmill; else '
            'the tripod stands, and the pair passes by',
            live=True,
        ),
    ] = True
    place: Annotated[
        float,
        Quantity(
            "where a standing camera aims, down the slope from the rear wheel's first foothold",
            'm',
            low=-1e3,
            high=1e3,
            live=True,
            derived='2 ℓ',
        ),
    ] = math.nan

    def resolved(self, scene: SceneParams) -> 'ViewParams':
        """The same view with the derived defaults filled in."""
        height = scene.hub_height if math.isnan(self.height) else self.height
        distance = 3.8 * scene.hub_height if math.isnan(self.distance) else self.distance
        return self._replace(
            height=height,
            distance=distance,
            tilt_deg=(
                math.degrees(math.atan2(height - scene.hub_height, distance))
                if math.isnan(self.tilt_deg)
                else self.tilt_deg
            ),
            place=2.0 * scene.hub_height if math.isnan(self.place) else self.place,
        )

    def make_camera(self) -> Camera:
        """The camera.

        Raises:
            ValueError, OSError: as `read_camera`.

        """
        if self.camera:
            return read_camera(Path(self.camera))
        plain = pinhole(self.image_width, self.image_height, self.field_of_view_deg)
        return plain._replace(distortion=np.array((self.k1, self.k2, 0.0, 0.0, 0.0)))


class WheelPlace(NamedTuple):
    """Where one wheel is, in its own plane."""

    along: float
    """Place of the hub along the slope [m]."""
    above: float
    """Height of the hub above the slope [m]."""
    psi: float
    """[rad]"""

    def points(self, points: ArrayLike, left: float) -> Floats:
        """Points (..., 2) of the wheel's frame in the slope's frame (..., 3), in the plane `left`."""
        points = np.asarray(points, float)
        cos, sin, x, y = math.cos(self.psi), math.sin(self.psi), points[..., 0], points[..., 1]
        return np.stack((self.along + cos * x + sin * y, np.full_like(x, left), self.above - sin * x + cos * y), -1)


class Footing:
    """Where the wheels stand, by their rotations alone, counted from a first sample on.

    That sample puts the rear wheel's foot to 0. The front wheel's is so far ahead that the coupler has the length that
    the sample tells; where it tells none, S = S0 + n σ1, the phase being p = n + (θ1/α1 − θ2/α2)/2 (contract §1).
    """

    def __init__(self, scene: SceneParams, first: JointSample) -> None:
        front, rear = scene.wheels
        self._steps1, theta1 = stance(front.alpha, first.front.angle)
        self._steps2, theta2 = stance(rear.alpha, first.rear.angle)
        D = first.coupler.length if first.coupler.length < LONGEST * (front.length + rear.length) else math.nan
        regular = regular_stance_distance(front, rear, scene.S0, theta1, theta2)
        self._ahead = stance_distance_by_hubs(front, rear, theta1, theta2, D, regular)
        self._front, self._rear = front, rear

    def places(self, psi1: float, psi2: float) -> tuple[WheelPlace, WheelPlace]:
        """Where the front and the rear wheel are at rotations ψ [rad]."""
        return (_placed(self._front, psi1, self._steps1, self._ahead), _placed(self._rear, psi2, self._steps2, 0.0))


def _placed(shape: WheelShape, psi: float, first: float, start: float) -> WheelPlace:
    steps, theta = stance(shape.alpha, psi)
    foot = start + (steps - first) * shape.step_length
    return WheelPlace(foot + shape.length * math.sin(theta), shape.length * math.cos(theta), psi)


class CameraPose(NamedTuple):
    """Where the camera stands, and how it looks."""

    rotation: Floats
    """Rotation from the slope's frame to the optical frame (x right, y down, z forward), (3, 3)."""
    position: Floats
    """(3,) [m]"""

    def optical(self, points: ArrayLike) -> Floats:
        """Points (..., 3) of the slope's frame in the optical frame."""
        return np.asarray((np.asarray(points, float) - self.position) @ self.rotation.T)

    def moved(self, along: float) -> 'CameraPose':
        """The same camera further down the slope."""
        return self._replace(position=self.position + np.array((along, 0.0, 0.0)))


def camera_pose(scene: SceneParams, view: ViewParams) -> CameraPose:
    """The camera where it aims at 0 along the slope.

    Args:
        scene: the rig.
        view: the camera, its derived defaults filled in.

    """
    tilt = math.radians(view.tilt_deg)
    pan, roll = math.radians(view.pan_deg), math.radians(view.roll_deg)
    # In the level frame: x downhill, y left, z up.
    outward, up = np.array((math.sin(pan), math.cos(pan), 0.0)), np.array((0.0, 0.0, 1.0))
    forward = -math.cos(tilt) * outward - math.sin(tilt) * up
    right = np.array((-math.cos(pan), math.sin(pan), 0.0))
    down = np.cross(forward, right)
    axes = np.stack(
        (math.cos(roll) * right + math.sin(roll) * down, math.cos(roll) * down - math.sin(roll) * right, forward)
    )
    cos, sin = math.cos(scene.slope), math.sin(scene.slope)
    slope_axes = np.array(((cos, 0.0, -sin), (0.0, 1.0, 0.0), (sin, 0.0, cos)))
    return CameraPose(axes @ slope_axes.T, slope_axes @ (view.distance * outward + view.height * up))


def rotations_after(joints: JointSample, seconds: float) -> tuple[float, float]:
    """Both rotations a short time later or earlier, by the speeds of the sample [rad]."""
    return joints.front.angle + seconds * speed(joints.front), joints.rear.angle + seconds * speed(joints.rear)


def speed(turn: Turn) -> float:
    """The speed of a wheel [rad/s]; 0 where it is not told, or is one that no wheel has."""
    return turn.rate if abs(turn.rate) <= FASTEST else 0.0

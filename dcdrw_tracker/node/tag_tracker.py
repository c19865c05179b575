"""The tag tracker: a frame in; both wheels' rotations and speeds out, with what was seen on the way."""

import math
from typing import NamedTuple, cast, get_args

import numpy as np

from dcdrw_msgs_py.camera import Camera
from dcdrw_msgs_py.frame import Frame, Picture
from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import JointSample
from dcdrw_msgs_py.tagging import TagParams, mounts
from dcdrw_tracker.tags.detector import Backend, Detection, TagDetector
from dcdrw_tracker.tags.tag_follower import TagFollower
from dcdrw_tracker.tags.view_plane import PlaneAxes
from dcdrw_tracker.tags.wheel_view import PairView, PairViewer, PairViewParams, WheelView
from dcdrw_tracker.wheels.wheel_angles import AnglesStatus, WheelAngles
from dcdrw_tracker.wheels.wheel_track import TrackParams

MEMORY = 30
"""Views over which a wheel's quality is averaged."""


class Tracked(NamedTuple):
    """What one frame brought."""

    detections: tuple[Detection, ...]
    """The rig's tags in it."""
    axes: PlaneAxes
    """How the wheels' plane lies before the camera, as far as that is known by now."""
    view: PairView
    sample: JointSample | None
    """None unless both wheels were measured."""


class WheelQuality(NamedTuple):
    """How well one wheel is seen."""

    seen_ns: int = 0
    """Stamp of the frame that showed it last; 0 where none did."""
    frames: int = 0
    """Frames that showed it."""
    tags: int = 0
    """Tags in the last of these."""
    error_px: float = 0.0
    """Reprojection error of late [px]."""
    size_px: float = 0.0
    """Side of its tags of late [px]."""

    def after(self, stamp_ns: int, view: WheelView | None) -> 'WheelQuality':
        """The quality after another frame."""
        if view is None:
            return self
        share = 1.0 / min(self.frames + 1, MEMORY)
        return WheelQuality(
            stamp_ns,
            self.frames + 1,
            view.tags,
            self.error_px + share * (view.error_px - self.error_px),
            self.size_px + share * (view.size_px - self.size_px),
        )


class TrackerStatus(NamedTuple):
    """A snapshot, for diagnostics."""

    stamp_ns: int
    """Stamp of the last frame; 0 before the first."""
    front: WheelQuality
    rear: WheelQuality
    ids: tuple[tuple[int, ...], tuple[int, ...]]
    """Ids of the tags on the front wheel and on the rear one."""
    duplicate: int
    """The tag that was last seen twice in one frame."""
    duplicate_ns: int
    """Stamp of that frame; 0 where there was none."""
    duplicates: int
    """Frames with such tags."""
    refused_tags: int
    """Tags that fitted neither the wheels' plane nor their wheel."""
    angles: AnglesStatus


class TagTracker:
    """Composes detector, view and time tracking.

    Raises:
        ValueError: impossible tags, an unknown detector, or one that is not installed.

    """

    def __init__(
        self, tags: TagParams, view: PairViewParams, track: TrackParams, detector: str = 'aruco', first_run: int = 1
    ) -> None:
        if detector not in get_args(Backend):
            raise ValueError(f'detector must be {" or ".join(get_args(Backend))}, got {detector!r}')
        length = 0.5 * (track.front.length + track.rear.length)
        self.mounts = {mount.id: mount for mount in mounts(tags.resolved(length))}
        self._follower = TagFollower(TagDetector(tags.family, self.mounts, cast(Backend, detector)), self.mounts)
        self._view, self._slope = view, track.slope
        self._angles = WheelAngles(track, first_run)
        self._camera: Camera | None = None
        self._viewer: PairViewer | None = None
        self._qualities = {FRONT: WheelQuality(), REAR: WheelQuality()}
        self._stamp_ns = self._duplicates = self._refused_before = 0
        self._duplicate = self._duplicate_ns = 0

    def configure(self, view: PairViewParams, track: TrackParams) -> None:
        """Take changed parameters at once; those that are not `live` hold from the start on."""
        self._view, self._slope = view, track.slope
        self._angles.configure(track)
        if self._viewer:
            self._viewer.params, self._viewer.slope = view, track.slope

    def look_through(self, camera: Camera) -> None:
        """Take the camera that the frames to come are made with."""
        if self._viewer:
            self._refused_before += self._viewer.refused
        self._camera = camera
        self._viewer = PairViewer(self.mounts.values(), camera, self._slope, self._view)

    def process(self, frame: Frame) -> Tracked:
        """Track the wheels in the next frame.

        Raises:
            ValueError: no camera is known, or the frame is not of its size.

        """
        if self._viewer is None or self._camera is None:
            raise ValueError('no camera is known')
        height, width = frame.image.shape[:2]
        if (width, height) != (self._camera.width, self._camera.height):
            turned = (height, width) == (self._camera.width, self._camera.height)
            raise ValueError(
                f'the picture is {width}x{height}, but the camera is calibrated for '
                f'{self._camera.width}x{self._camera.height}: '
                + ('turn the video back by 90°' if turned else 'let it send that size, or calibrate it anew')
            )
        sighting = self._follower.follow(_grey(frame.image), frame.stamp_ns)
        view = self._viewer.view(frame.stamp_ns, sighting.detections)
        axes = self._viewer.plane.axes(math.radians(self._view.roll_deg))
        self._stamp_ns = frame.stamp_ns
        if sighting.duplicates:
            self._duplicate, self._duplicate_ns = sighting.duplicates[0], frame.stamp_ns
            self._duplicates += 1
        for wheel, seen in ((FRONT, view.front), (REAR, view.rear)):
            self._qualities[wheel] = self._qualities[wheel].after(frame.stamp_ns, seen)
        return Tracked(sighting.detections, axes, view, self._angles.update(view))

    def status(self) -> TrackerStatus:
        """A snapshot."""
        front, rear = (
            tuple(mount.id for mount in self.mounts.values() if mount.wheel == wheel) for wheel in (FRONT, REAR)
        )
        refused = self._refused_before + (self._viewer.refused if self._viewer else 0)
        return TrackerStatus(
            self._stamp_ns,
            self._qualities[FRONT],
            self._qualities[REAR],
            (front, rear),
            self._duplicate,
            self._duplicate_ns,
            self._duplicates,
            refused,
            self._angles.status(),
        )


def _grey(image: Picture) -> Picture:
    cv2 = opencv()
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)

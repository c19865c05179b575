"""Motion capture in the camera's place: the poses of both wheels, from separate streams, as views of the pair."""

import math
from collections import deque
from typing import Annotated, NamedTuple

import numpy as np

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import PoseSample
from dcdrw_msgs_py.values import Floats
from dcdrw_tracker.tags.wheel_view import PairView, WheelView
from dcdrw_tracker.wheels.wheel_track import TrackParams

AXES = 'xyz'
LONGEST_PAUSE_NS = 100_000_000
"""Over a longer pause a pose is neither waited for nor interpolated."""
TURNED = math.radians(10.0)
"""A wheel that has turned so far shows which way its axle lies [rad]."""
ACROSS = 0.9
"""The axle must lie across downhill to within this cosine."""
OFF_SLOPE = 0.3
"""A hub that is further from the line on which the hubs travel is on no wheel that rolls [m]."""
FEW = 10
"""Hubs that tell where this line lies."""
RECENT = 200
"""Hubs over which the line is taken."""
MOST_WAITING = 600
"""Views that are kept until a wheel has turned."""
LEAST_LEVER = 0.5
"""A body's axis must lie at least so far in the plane of its wheel, as a share of its length."""
LEAST_TRAVEL = 0.5
"""A hub that goes at least so far, as a share of what its wheel rolls, and the other way, is none that rolls."""

OffsetDeg = Annotated[
    float,
    Quantity("ψ of the wheel while that axis of its body lies along the slope's normal", 'deg', low=-360.0, high=360.0),
]


class PoseParams(NamedTuple):
    """How the bodies that are tracked lie in the wheels, and the slope in the room."""

    heading_deg: Annotated[
        float,
        Quantity(
            'direction of downhill in the room, from x towards y (with y up: towards -z)',
            'deg',
            low=-360.0,
            high=360.0,
            derived='from the rear hub to the front one',
        ),
    ] = math.nan
    spoke_axis: Annotated[str, Quantity("axis of each wheel's body that lies along a spoke: x, y or z")] = 'z'
    front_offset_deg: OffsetDeg = 0.0
    rear_offset_deg: OffsetDeg = 0.0
    up_axis: Annotated[
        str, Quantity("the room's axis that points up; y: as OptiTrack streams by default", choices=('z', 'y'))
    ] = 'z'

    def check_axis(self) -> None:
        """Refuse an axis that there is not.

        Raises:
            ValueError: as told.

        """
        if self.spoke_axis not in tuple(AXES):
            raise ValueError(f'spoke_axis must be x, y or z, got {self.spoke_axis!r}')


class _Seen(NamedTuple):
    """One wheel at its own instant."""

    stamp_ns: int
    rotation: float
    hub: tuple[float, float]


class PosePairs:
    """Makes views of the pair from the poses of each wheel.

    The wheels' poses need not come at the same instants, nor in order: a view is made at each pose of the front wheel,
    the rear one being interpolated between its poses on either side. A wheel whose poses stay away is not seen; nor is
    one whose poses repeat to the last bit, are a default, or lie off the slope: so trackers send them while a body is
    hidden.

    Views are held back until a wheel has turned far enough to show that its axle lies across downhill: else the
    room's axes are not those that were told, and every view would be wrong.

    Raises:
        ValueError: an impossible axis.

    """

    def __init__(self, params: PoseParams, track: TrackParams) -> None:
        params.check_axis()
        self._axis = AXES.index(params.spoke_axis)
        self._offsets = {FRONT: math.radians(params.front_offset_deg), REAR: math.radians(params.rear_offset_deg)}
        self._track = track
        self._lengths = {FRONT: track.front.length, REAR: track.rear.length}
        self._path: dict[str, deque[_Seen]] = {wheel: deque(maxlen=RECENT) for wheel in self._lengths}
        """Where each wheel was until it is known how the axes lie; rotations without jumps."""
        self._basis = None if math.isnan(params.heading_deg) else _basis(math.radians(params.heading_deg), track.slope)
        self._first: dict[str, PoseSample] = {}
        self._front: deque[_Seen] = deque()
        self._rear: deque[_Seen] = deque()
        self._last_ns = 0
        self._y_up = params.up_axis == 'y'
        self._latest: dict[str, PoseSample] = {}
        self._heights: deque[float] = deque(maxlen=RECENT)
        self._level = math.nan
        self._waiting: deque[PairView] | None = deque(maxlen=MOST_WAITING)

    @property
    def waits(self) -> str:
        """Why views are held back; empty where none are."""
        if not self._waiting:
            return ''
        text = f'no wheel has turned by {math.degrees(TURNED):g}°, which shows whether the axes are as told'
        for wheel, length in self._lengths.items():
            if (gone := self._gone(wheel)) > length:
                text += f'; the hub of the {wheel} wheel has gone {gone:.1f} m without: is its orientation tracked?'
        return text

    def take(self, wheel: str, pose: PoseSample) -> list[PairView]:
        """Take the next pose of a wheel, `front` or `rear`; returns the views that it completes, in order.

        Raises:
            ValueError: no pose, as motion capture sends where it has lost a body, or a body whose axis is not a spoke.

        """
        if pose.stamp_ns == 0:
            raise ValueError('the stamps are zero: without their time poses tell no motion; let the source stamp them')
        if not all(map(math.isfinite, (*pose.position, *pose.orientation))):
            raise ValueError('position or orientation is not a number')
        size = math.hypot(*pose.orientation)
        if not abs(size - 1.0) < 0.01:
            raise ValueError(
                f'the orientation is not a unit quaternion: its length is {size:.3g}; let the source normalize it'
                if size
                else 'the orientation is all zeros, as where nothing tells it or the body is hidden'
            )
        if not any(pose.position) and not any(pose.orientation[:3]):
            raise ValueError(f'the {wheel} wheel is at the origin, unturned: a default pose, sent while it is hidden')
        latest = self._latest.get(wheel)
        self._latest[wheel] = pose
        if latest == pose:
            return []  # the message has come twice
        if latest and latest[1:] == pose[1:]:
            raise ValueError(f'the pose of the {wheel} wheel repeats to the last bit, as where it is hidden')
        if self._y_up:
            pose = _z_up(pose)
        if self._basis is None:
            self._find_heading(wheel, pose)
        if self._basis is None:
            return []
        seen = self._seen(wheel, pose, self._basis)
        self._check_height(wheel, seen.hub[1])
        if self._waiting is not None:
            before = self._path[wheel][-1].rotation if self._path[wheel] else seen.rotation
            unwrapped = before + math.remainder(seen.rotation - before, math.tau)
            self._path[wheel].append(seen._replace(rotation=unwrapped))
        queue = self._front if wheel == FRONT else self._rear
        if queue and seen.stamp_ns <= queue[-1].stamp_ns:
            queue.clear()  # the stream has started anew
            self._last_ns = 0
        queue.append(seen)
        return self._released(self._views(), wheel, pose, self._basis)

    def _check_height(self, wheel: str, height: float) -> None:
        """Refuse a hub that is off the line along the slope on which the hubs travel."""
        if abs(height - self._level) > OFF_SLOPE:
            raise ValueError(
                f'the hub of the {wheel} wheel is {abs(height - self._level):.1f} m off the line on which hubs travel: '
                'it is hidden or carried, front and rear are swapped, slope, heading_deg or up_axis are not those of '
                'the room, or the positions are not in m'
            )
        self._heights.append(height)
        if len(self._heights) >= FEW and (math.isnan(self._level) or len(self._heights) < RECENT):
            self._level = sorted(self._heights)[len(self._heights) // 2]

    def _released(self, views: list[PairView], wheel: str, pose: PoseSample, basis: Floats) -> list[PairView]:
        """These views, and those that were held back once the wheels' axle is known to lie across downhill."""
        if self._waiting is None:
            return views
        self._waiting.extend(views)
        axle, turned = _turn(self._first.setdefault(wheel, pose).orientation, pose.orientation)
        if turned < TURNED:
            return []
        across = np.cross(basis[1], basis[0])
        if abs(float(axle @ across)) < ACROSS:
            self._waiting.clear()
            if abs(axle[2]) >= ACROSS:
                up, other = 'yz' if self._y_up else 'zy'
                raise ValueError(
                    f'the wheels turn about the axis that should point up, {up}; is {other} up? set up_axis to {other}'
                )
            raise ValueError(
                f'the {wheel} wheel does not turn about an axis across downhill: see heading_deg and up_axis, '
                'and whether the components of orientations are in the order x, y, z, w'
            )
        self._check_roll(wheel)
        views = list(self._waiting)
        self._waiting = None
        return views

    def _check_roll(self, wheel: str) -> None:
        """Refuse a wheel that turns against the way that its hub goes."""
        first, last = self._path[wheel][0], self._path[wheel][-1]
        turned, gone = last.rotation - first.rotation, last.hub[0] - first.hub[0]
        least = LEAST_TRAVEL * self._lengths[wheel] * abs(turned)
        if not self._track.camera_follows and turned * gone < 0.0 and abs(gone) > least and abs(turned) > TURNED / 2:
            if self._waiting:
                self._waiting.clear()
            raise ValueError(
                f'the {wheel} wheel turns against the way that its hub goes: are the components of its orientation in '
                'the order x, y, z, w, and not those of the inverse? (a treadmill: set camera_follows)'
            )

    def _gone(self, wheel: str) -> float:
        """How far the hub is along the slope from where it was first seen [m]."""
        if self._basis is None or not self._path[wheel] or wheel not in self._first:
            return 0.0
        return abs(float(self._path[wheel][-1].hub[0] - self._basis[0] @ np.array(self._first[wheel].position)))

    def _find_heading(self, wheel: str, pose: PoseSample) -> None:
        self._first.setdefault(wheel, pose)
        if len(self._first) == 2:
            front, rear = (self._first[name].position for name in (FRONT, REAR))
            self._basis = _basis(math.atan2(front[1] - rear[1], front[0] - rear[0]), self._track.slope)

    def _seen(self, wheel: str, pose: PoseSample, basis: Floats) -> _Seen:
        """ψ is the angle of the spoke's axis from the slope's normal towards downhill."""
        downhill, normal = basis @ _axis(pose.orientation, self._axis)
        if math.hypot(downhill, normal) < LEAST_LEVER:
            raise ValueError(
                f"the {AXES[self._axis]} axis of the {wheel} wheel's body lies along its axle: "
                'set spoke_axis to one that lies along a spoke, or up_axis to the one that is up in the room'
            )
        x, y = basis @ np.array(pose.position)
        return _Seen(pose.stamp_ns, math.atan2(downhill, normal) + self._offsets[wheel], (float(x), float(y)))

    def _views(self) -> list[PairView]:
        views, front, rear = [], self._front, self._rear
        while front and not self._awaited(front[0].stamp_ns):
            seen = front.popleft()
            views.append(PairView(seen.stamp_ns, _view(seen), _between(rear, seen.stamp_ns)))
        while len(rear) > 1 and rear[-1].stamp_ns - rear[0].stamp_ns > 2 * LONGEST_PAUSE_NS:
            seen = rear.popleft()
            if seen.stamp_ns > (views[-1].stamp_ns if views else self._last_ns):
                views.append(PairView(seen.stamp_ns, None, _view(seen)))
        if views:
            self._last_ns = views[-1].stamp_ns
        return views

    def _awaited(self, stamp_ns: int) -> bool:
        """Whether the rear wheel's pose at that instant or after it may yet come; those long before it are dropped."""
        rear = self._rear
        while len(rear) > 1 and rear[1].stamp_ns <= stamp_ns:
            rear.popleft()
        come = bool(rear) and rear[-1].stamp_ns >= stamp_ns
        return not come and self._front[-1].stamp_ns - stamp_ns <= LONGEST_PAUSE_NS


def _between(seen: deque[_Seen], stamp_ns: int) -> WheelView | None:
    """The wheel at an instant, from the two that were seen last; None where neither is close."""
    if not seen or seen[0].stamp_ns > stamp_ns:
        return None
    first = seen[0]
    if first.stamp_ns == stamp_ns:
        return _view(first)
    if len(seen) == 1 or seen[1].stamp_ns - first.stamp_ns > LONGEST_PAUSE_NS:
        return None
    share = (stamp_ns - first.stamp_ns) / (seen[1].stamp_ns - first.stamp_ns)
    rotation = first.rotation + share * math.remainder(seen[1].rotation - first.rotation, math.tau)
    x, y = (a + share * (b - a) for a, b in zip(first.hub, seen[1].hub, strict=True))
    return _view(_Seen(stamp_ns, rotation, (x, y)))


def _view(seen: _Seen) -> WheelView:
    return WheelView(math.remainder(seen.rotation, math.tau), seen.hub, error_px=0.0, tags=0, size_px=math.inf)


def _basis(heading: float, slope: float) -> Floats:
    """Rows: downhill along the slope, and its normal, in the room's axes (2, 3)."""
    ahead, across = math.cos(heading), math.sin(heading)
    fall, rise = math.sin(slope), math.cos(slope)
    return np.array(((rise * ahead, rise * across, -fall), (fall * ahead, fall * across, rise)))


def _axis(orientation: tuple[float, float, float, float], axis: int) -> Floats:
    """A body's axis in the room: one column of its rotation matrix."""
    x, y, z, w = orientation
    columns = (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.array(columns[axis])


def _z_up(pose: PoseSample) -> PoseSample:
    """The same in a room whose z points up, of one whose y does: turned by 90° about x."""
    (x, y, z), (qx, qy, qz, qw) = pose.position, pose.orientation
    half = math.sqrt(0.5)
    turned = (half * (qx + qw), half * (qy - qz), half * (qz + qy), half * (qw - qx))
    return PoseSample(pose.stamp_ns, (x, -z, y), turned)


def _turn(first: tuple[float, float, float, float], then: tuple[float, float, float, float]) -> tuple[Floats, float]:
    """Axis in the room (a unit vector) and angle [rad] of the turn from one orientation to another, then · first⁻¹."""
    a, b = np.array(first[:3]), np.array(then[:3])
    vector = first[3] * b - then[3] * a - np.cross(b, a)
    sine, cosine = float(np.linalg.norm(vector)), then[3] * first[3] + float(b @ a)
    return vector / sine if sine else vector, 2.0 * math.atan2(sine, abs(cosine))

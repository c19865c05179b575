"""Motion capture in the camera's place: the poses of both wheels, from separate streams, as views of the pair."""

import math
from collections import deque
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import PoseSample
from dcdrw_tracker.tags.wheel_view import PairView, WheelView

Floats = NDArray[np.float64]

AXES = 'xyz'
LONGEST_PAUSE_NS = 100_000_000
"""Over a longer pause a pose is neither waited for nor interpolated."""
LEAST_LEVER = 0.5
"""A body's axis must lie at least so far in the plane of its wheel, as a share of its length."""

OffsetDeg = Annotated[
    float, Quantity("ψ of the wheel while that axis of its body lies along the slope's normal", 'deg')
]


class PoseParams(NamedTuple):
    """How the bodies that are tracked lie in the wheels, and the slope in the room (z up)."""

    heading_deg: Annotated[
        float,
        Quantity(
            'direction of downhill in the room, from x towards y', 'deg', derived='from the rear hub to the front one'
        ),
    ] = math.nan
    spoke_axis: Annotated[str, Quantity("axis of each wheel's body that lies along a spoke: x, y or z")] = 'z'
    front_offset_deg: OffsetDeg = 0.0
    rear_offset_deg: OffsetDeg = 0.0

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
    the rear one being interpolated between its poses on either side. A wheel whose poses stay away is not seen.

    Raises:
        ValueError: an impossible axis.

    """

    def __init__(self, params: PoseParams, slope: float) -> None:
        params.check_axis()
        self._axis = AXES.index(params.spoke_axis)
        self._offsets = {FRONT: math.radians(params.front_offset_deg), REAR: math.radians(params.rear_offset_deg)}
        self._slope = slope
        self._basis = None if math.isnan(params.heading_deg) else _basis(math.radians(params.heading_deg), slope)
        self._first: dict[str, PoseSample] = {}
        self._front: deque[_Seen] = deque()
        self._rear: deque[_Seen] = deque()
        self._last_ns = 0

    def take(self, wheel: str, pose: PoseSample) -> list[PairView]:
        """Take the next pose of a wheel, `front` or `rear`; returns the views that it completes, in order.

        Raises:
            ValueError: no pose, as motion capture sends where it has lost a body, or a body whose axis is no spoke.

        """
        if not all(map(math.isfinite, (*pose.position, *pose.orientation))):
            raise ValueError('position or orientation is no number')
        if not abs(math.hypot(*pose.orientation) - 1.0) < 0.01:
            raise ValueError(f'the orientation {pose.orientation} is no unit quaternion')
        if self._basis is None:
            self._find_heading(wheel, pose)
        if self._basis is None:
            return []
        seen = self._seen(wheel, pose, self._basis)
        queue = self._front if wheel == FRONT else self._rear
        if queue and seen.stamp_ns <= queue[-1].stamp_ns:
            queue.clear()  # the stream has started anew
            self._last_ns = 0
        queue.append(seen)
        return self._views()

    def _find_heading(self, wheel: str, pose: PoseSample) -> None:
        self._first[wheel] = pose
        if len(self._first) == 2:
            front, rear = (self._first[name].position for name in (FRONT, REAR))
            self._basis = _basis(math.atan2(front[1] - rear[1], front[0] - rear[0]), self._slope)

    def _seen(self, wheel: str, pose: PoseSample, basis: Floats) -> _Seen:
        """ψ is the angle of the spoke's axis from the slope's normal towards downhill."""
        downhill, normal = basis @ _axis(pose.orientation, self._axis)
        if math.hypot(downhill, normal) < LEAST_LEVER:
            raise ValueError(
                f"the {AXES[self._axis]} axis of the {wheel} wheel's body lies along its axle: "
                'set spoke_axis to one that lies along a spoke'
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

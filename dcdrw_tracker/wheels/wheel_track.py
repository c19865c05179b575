"""One wheel through time: from views modulo 2π to a rotation that loses no turn, and its speed.

Time arrives in the views. What no wheel can do is refused and counted by its reason.
"""

import math
from typing import Annotated, Literal, NamedTuple, get_args

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import Gravity, RigParams, Slope, WheelShape
from dcdrw_tracker.gait.phase import MaxSpeed, PhaseParams
from dcdrw_tracker.tags.wheel_view import WheelView
from dcdrw_tracker.wheels.hub_travel import HubTravel
from dcdrw_tracker.wheels.stance_filter import StanceFilter

Outlier = Literal['misfit', 'jump']
"""Why a view is refused: its tags do not lie where the picture shows them, or no wheel gets there in that time."""

START_VIEWS = 3
"""Views that must agree where there is nothing to compare with: at the start, and after an occlusion."""
LONGEST_PAUSE = 0.3
"""Views further apart do not confirm each other [s]."""
GOING = 1.0
"""A wheel that stood when it was last seen may have gone off at this pace [rad/s]."""
PACE_MEMORY = 1.0
"""Time over which the mean speed is taken [s]."""
LEAST_SPREAD = 0.0005
"""Standard deviation of a rotation at best [rad]."""


class TrackParams(NamedTuple):
    """What is known of the rig, and what a wheel can do."""

    front: WheelShape = WheelShape()
    rear: WheelShape = WheelShape()
    slope: Slope = RigParams().slope
    gravity: Gravity = RigParams().gravity
    camera_follows: Annotated[
        bool,
        Quantity(
            'the camera travels with the pair, or the ground under both (treadmill): how often a wheel has '
            'turned is then told by the distance of the hubs'
        ),
    ] = False
    max_speed: MaxSpeed = PhaseParams().max_speed
    max_acceleration: Annotated[
        float,
        Quantity(
            'beyond what gravity and strikes do, a wheel gains at most so much speed',
            'rad/s²',
            above=0.0,
            high=10_000.0,
            live=True,
        ),
    ] = 20.0
    max_jump_deg: Annotated[
        float,
        Quantity(
            'a rotation further than this from where the wheel can be is an outlier',
            'deg',
            above=0.0,
            high=10.0,
            live=True,
        ),
    ] = 3.0
    max_error_px: Annotated[
        float, Quantity('a view whose reprojection error is larger is an outlier', 'px', above=0.0, live=True)
    ] = 3.0
    relock_views: Annotated[
        int, Quantity('outliers in a row that agree, and so are the truth', low=START_VIEWS, high=1000, live=True)
    ] = 10


class TrackStatus(NamedTuple):
    """A snapshot of one wheel, for diagnostics."""

    stamp_ns: int
    """Stamp of the last view that was taken; 0 where there was none."""
    psi: float
    rate: float
    taken: int
    outliers: dict[Outlier, int]
    unconfirmed: int
    """Views held back until others agree, at the start and after occlusions."""
    restored: int
    """Occlusions longer than a step, after which the number of turns is known."""
    travels: bool
    """The hub travels as the wheel rolls."""


class Taken(NamedTuple):
    """A view has been taken: where the wheel is now."""

    psi: float
    """ψ, unbounded [rad]."""
    rate: float
    """ψ̇ [rad/s]."""
    certain: bool
    """No turn is lost since the last view that was taken."""


class _Held(NamedTuple):
    """A view that waits for others to agree."""

    stamp_ns: int
    view: WheelView
    rate: float
    """Mean speed since the one before [rad/s]; NaN for the first."""


class WheelTrack:
    """Follows one wheel from view to view.

    A tag tells ψ modulo 2π. Shortly after the last view ψ must lie near where the filter foretells it: else it is an
    outlier, unless so many agree that the wheel must indeed have been moved. After an occlusion it may lie anywhere:
    views are then held until `START_VIEWS` agree, and the hub's place tells how often the wheel has turned meanwhile;
    where it does not, the wheel's pace does, up to half a turn at least.
    """

    def __init__(self, shape: WheelShape, params: TrackParams) -> None:
        self._shape = shape
        self._filter: StanceFilter | None = None
        self._travel = HubTravel(shape)
        self._stamp_ns = self._filter_ns = 0
        self._psi = math.nan
        self._pace = 0.0
        self._held: list[_Held] = []
        self._taken = self._unconfirmed = self._restored = 0
        self._outliers: dict[Outlier, int] = dict.fromkeys(get_args(Outlier), 0)
        self.configure(params)

    def configure(self, params: TrackParams) -> None:
        """Take changed limits at once."""
        self._params = params
        self._jump = math.radians(params.max_jump_deg)

    def forget(self) -> None:
        """Start anew with the next views; the counts stay."""
        self._filter, self._held = None, []
        self._stamp_ns, self._pace = 0, 0.0
        self.forget_travel()

    def goes_on(self, view: WheelView, dt: float) -> bool:
        """Whether the wheel turns, and a view has it where its pace takes it in dt seconds, by half more or less."""
        along = self._pace * dt
        off = math.remainder(view.rotation - self._psi - along, math.tau)
        return self._filter is not None and 0.0 < abs(along) and abs(off) <= self._jump + 0.5 * abs(along)

    def set_clock(self, ns: int) -> None:
        """Take it that the clock of the views was set by so much."""
        self._stamp_ns += ns
        self._filter_ns += ns
        self._held.clear()

    @property
    def seen_ns(self) -> int:
        """When a view was last taken; 0 where none was."""
        return self._stamp_ns

    def take(self, stamp_ns: int, view: WheelView, place: float | None) -> Taken | None:
        """Take the next view; None where it is refused or has to wait for others, which is counted.

        Args:
            stamp_ns: time of the view, after that of the last one.
            view: what was seen.
            place: the hub's place along the slope from a point that stays, plus a constant [m]; None: not known.

        """
        if not view.error_px <= self._params.max_error_px:
            self._outliers['misfit'] += 1
            return None
        if self._filter is None or self._reach(stamp_ns) > self._shape.alpha:
            return self._hold(stamp_ns, view, place)
        self._filter.predict((stamp_ns - self._filter_ns) * 1e-9)
        self._filter_ns = stamp_ns
        error = math.remainder(view.rotation - self._filter.psi, math.tau)
        if abs(error) > self._reach(stamp_ns):
            return self._hold(stamp_ns, view, place)
        psi = self._filter.psi + error
        self._filter.correct(psi, _spread(view))
        return self._arrive(stamp_ns, psi, place, certain=True)

    def forget_travel(self) -> None:
        """Learn anew where the hub is at ψ = 0: what its place was measured from has changed."""
        self._travel = HubTravel(self._shape)

    def learn(self, place: float) -> None:
        """Learn from the hub's place where it becomes known only after the last view was taken."""
        self._travel.learn(place, self._psi)

    def status(self) -> TrackStatus:
        """A snapshot."""
        rate = self._filter.rate if self._filter else math.nan
        return TrackStatus(
            self._stamp_ns,
            self._psi,
            rate,
            self._taken,
            self._outliers.copy(),
            self._unconfirmed,
            self._restored,
            self._travel.steady,
        )

    def _since(self, stamp_ns: int) -> float:
        """Time since a view was last taken [s]."""
        return (stamp_ns - self._stamp_ns) * 1e-9

    def _reach(self, stamp_ns: int) -> float:
        """How far from where it is foretold the wheel may be [rad]."""
        return self._jump + 0.5 * self._params.max_acceleration * self._since(stamp_ns) ** 2

    def _arrive(self, stamp_ns: int, psi: float, place: float | None, certain: bool) -> Taken:
        assert self._filter
        if self._stamp_ns:
            dt = self._since(stamp_ns)
            self._pace += (psi - self._psi - self._pace * dt) / max(dt, PACE_MEMORY)
        self._stamp_ns, self._psi = stamp_ns, psi
        self._held.clear()
        self._taken += 1
        if place is not None:
            self._travel.learn(place, psi)
        return Taken(psi, self._filter.rate, certain)

    def _hold(self, stamp_ns: int, view: WheelView, place: float | None) -> Taken | None:
        """Keep a view that may be wrong; take it where enough before it agree."""
        held = self._held
        rate = self._rate_from(held[-1], stamp_ns, view) if held else math.nan
        if held and math.isnan(rate):
            held.clear()
        held.append(_Held(stamp_ns, view, rate))
        fresh = self._filter is None or self._reach(held[0].stamp_ns) > self._shape.alpha
        if len(held) >= (START_VIEWS if fresh else self._params.relock_views):
            return self._adopt(place)
        if fresh:
            self._unconfirmed += 1
        else:
            self._outliers['jump'] += 1
        return None

    def _rate_from(self, earlier: _Held, stamp_ns: int, view: WheelView) -> float:
        """Mean speed from a held view to one that agrees with it [rad/s]; NaN where it does not."""
        dt = (stamp_ns - earlier.stamp_ns) * 1e-9
        if not 0.0 < dt <= LONGEST_PAUSE:
            return math.nan
        moved = math.remainder(view.rotation - earlier.view.rotation, math.tau)
        if abs(moved) > self._params.max_speed * dt + self._jump:
            return math.nan
        change = 0.0 if math.isnan(earlier.rate) else abs(moved - earlier.rate * dt)
        return moved / dt if change <= 2.0 * self._jump + self._params.max_acceleration * dt**2 else math.nan

    def _adopt(self, place: float | None) -> Taken:
        """Go on from the held views: the filter anew, the turns as the hub or the pace tells them."""
        held = self._held
        stamp_ns, view, _ = held[-1]
        psi, certain = self._unwrapped(stamp_ns, view.rotation, place) if self._filter else (view.rotation, True)
        if not certain:
            self.forget_travel()
        path = [psi]
        for later, earlier in zip(held[:0:-1], held[-2::-1], strict=True):
            path.append(path[-1] - math.remainder(later.view.rotation - earlier.view.rotation, math.tau))
        path.reverse()
        rate = (path[-1] - path[0]) / ((stamp_ns - held[0].stamp_ns) * 1e-9)
        self._filter = StanceFilter(
            self._shape, self._params.slope, self._params.gravity, path[0], rate, _spread(held[0].view)
        )
        for earlier, later, seen in zip(held, held[1:], path[1:], strict=False):
            self._filter.predict((later.stamp_ns - earlier.stamp_ns) * 1e-9)
            self._filter.correct(seen, _spread(later.view))
        self._filter_ns = stamp_ns
        return self._arrive(stamp_ns, psi, place, certain)

    def _unwrapped(self, stamp_ns: int, rotation: float, place: float | None) -> tuple[float, bool]:
        """ψ after an occlusion, and whether the number of turns is certain."""
        dt, step = self._since(stamp_ns), 2.0 * self._shape.alpha + self._jump
        # It may have doubled its pace, and rocked back by a step; what is further was carried there.
        far = 2.0 * max(abs(self._pace), GOING) * dt + step
        low, high = (-step, far) if self._pace >= 0.0 else (-far, step)

        def rolled(psi: float) -> bool:
            return low <= psi - self._psi <= high

        by_hub = self._travel.psi(place) if place is not None else None
        if by_hub is not None and abs(math.remainder(rotation - by_hub, math.tau)) <= 0.5 * math.pi:
            psi = _nearest(rotation, by_hub)
            certain = rolled(psi)
        else:
            psi = _nearest(rotation, self._psi + self._pace * dt)
            certain = rolled(psi) and not rolled(psi - math.tau) and not rolled(psi + math.tau)
        if certain and abs(psi - self._psi) > step:
            self._restored += 1
        return psi, certain


def _nearest(rotation: float, psi: float) -> float:
    """The rotation, whole turns aside, nearest to ψ [rad]."""
    return psi + math.remainder(rotation - psi, math.tau)


def _spread(view: WheelView) -> float:
    """Standard deviation of a view's rotation, as its corners' errors and the tags' size let expect [rad]."""
    return max(LEAST_SPREAD, view.error_px / view.size_px)

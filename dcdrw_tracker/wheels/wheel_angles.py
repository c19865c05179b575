"""Both wheels through time: views of the pair in, joint samples out (contract §1)."""

from typing import NamedTuple

from dcdrw_msgs_py.rolling import hub_travel
from dcdrw_msgs_py.samples import JointSample, Turn
from dcdrw_tracker.gait.cadence import Cadence, CadenceStatus
from dcdrw_tracker.tags.wheel_view import PairView, WheelView
from dcdrw_tracker.wheels.wheel_track import START_VIEWS, Taken, TrackParams, TrackStatus, WheelTrack


class AnglesStatus(NamedTuple):
    """A snapshot of both wheels, for diagnostics."""

    views: int
    samples: int
    """Views in which both wheels were measured."""
    out_of_order: int
    """Views whose stamp does not move on."""
    run: int
    lost: int
    """How often the number of turns was lost, or the source started anew: runs that have ended."""
    cadence: CadenceStatus
    front: TrackStatus
    rear: TrackStatus


class WheelAngles:
    """Follows both wheels; a view in, a sample out.

    A sample is given only where both wheels are measured in one view: no rotation is ever made up, so a wheel that is
    hidden shows as a gap in the stamps, which is seen downstream. Within a run no turn is lost. Where one may be,
    because nothing tells how often a wheel has turned while it was hidden, a new run begins.

    The hub's travel tells the turns: with a fixed camera each hub's own, with one that follows the pair the distance
    to the other hub, whose wheel's rotation is known (S = S0 + n1 σ1 − n2 σ2).
    """

    def __init__(self, params: TrackParams, first_run: int = 1) -> None:
        self._shapes = params.front, params.rear
        self._tracks = WheelTrack(params.front, params), WheelTrack(params.rear, params)
        self._follows = params.camera_follows
        self._cadence = Cadence()
        self._run = self._first_run = first_run
        self._stamp_ns: int | None = None
        self._relock_views, self._behind = params.relock_views, 0
        self._views = self._samples = self._out_of_order = 0

    def configure(self, params: TrackParams) -> None:
        """Take changed limits at once; the rest holds from the start on."""
        self._relock_views = params.relock_views
        for track in self._tracks:
            track.configure(params)

    def update(self, view: PairView) -> JointSample | None:
        """Take the next view; None unless both wheels are measured in it."""
        self._views += 1
        if self._stamp_ns is not None and view.stamp_ns <= self._stamp_ns:
            self._out_of_order += 1
            self._behind += view.stamp_ns < self._stamp_ns
            if not (self._behind >= START_VIEWS and self._set_back(view)):
                if self._behind < self._relock_views:
                    return None
                self._start_anew(view.stamp_ns)  # a recording that loops
        self._behind = 0
        self._stamp_ns = view.stamp_ns
        self._cadence.tick(view.stamp_ns)
        front, rear = self._followed(view) if self._follows else self._fixed(view)
        if (front and not front.certain) or (rear and not rear.certain):
            self._run += 1
        if not (front and rear):
            return None
        self._samples += 1
        return JointSample(view.stamp_ns, Turn(front.psi, front.rate), Turn(rear.psi, rear.rate), run=self._run)

    def status(self) -> AnglesStatus:
        """A snapshot."""
        front, rear = self._tracks
        return AnglesStatus(
            self._views,
            self._samples,
            self._out_of_order,
            self._run,
            self._run - self._first_run,
            self._cadence.status(),
            front.status(),
            rear.status(),
        )

    def _set_back(self, view: PairView) -> bool:
        """Whether both wheels have gone on while the stamps went back: only the clock was set. The tracks follow it."""
        assert self._stamp_ns is not None
        passed_ns = self._behind * self._cadence.period_ns
        pairs = tuple(zip(self._tracks, view[1:], strict=True))
        if not all(seen and track.goes_on(seen, passed_ns * 1e-9) for track, seen in pairs):
            return False
        for track in self._tracks:
            track.set_clock(view.stamp_ns - passed_ns - self._stamp_ns)
        self._cadence.jump(view.stamp_ns)
        return True

    def _start_anew(self, stamp_ns: int) -> None:
        self._run += 1
        self._cadence.jump(stamp_ns)
        for track in self._tracks:
            track.forget()

    def _fixed(self, pair: PairView) -> tuple[Taken | None, Taken | None]:
        front, rear = (
            track.take(pair.stamp_ns, view, view.hub[0]) if view else None
            for track, view in zip(self._tracks, pair[1:], strict=True)
        )
        return front, rear

    def _followed(self, pair: PairView) -> tuple[Taken | None, Taken | None]:
        """First the wheel that was seen last, then the other one, by its distance from the first."""
        taken: list[Taken | None] = [None, None]
        views: tuple[WheelView | None, WheelView | None] = pair.front, pair.rear
        first = 0 if self._tracks[0].seen_ns >= self._tracks[1].seen_ns else 1
        other = 1 - first
        here, there = views[first], views[other]
        if here:
            taken[first] = self._tracks[first].take(pair.stamp_ns, here, None)
        if there:
            known = taken[first]
            place = self._place(there, here, first, known.psi) if here and known else None
            if known and not known.certain:
                self._tracks[other].forget_travel()
            taken[other] = self._tracks[other].take(pair.stamp_ns, there, place)
        if here and there and taken[first] and (known := taken[other]):
            if not known.certain:
                self._tracks[first].forget_travel()
            self._tracks[first].learn(self._place(here, there, other, known.psi))
        return taken[0], taken[1]

    def _place(self, view: WheelView, known: WheelView, wheel: int, psi: float) -> float:
        """A hub's place from the start of the other wheel, which is known to have turned to ψ [m]."""
        return view.hub[0] - known.hub[0] + hub_travel(self._shapes[wheel], psi)

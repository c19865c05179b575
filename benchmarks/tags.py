"""How well and how fast wheels are tracked by their tags, beside `pupil-apriltags` as it is on the same frames.

    python benchmarks/tags.py [--seconds 5] [--only NAME]

Each row is a simulated trial, filmed at 60 frames/s in 1280 × 720 by the virtual camera, with the tags' side, the view
and the flaws that its name tells; noise is 2 of 255 grey levels where nothing else is said, and the exposure 1 ms.
`pupil-apriltags` has its defaults. Both detectors see the same frames, and what comes after them is the same: view of
the pair, angles, phase estimator. All runs on one core, and time is the core's.

Read the table from left to right: the goal of φ, where the film has one; root mean square error of φ over all frames
[deg]; that of the strikes' times [ms] (goal, where φ has one: half a frame, 8.3 ms); frames whose n is wrong, of those
in which no wheel is within half a degree of a strike (goal: none); share of the frames in which not both wheels were
measured; processor time per frame [ms], detection to phase; frames per second (goal: 60). Then the same for
`pupil-apriltags`; last, how many times as fast the tracker is (goal: 3). `!` marks a goal that is missed.
"""

import argparse
import math
import random
import time
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from dcdrw.trials.shots import Shots
from dcdrw_msgs_py.frame import Picture
from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams
from dcdrw_msgs_py.samples import JointSample
from dcdrw_msgs_py.tagging import TagParams, mounts
from dcdrw_sim.camera.render import LookParams, Renderer
from dcdrw_sim.camera.scene import Footing, SceneParams, ViewParams
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.rig.simulator import SimulatorParams
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams
from dcdrw_tracker.tags.detector import Detection, TagDetector
from dcdrw_tracker.tags.tag_follower import TagFollower
from dcdrw_tracker.tags.wheel_view import PairViewer
from dcdrw_tracker.wheels.wheel_angles import WheelAngles
from dcdrw_tracker.wheels.wheel_track import TrackParams

RIG, TAGS = RigParams(), TagParams()
RATE = 60.0
HALF_A_FRAME = 500.0 / RATE
"""[ms]"""
AT_A_STRIKE = math.radians(0.5)
"""Nearer to a strike n may change a frame earlier or later."""
FASTEST, TIMES = 60.0, 3.0

Detect = Callable[[Picture, int], Iterable[Detection]]


class Case(NamedTuple):
    """One film."""

    name: str
    side: float
    """Side of the tags, about [px]."""
    goal: float = math.inf
    """Goal for the error of φ [deg]; infinite: the film shows how far it goes, and has goals for n and pace only."""
    view: ViewParams = ViewParams()
    look: LookParams = LookParams(exposure=0.001)
    lost: float = 0.0
    """Share of the frames that are lost at random."""
    seconds: float = 0.0
    """Length of the film; 0: as --seconds says."""


CASES = (
    Case('120 px', 120.0, 0.1),
    Case('40 px', 40.0, 0.3),
    Case(
        '40 px, 30 s, 20 % lost, one hidden 0.5 s',
        40.0,
        0.3,
        lost=0.2,
        seconds=30.0,
        look=LookParams(exposure=0.001, occlude=REAR, occlude_from=12.0, occlude_for=0.5),
    ),
    Case('120 px, 30° oblique', 120.0, 0.5, ViewParams(pan_deg=30.0)),
    Case('120 px, 2 px blur', 120.0, 0.5, look=LookParams(exposure=0.001, blur_px=2.0)),
    Case(
        '120 px, 30° oblique, 2 px blur', 120.0, 0.5, ViewParams(pan_deg=30.0), LookParams(exposure=0.001, blur_px=2.0)
    ),
    Case('40 px, 30° oblique', 40.0, 0.5, ViewParams(pan_deg=30.0)),
    Case('40 px, 2 px blur', 40.0, 0.5, look=LookParams(exposure=0.001, blur_px=2.0)),
    Case('40 px, 30° oblique, 2 px blur', 40.0, 0.5, ViewParams(pan_deg=30.0), LookParams(exposure=0.001, blur_px=2.0)),
    Case('20 px', 20.0),
    Case('60 px, 45° oblique, from above', 60.0, view=ViewParams(pan_deg=-45.0, height=2.5)),
    Case('60 px, lens', 60.0, view=ViewParams(k1=-0.25, k2=0.08)),
    Case('60 px, noise of 10', 60.0, look=LookParams(exposure=0.001, noise=10.0)),
    Case('60 px, dark', 60.0, look=LookParams(exposure=0.001, brightness=0.2)),
    Case('60 px, exposure of 8 ms', 60.0, look=LookParams(exposure=0.008)),
    Case(
        '60 px, one hidden half the time',
        60.0,
        look=LookParams(exposure=0.001, occlude=FRONT, occlude_from=1.0, occlude_for=0.5, occlude_every=1.0),
    ),
)


class Truth:
    """What is filmed: frames, and the strikes up to them."""

    def __init__(self, case: Case, seconds: float) -> None:
        self._case, self._seconds = case, case.seconds or seconds
        self._shots = Shots(Simulation(*SimulatorParams().start(RIG)))
        self.strikes: dict[str, list[int]] = {FRONT: [], REAR: []}

    def frames(self) -> Iterator[tuple[JointSample, Picture]]:
        """The frames that are not lost, each with its joints."""
        case, scene, lost = self._case, SceneParams(slope=RIG.slope), random.Random(0)
        camera = case.view.make_camera()
        distance = scene.tag_plane(scene.mounts(TAGS)[0]) + float(camera.matrix[0, 0]) * TAGS.size / case.side
        renderer = Renderer(scene, case.view._replace(distance=distance), case.look, TAGS, camera, False)
        footing: Footing | None = None
        for frame in range(round(self._seconds * RATE)):
            motion, joints = self._shots.at(frame / RATE)
            for wheel, stamp_ns, *_ in self._shots.strikes(motion):
                self.strikes[wheel].append(stamp_ns)
            footing = footing or Footing(scene, joints)
            if lost.random() >= case.lost:
                yield joints, renderer.draw(footing, joints, frame / RATE)


def steps(joints: JointSample) -> int | None:
    """n1 − n2, but for a constant; None where a wheel is about to strike, or just has."""
    numbers = []
    for turn, alpha in ((joints.front, RIG.front.alpha), (joints.rear, RIG.rear.alpha)):
        number = (turn.angle + alpha) / (2.0 * alpha)
        if abs(number - round(number)) * 2.0 * alpha < AT_A_STRIKE:
            return None
        numbers.append(math.floor(number))
    return numbers[0] - numbers[1]


class Score:
    """One detector on one film."""

    def __init__(self, detect: Detect, case: Case) -> None:
        self._detect, self._goal = detect, case.goal
        self._viewer = PairViewer(mounts(TAGS), case.view.make_camera(), RIG.slope)
        self._angles = WheelAngles(TrackParams(slope=RIG.slope, camera_follows=case.view.follow))
        self._estimator = PhaseEstimator(PhaseParams())
        self._errors: list[float] = []
        self._times: list[float] = []
        self._strikes: list[tuple[str, int]] = []
        self._differences: list[int] = []

    def take(self, truth: JointSample, image: Picture) -> None:
        """Track a frame."""
        start = time.process_time()
        joints = self._angles.update(self._viewer.view(truth.stamp_ns, self._detect(image, truth.stamp_ns)))
        update = self._estimator.update(joints) if joints else None
        self._times.append(time.process_time() - start)
        if update is None:
            return
        front, rear = (
            turn.angle / (2.0 * wheel.alpha) for turn, wheel in ((truth.front, RIG.front), (truth.rear, RIG.rear))
        )
        pitch = RIG.front.alpha + RIG.rear.alpha
        self._errors.append(math.degrees(math.remainder(update.phase.phi.angle - (front - rear) * pitch, pitch)))
        self._strikes += [(fall.wheel, fall.stamp_ns) for fall in update.footfalls]
        n = steps(truth)
        if n is not None:
            self._differences.append(update.phase.step_difference - n)

    @property
    def phi(self) -> float:
        """Root mean square error of φ [deg]."""
        return rms(self._errors)

    @property
    def wrong_n(self) -> int:
        """Frames whose n is not that of the truth."""
        return sum(difference != self._differences[0] for difference in self._differences)

    @property
    def lost(self) -> float:
        """Share of the frames in which not both wheels were measured."""
        return 1.0 - len(self._errors) / len(self._times)

    @property
    def milliseconds(self) -> float:
        """Per frame."""
        return 1e3 * float(np.mean(self._times))

    def strikes(self, truth: Truth) -> float:
        """Root mean square error of the strikes' times [ms]."""
        return rms(
            [
                min((stamp_ns - other for other in truth.strikes[wheel]), key=abs) * 1e-6
                for wheel, stamp_ns in self._strikes
            ]
        )

    def missed(self, truth: Truth) -> tuple[bool, ...]:
        """Which goals are missed: of φ, strikes, n, and pace."""
        late = math.isfinite(self._goal) and not self.strikes(truth) <= HALF_A_FRAME
        return not self.phi <= self._goal, late, bool(self.wrong_n), 1e3 / self.milliseconds < FASTEST

    def row(self, truth: Truth, missed: tuple[bool, ...] = (False,) * 4) -> str:
        """The columns, and a mark at each goal that is missed."""
        phi, strikes, n, pace = ('!' if one else ' ' for one in missed)
        return (
            f'{self.phi:7.3f}{phi}{self.strikes(truth):6.2f}{strikes}{self.wrong_n:4}{n}{100.0 * self.lost:6.1f} % '
            f'{self.milliseconds:7.2f} {1e3 / self.milliseconds:5.0f}{pace}'
        )


def track(case: Case, detect: dict[str, Detect], seconds: float) -> tuple[Truth, dict[str, Score]]:
    """Film a case, and track it with every detector."""
    truth, scores = Truth(case, seconds), {name: Score(one, case) for name, one in detect.items()}
    for joints, image in truth.frames():
        for score in scores.values():
            score.take(joints, image)
    return truth, scores


def rms(values: list[float]) -> float:
    """Root mean square; NaN of nothing."""
    return math.sqrt(float(np.mean(np.square(values)))) if values else math.nan


def tracker() -> Detect:
    """The tracker's own."""
    follower = TagFollower(TagDetector(TAGS.family, (0, 1)), (0, 1))
    return lambda image, stamp_ns: follower.follow(image, stamp_ns).detections


def pupil() -> dict[str, Detect]:
    """The reference, where it is installed."""
    try:
        from pupil_apriltags import Detector
    except ImportError:
        return {}
    detector = Detector(f'tag{TAGS.family}')
    detector.tag_families.clear()  # its destructor would damage the heap
    return {
        'pupil': lambda image, _: [Detection(tag.tag_id, tag.corners[::-1] - 0.5) for tag in detector.detect(image)]
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--seconds', type=float, default=5.0, help='length of most films (default: %(default)g)')
    parser.add_argument('--only', default='', metavar='NAME', help='only the films whose name has this in it')
    options = parser.parse_args()
    opencv().setNumThreads(1)
    columns = f'{"φ rms":>7} {"strike":>6} {"n":>4} {"lost":>8} {"ms":>7} {"1/s":>5} '
    print(f'{"":40} {"goal":>4} {columns} {columns} {"times":>5}')
    for case in CASES:
        if options.only not in case.name:
            continue
        truth, scores = track(case, {'mine': tracker(), **pupil()}, options.seconds)
        mine, other = scores['mine'], scores.get('pupil')
        beside = ''
        if other:
            times = other.milliseconds / mine.milliseconds
            beside = f' {other.row(truth)} {times:5.1f}{"!" if times < TIMES else ""}'
        goal = f'{case.goal:4.1f}' if math.isfinite(case.goal) else ''
        print(f'{case.name:40} {goal:4} {mine.row(truth, mine.missed(truth))}{beside}', flush=True)


if __name__ == '__main__':
    main()

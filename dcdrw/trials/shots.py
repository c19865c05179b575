"""Films of a simulated rig: the video, and the truth of every frame and strike beside it."""

import errno
import random
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from dcdrw.files import table_file, write_whole
from dcdrw.suite.parameter_file import given
from dcdrw_msgs_py.camera import write_camera
from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams
from dcdrw_msgs_py.rolling import phase, phi_pitch
from dcdrw_msgs_py.samples import SECOND, CouplerSample, JointSample, Turn
from dcdrw_msgs_py.tagging import TagParams
from dcdrw_msgs_py.yaml_file import yaml_text
from dcdrw_sim.camera.render import LookParams, Renderer
from dcdrw_sim.camera.scene import Footing, SceneParams, ViewParams
from dcdrw_sim.motion.ends import MotionError
from dcdrw_sim.motion.pair import Motion, Simulation
from dcdrw_sim.rig.simulator import SimulatorParams

CODECS = {'.mp4': 'mp4v', '.avi': 'MJPG', '.mkv': 'FFV1'}
TRUTH = ('stamp_ns', 'psi1', 'omega1', 'psi2', 'omega2', 'phi', 'n')
STRIKES = ('wheel', 'stamp_ns', 'x', 'steps')
LEAST_SPACE = 1 << 20
"""A disk with less room [byte] is taken for full where a video turns out truncated."""


class FilmParams(NamedTuple):
    """Everything that makes a film."""

    rig: RigParams = RigParams()
    simulator: SimulatorParams = SimulatorParams()
    scene: SceneParams = SceneParams()
    view: ViewParams = ViewParams()
    look: LookParams = LookParams()
    tags: TagParams = TagParams()


class Files(NamedTuple):
    """What a film consists of."""

    video: Path
    truth: Path
    strikes: Path
    camera: Path
    rig: Path
    stamps: Path

    @classmethod
    def of(cls, video: Path) -> 'Files':
        """The files that stand beside a video."""
        return cls(
            video,
            *(video.with_suffix(end) for end in ('.csv', '.strikes.csv', '.camera.yaml', '.rig.yaml', '.stamps.csv')),
        )


class FilmResult(NamedTuple):
    """What was filmed."""

    frames: int
    """Number of frames in the video."""
    lost: int
    """Those in whose place the one before was repeated."""
    trouble: str
    """Why the motion ended before the film; empty where it did not."""


def film_trial(
    params: FilmParams,
    files: Files,
    count: int,
    fps: float,
    colour: bool = True,
    drop: float = 0.0,
    force: bool = False,
    stopped: Sequence[object] = (),
    report: Callable[[int], None] = lambda frame: None,
) -> FilmResult:
    """Film a simulated trial; the files get their names once the whole film is there.

    Args:
        params: of the rig, its start, and of the camera.
        files: to write; `stamps` only where frames are dropped.
        count: frames to take.
        fps: of them per second.
        colour: or grey.
        drop: frames that are lost at random, by the seed of the image noise [%]; the one before is repeated in the
            place of each, so that the video keeps its own time.
        force: overwrite files.
        stopped: is looked at between frames; once it holds something, the film ends with what there is.
        report: told the number of each frame.

    Raises:
        ValueError: an impossible start, or a kind of video that this OpenCV does not write.
        OSError: a file cannot be written.

    """
    simulation = Simulation(*params.simulator.start(params.rig))
    camera = params.view.make_camera()
    renderer = Renderer(params.scene, params.view, params.look, params.tags, camera, colour)
    with ExitStack() as stack:
        write_camera(stack.enter_context(write_whole(files.camera, force)), camera)
        _write_rig(stack.enter_context(write_whole(files.rig, force)), params)
        truth = stack.enter_context(table_file(files.truth, TRUTH, force))
        strikes = stack.enter_context(table_file(files.strikes, STRIKES, force))
        stamps = stack.enter_context(table_file(files.stamps, TRUTH[:1], force)) if drop else None
        # Last in, first out: where the video fails, the others do not get their names either.
        video = stack.enter_context(writing_video(files.video, fps, (camera.width, camera.height), colour, force))
        lost, footing = random.Random(params.look.image_seed), None
        trouble = ''
        taken: list[int] = []
        shots = Shots(simulation)
        for k in range(count):
            if stopped:
                break
            try:
                motion, joints = shots.at(k / fps)
            except MotionError as error:
                trouble = f'{simulation.time:.3f} s: {error}'
                break
            strikes.add(shots.strikes(motion))
            footing = footing or Footing(params.scene, joints)
            report(k + 1)
            if lost.random() * 100.0 >= drop or not taken:
                picture = renderer.draw(footing, joints, k / fps)
                truth.add([shots.truth(joints)])
                taken.append(joints.stamp_ns)
            video.write(picture)
            if stamps:
                stamps.add([taken[-1:]])
    if not drop:
        files.stamps.unlink(missing_ok=True)  # of a film that this one overwrites
    return FilmResult(video.frames, video.frames - len(taken), trouble)


class Shots:
    """What the simulation is at the instants of the frames."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self._start = simulation.stance_distance
        self._steps = [0, 0]

    def at(self, t: float) -> tuple[Motion, JointSample]:
        """The motion at a time [s], not before the last one.

        Raises:
            MotionError: the motion cannot be followed so far.

        """
        motion = self.simulation.advance_to(t)
        return motion, JointSample(
            round(t * SECOND),
            Turn(motion.rotation1, motion.omega1),
            Turn(motion.rotation2, motion.omega2),
            CouplerSample(motion.length, motion.rate, motion.force),
        )

    def strikes(self, motion: Motion) -> Iterator[tuple[str, int, float, int]]:
        """Rows of the strikes up to a motion since the last one (`STRIKES`)."""
        rig = self.simulation.rig
        for strike in motion.strikes:
            i = strike.wheel - 1
            self._steps[i] += strike.direction
            start, wheel = ((self._start, rig.front), (0.0, rig.rear))[i]
            yield (
                (FRONT, REAR)[i],
                round(strike.t * SECOND),
                start + self._steps[i] * wheel.step_length,
                self._steps[i],
            )

    def truth(self, joints: JointSample) -> tuple[float, ...]:
        """The row of a frame (`TRUTH`), the simulation being there."""
        rig, (n1, n2) = self.simulation.rig, self.simulation.steps
        phi = phase(rig.front, rig.rear, joints.front.angle, joints.rear.angle) * phi_pitch(rig.front, rig.rear)
        return joints.stamp_ns, *joints.front, *joints.rear, phi, n1 - n2


class Video:
    """A video that is being written."""

    def __init__(self, writer: Any) -> None:
        self._writer, self.frames = writer, 0

    def write(self, picture: Any) -> None:
        """Add a frame."""
        self._writer.write(picture)
        self.frames += 1


@contextmanager
def writing_video(path: Path, fps: float, size: tuple[int, int], colour: bool, force: bool = False) -> Iterator[Video]:
    """A video to write frames to; it gets its name once it is known to be whole, which OpenCV does not tell.

    Raises:
        ValueError: the name has an ending that is not written, or this OpenCV does not write it.
        OSError: it could not be written to its end.

    """
    if path.suffix not in CODECS:
        raise ValueError(f'a video must end in {", ".join(CODECS)}, got {path}')
    cv2 = opencv()
    codec = CODECS[path.suffix]
    with write_whole(path, force) as unfinished:
        writer = cv2.VideoWriter(str(unfinished), cv2.VideoWriter_fourcc(*codec), fps, size, colour)
        if not writer.isOpened():
            others = ', '.join(f'{end} ({name})' for end, name in CODECS.items() if end != path.suffix)
            raise ValueError(
                f'this OpenCV ({cv2.__version__}) does not write {codec} into {path}; try another ending, '
                f'{others}, or pip install opencv-python-headless'
            )
        video = Video(writer)
        try:
            yield video
        finally:
            writer.release()
        # The number of frames stands in what is written last.
        reader = cv2.VideoCapture(str(unfinished))
        whole = not video.frames or reader.get(cv2.CAP_PROP_FRAME_COUNT) >= video.frames
        reader.release()
        if not whole:
            full = shutil.disk_usage(path.parent).free < LEAST_SPACE
            raise OSError(errno.ENOSPC if full else errno.EIO, 'no space left on the disk' if full else 'truncated')


def _write_rig(path: Path, params: FilmParams) -> None:
    """Write rig, tags and how the camera stands for every node; derived defaults are left to the nodes."""
    values = {
        **given(params.rig),
        **given(params.tags.resolved(params.scene.hub_height, params.scene.spacing)),
        'camera_follows': params.view.follow,
        'roll_deg': params.view.roll_deg,
    }
    content = {'/**': {'ros__parameters': values}}
    path.write_text(yaml_text(content), encoding='utf-8')

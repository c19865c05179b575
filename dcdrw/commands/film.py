"""`dcdrw film`: a simulated trial as a video, with its ground truth beside it."""

import argparse
import csv
import random
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

from dcdrw.arguments import number, positive
from dcdrw.progress import Progress, interruptible
from dcdrw.suite.parameter_file import add_rig_options, given, read_parameter_file
from dcdrw_msgs_py.camera import write_camera
from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.quantity import Field, Params, build, check, fields, flatten
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams, WheelShape
from dcdrw_msgs_py.samples import SECOND, CouplerSample, JointSample, Turn
from dcdrw_msgs_py.tagging import TagParams
from dcdrw_msgs_py.yaml_file import yaml_text
from dcdrw_sim.camera.render import LookParams, Renderer
from dcdrw_sim.camera.scene import Footing, SceneParams, ViewParams
from dcdrw_sim.model.presets import PRESETS
from dcdrw_sim.motion.ends import MotionError
from dcdrw_sim.motion.pair import Motion, Simulation
from dcdrw_sim.rig.simulator import SimulatorParams

CODECS = {'.mp4': 'mp4v', '.avi': 'MJPG', '.mkv': 'FFV1'}
TRUTH = ('stamp_ns', 'psi1', 'omega1', 'psi2', 'omega2', 'phi', 'n')
STRIKES = ('wheel', 'stamp_ns', 'x', 'steps')

_EPILOG = """\
FILE ends in .mp4 (MPEG-4, small), .avi (Motion JPEG) or .mkv (FFV1, nothing is lost). Beside FILE.mp4 come
  FILE.csv          the truth of each frame: stamp_ns, ψ, ω of both wheels, φ (SI units, radians) and n
  FILE.strikes.csv  each strike: wheel, stamp_ns, the foot's place x down the slope, the wheel's steps after it
  FILE.camera.yaml  the camera, as camera_calibration would write it
  FILE.rig.yaml     the rig, its tags and how the camera stands, as a ROS 2 parameter file
  FILE.stamps.csv   only with --drop: stamp_ns of each frame that is in the video, which then has gaps
A stamp is the middle of the exposure, from the start of the trial on. Ctrl-C ends the film; what was filmed is kept.
"""


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


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = "Render a simulated trial to a video, as a camera on the rig's left sees it."
    parser.epilog = _EPILOG
    parser.add_argument('--out', type=Path, required=True, metavar='FILE.mp4', help='the video; must not exist')
    add_rig_options(parser)
    parser.add_argument(
        '--initial-phase', type=number, metavar='PERCENT', help='phase at the start, percent of a step (default: 21.6)'
    )
    parser.add_argument('--seconds', type=positive, default=30.0, help='length of the film (default: %(default)g)')
    parser.add_argument('--fps', type=positive, default=60.0, help='frames per second (default: %(default)g)')
    parser.add_argument(
        '--drop',
        type=number,
        default=0.0,
        metavar='PERCENT',
        help='frames that are lost at random, by the seed of the image noise (default: none)',
    )
    parser.add_argument('--grey', action='store_true', help='film in grey')
    parser.add_argument('--quiet', action='store_true', help='no live progress')
    for title, params in (('the camera and its tripod', ViewParams), ('the picture', LookParams)):
        group = parser.add_argument_group(title)
        for field in fields(params):
            _add_option(group, field)


def _add_option(group: Any, field: Field) -> None:
    """Add the option of a parameter; what is not given stays as the rig file or the default has it."""
    quantity, option = field.quantity, '--' + field.name.replace('_', '-')
    default = quantity.derived or ('none' if field.default == '' else field.default)
    unit = f' [{quantity.unit.replace("%", "%%")}]' if quantity.unit else ''
    about: dict[str, Any] = {'dest': field.name, 'default': None, 'help': f'{quantity.doc}{unit} (default: {default})'}
    if field.kind is bool:
        group.add_argument(option, action=argparse.BooleanOptionalAction, **about)
    else:
        group.add_argument(
            option,
            type={int: int, float: number, str: str}[field.kind],
            metavar=field.name.rsplit('_', 1)[-1].upper(),
            **about,
        )


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    opencv()
    params = _params(options)
    if not 0.0 <= options.drop < 100.0:
        raise ValueError(f'--drop must be ≥ 0 and < 100 % of the frames, got {options.drop:g}')
    files = Files.of(options.out)
    if files.video.suffix not in CODECS:
        raise ValueError(f'--out must end in {", ".join(CODECS)}, got {files.video}')
    for file in files:
        if file.exists():
            raise ValueError(f'{file} exists already, not overwriting; choose another --out')
    if not files.video.parent.is_dir():
        raise ValueError(f'{files.video.parent} is no folder; make it first, or choose another --out')
    simulation = Simulation(*params.simulator.start(params.rig))
    camera = params.view.make_camera()
    renderer = Renderer(params.scene, params.view, params.look, params.tags, camera, not options.grey)
    with ExitStack() as stack:
        interrupted = stack.enter_context(interruptible())
        video = open_video(files.video, options.fps, (camera.width, camera.height), not options.grey)
        stack.callback(video.release)
        write_camera(files.camera, camera)
        _write_rig(files.rig, params)
        truth = _table(stack, files.truth, TRUTH)
        strikes = _table(stack, files.strikes, STRIKES)
        stamps = _table(stack, files.stamps, TRUTH[:1]) if options.drop else None
        lost, footing = random.Random(params.look.image_seed), None
        count, written, trouble = max(1, round(options.seconds * options.fps)), 0, ''
        progress = Progress(count, options.quiet)
        shots = Shots(simulation)
        for k in range(count):
            if interrupted:
                break
            try:
                motion, joints = shots.at(k / options.fps)
            except MotionError as error:
                trouble = str(error)
                break
            for strike in shots.strikes(motion):
                strikes.writerow(strike)
            footing = footing or Footing(params.scene, joints)
            progress.show(k + 1)
            if lost.random() * 100.0 < options.drop:
                continue
            video.write(renderer.draw(footing, joints, k / options.fps))
            truth.writerow(shots.truth(joints))
            if stamps:
                stamps.writerow((joints.stamp_ns,))
            written += 1
        progress.end()
    end = f'; ended at {shots.simulation.time:.3f} s: {trouble}' if trouble else '; interrupted' if interrupted else ''
    print(
        f'{written} frames, {written / options.fps:.1f} s of video{end}. Written: {files.video}, and beside it '
        f'{", ".join(file.name for file in files[1:] if file.exists())}'
    )
    return 130 if interrupted else 1 if trouble else 0


def _params(options: argparse.Namespace) -> FilmParams:
    """Preset, then rig file, then options."""
    params = FilmParams(PRESETS[options.preset].rig)
    if options.rig:
        params = read_parameter_file(options.rig, params)
    rig, start = params.rig, params.simulator
    if options.initial_phase is not None:
        start = check(start._replace(initial_phase_percent=options.initial_phase), '--initial-phase')
    view, look = _with_options(params.view, options), _with_options(params.look, options)
    front, rear = (WheelShape(wheel.length, wheel.spokes) for wheel in (rig.front, rig.rear))
    scene = params.scene._replace(front=front, rear=rear, S0=rig.S0, slope=rig.slope)
    return params._replace(simulator=start, scene=scene, view=view, look=look)


def _with_options(params: Params, options: argparse.Namespace) -> Params:
    given = {field.name: value for field in fields(type(params)) if (value := getattr(options, field.name)) is not None}
    return build(type(params), flatten(params) | given)


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
        phase = (joints.front.angle / (2.0 * rig.front.alpha) - joints.rear.angle / (2.0 * rig.rear.alpha)) % 1.0
        return joints.stamp_ns, *joints.front, *joints.rear, phase * (rig.front.alpha + rig.rear.alpha), n1 - n2


def open_video(path: Path, fps: float, size: tuple[int, int], colour: bool) -> Any:
    """A cv2.VideoWriter.

    Raises:
        ValueError: the name has an ending that is not written, or this OpenCV does not write it.

    """
    if path.suffix not in CODECS:
        raise ValueError(f'a video must end in {", ".join(CODECS)}, got {path}')
    cv2 = opencv()
    codec = CODECS[path.suffix]
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), fps, size, colour)
    if not video.isOpened():
        path.unlink(missing_ok=True)
        others = ', '.join(f'{end} ({name})' for end, name in CODECS.items() if end != path.suffix)
        raise ValueError(
            f'this OpenCV ({cv2.__version__}) does not write {codec} into {path}; try another ending, '
            f'{others}, or pip install opencv-python-headless'
        )
    return video


def _table(stack: ExitStack, path: Path, columns: tuple[str, ...]) -> Any:
    writer = csv.writer(stack.enter_context(path.open('w', encoding='utf-8', newline='')))
    writer.writerow(columns)
    return writer


def _write_rig(path: Path, params: FilmParams) -> None:
    """Write rig, tags and how the camera stands for every node; derived defaults are left to the nodes."""
    values = {
        **given(params.rig),
        **given(params.tags),
        'camera_follows': params.view.follow,
        'roll_deg': params.view.roll_deg,
    }
    content = {'/**': {'ros__parameters': values}}
    path.write_text(yaml_text(content), encoding='utf-8')

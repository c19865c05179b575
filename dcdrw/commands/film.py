"""`dcdrw film`: a simulated trial as a video, with its ground truth beside it."""

import argparse
from pathlib import Path
from typing import Any

from dcdrw.console import Bar, interrupted_status, interruptible, number, phase_percent, positive
from dcdrw.files import add_force, refuse_existing
from dcdrw.suite.parameter_file import add_rig_options, with_rig_options
from dcdrw.trials.shots import CODECS, Files, FilmParams, film_trial
from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.quantity import Field, Params, build, check, fields, flatten
from dcdrw_msgs_py.rig import WheelShape
from dcdrw_msgs_py.words import counted
from dcdrw_sim.camera.render import LookParams
from dcdrw_sim.camera.scene import ViewParams
from dcdrw_sim.model.presets import PRESETS

_EPILOG = """\
FILE ends in .mp4 (MPEG-4, small), .avi (Motion JPEG) or .mkv (FFV1, nothing is lost). Beside FILE.mp4 come
  FILE.csv          the truth of each frame taken: stamp_ns, ψ, ω of both wheels, φ (SI units, radians) and n
  FILE.strikes.csv  each strike: wheel, stamp_ns, the foot's place x down the slope, the wheel's steps after it
  FILE.camera.yaml  the camera, as camera_calibration would write it
  FILE.rig.yaml     the rig, its tags and how the camera stands, as a ROS 2 parameter file
  FILE.stamps.csv   only with --drop: stamp_ns of each frame; in the place of a lost one the last is repeated
A stamp is the middle of the exposure, from the start of the trial on. Ctrl-C ends the film; what was filmed is kept.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = "Render a simulated trial to a video, as a camera on the rig's left sees it."
    parser.epilog = _EPILOG
    parser.add_argument('--out', type=Path, required=True, metavar='FILE.mp4', help='the video')
    add_force(parser)
    add_rig_options(parser)
    parser.add_argument(
        '--initial-phase',
        type=phase_percent,
        metavar='PERCENT',
        help='phase at the start, percent of a step (default: 21.6)',
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
    refuse_existing(files, options.force)
    if not files.video.parent.is_dir():
        raise ValueError(f'{files.video.parent} is not a folder; make it first, or choose another --out')
    count = max(1, round(options.seconds * options.fps))
    with interruptible() as interrupted, Bar('filming', 'frames', options.quiet) as bar:
        bar.begin(count)
        filmed = film_trial(
            params,
            files,
            count,
            options.fps,
            colour=not options.grey,
            drop=options.drop,
            force=options.force,
            stopped=interrupted,
            report=bar.reach,
        )
    lost = f', {filmed.lost} of them lost' if filmed.lost else ''
    end = f'; ended at {filmed.trouble}' if filmed.trouble else '; interrupted' if interrupted else ''
    print(
        f'{counted(filmed.frames, "frame")}, {filmed.frames / options.fps:.1f} s of video{lost}{end}. '
        f'Written: {files.video}, and beside it {", ".join(file.name for file in files[1:] if file.exists())}'
    )
    return interrupted_status(interrupted) if interrupted else 1 if filmed.trouble else 0


def _params(options: argparse.Namespace) -> FilmParams:
    """Preset, then rig file, then options."""
    params = with_rig_options(options, FilmParams(PRESETS[options.preset].rig))
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

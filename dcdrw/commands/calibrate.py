"""`dcdrw calibrate`: one roll before a standing camera in; the rig file, with what the roll tells, out."""

import argparse
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dcdrw.console import Interrupted, add_json, check_json, tell
from dcdrw.files import add_force, refuse_existing, write_whole
from dcdrw.suite.parameter_file import write_changed
from dcdrw.trials.filmed import TrackedVideo, add_film_arguments
from dcdrw_msgs_py.rig import FRONT, REAR, WheelShape
from dcdrw_msgs_py.tagging import TagGroup
from dcdrw_tracker.node.tag_tracker import Tracked
from dcdrw_tracker.tags.calibration import Calibration, Estimate, WheelCalibration, calibrate
from dcdrw_tracker.tags.view_plane import PlaneAxes
from dcdrw_tracker.tags.wheel_view import PairView, PairViewer

PASSES = 2
"""The views are made once to learn how the wheels' plane lies, and once more by what was learned."""
LENGTH_TOLERANCE = 0.01
"""A length that differs from the configured one by more is worth a word: one of them, or the tags' size, is wrong."""

_EPILOG = """\
Let the pair roll past a camera that stands still, four steps of each wheel at least, and film it. The hubs' paths tell
which way is downhill in the picture (roll_deg), the step lengths, hence ℓ (front.length, rear.length), and where each
wheel has its zero and its hub (front.angles_deg, x, y, and the rear's). OUT.yaml is RIG.yaml with these in place; it
serves `dcdrw track`, every node and `dcdrw trial` alike. Lengths are in the measure of the tags: size must be right.

Calibrate again when a tag has been glued anew, and when the camera has been put up anew; else a level on the camera
does as well. Exit status: 0 calibrated, 2 wrong input or a roll that tells nothing, 130 interrupted.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'From a video of one roll to a rig file.'
    parser.epilog = _EPILOG
    add_film_arguments(parser)
    parser.add_argument('--out', type=Path, required=True, metavar='OUT.yaml', help='the rig file')
    add_json(parser)
    add_force(parser)
    parser.add_argument(
        '--learn-slope',
        action='store_true',
        help='the camera is level as roll_deg says: learn the slope instead of roll_deg',
    )


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    refuse_existing([options.out], options.force)
    check_json(options)
    film = TrackedVideo(options)
    frames = [tracked for _, tracked in film.track()]
    if film.interrupted:
        raise Interrupted(film.interrupted[0])
    film.check()
    track = film.params.track
    views, axes = _views(film, frames)
    try:
        found = calibrate(views, track.front, track.rear)
    except ValueError as error:
        raise ValueError(f'{film.path}: {error}') from None
    changes = dict(_changes(film, found, axes, options.learn_slope))
    lines = list(_lines(film, found, changes))
    with write_whole(options.out, options.force) as path:
        write_changed(options.rig, changes, path, f'Calibrated by dcdrw calibrate from {film.path.name}.')
    tell(options, [*lines, f'Written: {options.out}'], {'parameters': changes, 'calibration': found})
    return 0


def _views(film: TrackedVideo, frames: Sequence[Tracked]) -> tuple[list[PairView], PlaneAxes]:
    view, slope = film.params.view, film.params.track.slope
    viewer = PairViewer(film.tracker.mounts.values(), film.camera, slope, view)
    for _ in range(PASSES):
        views = [viewer.view(tracked.view.stamp_ns, tracked.detections) for tracked in frames]
    return views, viewer.plane.axes(math.radians(view.roll_deg))


def _changes(film: TrackedVideo, found: Calibration, axes: PlaneAxes, learn_slope: bool) -> Iterator[tuple[str, Any]]:
    """The parameters that the calibration changes, by name."""
    tags, _, track, _ = film.params
    if learn_slope:
        yield 'slope', round(track.slope + found.turn.value, 6)
    else:
        yield 'roll_deg', round(math.degrees(found.roll(axes)), 4)
    yield 'camera_follows', False
    for name, wheel, group in ((FRONT, found.front, tags.front), (REAR, found.rear, tags.rear)):
        yield f'{name}.length', round(wheel.length.value, 5)
        there = moved(group, wheel)
        for key, values in (('angles_deg', there.angles_deg), ('x', there.x), ('y', there.y)):
            yield f'{name}.{key}', [round(value, 5) for value in values]


def moved(group: TagGroup, wheel: WheelCalibration) -> TagGroup:
    """The tags of a wheel where they are, by its calibration: turned about the hub, and shifted with it."""
    zero = wheel.zero.value
    # Along the slope + 1j along its normal, ψ turns clockwise.
    places = (np.array(group.x) + 1j * np.array(group.y)) * np.exp(1j * zero) + complex(
        wheel.tag_x.value, wheel.tag_y.value
    )
    return group._replace(
        angles_deg=tuple(angle - math.degrees(zero) for angle in group.angles_deg),
        x=tuple(places.real.tolist()),
        y=tuple(places.imag.tolist()),
    )


class _Line(NamedTuple):
    """One line of what is told."""

    what: str
    before: float
    now: float
    spread: float
    unit: str


def _lines(film: TrackedVideo, found: Calibration, changes: dict[str, Any]) -> Iterator[str]:
    """What was found beside what was configured."""
    tags, view, track, _ = film.params
    lines = []
    if 'slope' in changes:
        lines.append(_degrees('slope', track.slope, changes['slope'], found.turn))
    else:
        lines.append(_degrees('roll_deg', math.radians(view.roll_deg), math.radians(changes['roll_deg']), found.turn))
    wheels: tuple[tuple[str, WheelCalibration, WheelShape, TagGroup], ...] = (
        (FRONT, found.front, track.front, tags.front),
        (REAR, found.rear, track.rear, tags.rear),
    )
    for name, wheel, shape, group in wheels:
        step = 2.0 * math.sin(shape.alpha)
        lines += [
            _Line(
                f'{name}: step length σ',
                1e3 * shape.step_length,
                1e3 * step * wheel.length.value,
                1e3 * step * wheel.length.spread,
                'mm',
            ),
            _Line(f'{name}.length', 1e3 * shape.length, 1e3 * wheel.length.value, 1e3 * wheel.length.spread, 'mm'),
        ]
        for i, tag in enumerate(group.ids):
            for key, spread, scale, unit in (
                ('angles_deg', math.degrees(wheel.zero.spread), 1.0, '°'),
                ('x', 1e3 * wheel.tag_x.spread, 1e3, 'mm'),
                ('y', 1e3 * wheel.tag_y.spread, 1e3, 'mm'),
            ):
                lines.append(
                    _Line(
                        f'{name}.{key}, tag {tag}',
                        scale * getattr(group, key)[i],
                        scale * changes[f'{name}.{key}'][i],
                        spread,
                        unit,
                    )
                )
    yield f'{"":24} {"configured":>12} {"found":>12}'
    for line in lines:
        yield f'{line.what:24} {line.before:12.3f} {line.now:12.3f} ± {line.spread:.3f} {line.unit}'
    yield (
        f'From {found.front.steps} steps of the front wheel and {found.rear.steps} of the rear one; their hubs are '
        f'{1e3 * found.front.misfit:.1f} and {1e3 * found.rear.misfit:.1f} mm off the path of a rolling wheel, '
        'root mean square.'
    )
    for name, wheel, shape, _ in wheels:
        ratio = wheel.length.value / shape.length
        if abs(ratio - 1.0) > LENGTH_TOLERANCE:
            yield (
                f'{name}.length is {100.0 * (ratio - 1.0):+.1f} % off what was configured: measure it, or the tags, '
                f'whose size should be {1e3 * tags.size / ratio:.1f} mm then'
            )


def _degrees(what: str, before: float, now: float, found: Estimate) -> _Line:
    return _Line(what, math.degrees(before), math.degrees(now), math.degrees(found.spread), '°')

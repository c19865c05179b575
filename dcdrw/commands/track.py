"""`dcdrw track`: a video of the rig in; the same results as a live trial's out, faster than it was filmed."""

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from dcdrw.console import Interrupted, add_json, check_json, interrupted_status, tell, tell_where
from dcdrw.drawings.figure_files import add_formats
from dcdrw.files import add_force, free_folder, refuse_existing
from dcdrw.recordings.bag_folder import RECORDING
from dcdrw.recordings.joint_recording import record_joints
from dcdrw.suite.parameter_file import TrialParams, read_parameter_file
from dcdrw.trials.analysis import Analysis, analyze
from dcdrw.trials.expectation import add_expect, expectation_status
from dcdrw.trials.filmed import TrackedVideo, add_film_arguments, debug_video, joint_batches, quality, write_frames
from dcdrw.trials.results import result, sample_file, write_results
from dcdrw.trials.summary import summarize
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.words import counted
from dcdrw_tracker.node.tag_tracker import Tracked

_EPILOG = """\
RIG.yaml is a ROS 2 parameter file, the same that tag_tracker reads: the wheels, the tags on them, slope, and how the
camera stands (roll_deg, camera_follows, detector). `dcdrw calibrate` writes one.

The time stamps are the video's own, unless --stamps or --frame-rate gives others; a file VIDEO.stamps.csv beside the
video, as `dcdrw film --drop` writes it, is used by itself. DIR gets summary.json, trial.png, samples.csv,
footfalls.csv and a recording (for ros2 bag, dcdrw replay, analyze and report), as from `dcdrw trial`, and
  frames.csv   each frame: stamp_ns; run, ψ and ω of both wheels (SI units, radians) where both were measured; of each
               wheel tags seen, reprojection error, and the hub's place x downhill and y along the slope's normal
Ctrl-C ends the tracking and keeps what was tracked. Exit status: 0 judged by all that was filmed, 1 the verdict
rests on less or there is none (the sentence says why), or the video is truncated (what came before is kept), 2 wrong
input, 3 it did not end as --expect says, 130 interrupted.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'From a video of the rig to joint states, phase, summary and picture.'
    parser.epilog = _EPILOG
    add_film_arguments(parser)
    parser.add_argument(
        '--out',
        type=Path,
        metavar='DIR',
        help='where to write; must not exist, or be empty (default: trials/DATE-TIME)',
    )
    parser.add_argument(
        '--debug',
        type=Path,
        metavar='FILE.mp4',
        help='make a video with tags, hubs, spokes and stance legs drawn in',
    )
    add_formats(parser)
    add_json(parser)
    add_expect(parser)
    add_force(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    folder = free_folder(options.out)
    check_json(options)
    refuse_existing([options.debug] if options.debug else [], options.force)
    film = TrackedVideo(options)
    trial_params = TrialParams()
    if options.rig:
        trial_params = read_parameter_file(options.rig, trial_params)
    with ExitStack() as stack:
        debug = stack.enter_context(debug_video(options.debug, film, options.force)) if options.debug else None
        frames: list[Tracked] = []
        for frame, tracked in film.track():
            frames.append(tracked)
            if debug:
                debug(frame, tracked)
    samples = [tracked.sample for tracked in frames if tracked.sample]
    if film.interrupted and not samples:
        raise Interrupted(film.interrupted[0])
    film.check()
    with sample_file(folder, options.force) as table:
        trial = analyze(joint_batches(samples, trial_params.phase), trial_params, [table])
    write_frames(frames, folder / 'frames.csv')
    try:
        rig, _, phase, sync = trial_params
        record_joints(
            folder / RECORDING, samples, phase, (rig, phase, sync, *film.params), {'note': f'tracked in {film.path}'}
        )
    except ValueError as error:
        print(f'dcdrw track: {error}', file=sys.stderr)
    return _finish(film, frames, trial, folder, options)


def _finish(
    film: TrackedVideo, frames: Sequence[Tracked], trial: Analysis, folder: Path, options: argparse.Namespace
) -> int:
    """Tell and write what came of it."""
    told = quality(film, frames)
    missing = f'; {counted(told["frames_missing"], "frame")} missing' if told['frames_missing'] else ''
    tags = '; '.join(
        f'{name}: tags of {told[name]["tag_size_px"]:.0f} px, {told[name]["reprojection_error_px"]:.2f} px off, '
        f'{counted(sum(told[name]["outliers"].values()), "outlier")}'
        for name in (FRONT, REAR)
    )
    both = f'{told["frames_with_both_wheels"]} of {told["frames"]} frames show both wheels{missing}. {tags}'
    end = 'interrupted' if film.interrupted else film.complaint or 'complete'
    more = {'end': end, 'video': str(film.path), 'tracking': told}
    summary = summarize(trial)
    tell(options, [summary.sentence, both], result(trial, more))
    for line in _warnings(told):
        print(f'dcdrw track: {line}', file=sys.stderr)
    try:
        write_results(trial, folder, more, formats=options.formats)
    except ValueError as error:
        print(f'dcdrw track: no picture: {error}', file=sys.stderr)
    tell_where(options, f'Written: {folder}/')
    if ends := '; '.join(filter(None, ['interrupted' if film.interrupted else '', film.complaint])):
        print(f'dcdrw track: {ends}; what came before is kept', file=sys.stderr)
    if film.interrupted:
        return interrupted_status(film.interrupted)
    whole = summary.complete and not film.complaint
    return expectation_status(options.expect, [trial.state]) if whole else 1


def _warnings(told: dict[str, Any]) -> Iterator[str]:
    if told['times_the_turns_were_lost']:
        yield (
            f'the number of turns was lost {counted(told["times_the_turns_were_lost"], "time")}; '
            'each time, steps are counted afresh'
        )
    if told['frames_with_duplicate_tags']:
        yield (
            f'in {counted(told["frames_with_duplicate_tags"], "frame")} a tag of the rig is in the picture twice: '
            'take the other one away'
        )
    for name in (FRONT, REAR):
        if not told[name]['hub_travels_as_it_rolls']:
            yield (
                f'the hub of the {name} wheel does not travel as the wheel rolls: see camera_follows, slope and '
                f'{name}.length in --rig'
            )

"""A film of the rig: the wheels tracked in it, from its frames to joint states."""

import argparse
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dcdrw.console import Bar, interruptible, number, positive
from dcdrw.files import write_csv
from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.suite.parameter_file import read_parameter_file
from dcdrw.trials.shots import Files, writing_video
from dcdrw_msgs_py.camera import Camera, read_camera
from dcdrw_msgs_py.columns import check_pace
from dcdrw_msgs_py.frame import Frame
from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import SECOND, JointSample
from dcdrw_msgs_py.tagging import TagParams
from dcdrw_msgs_py.text_file import read_rows
from dcdrw_msgs_py.words import counted
from dcdrw_tracker.gait.phase import PhaseParams
from dcdrw_tracker.node.debug_image import draw
from dcdrw_tracker.node.tag_tracker import TagTracker, Tracked
from dcdrw_tracker.node.tracker_source import SourceParams
from dcdrw_tracker.node.video import VideoFile
from dcdrw_tracker.tags.wheel_view import PairViewParams, WheelView
from dcdrw_tracker.wheels.wheel_track import TrackParams

LATEST = 2**63
"""No stamp is so late [ns]."""
AHEAD = 4
"""Frames that are decoded while others are tracked."""
FRAMES = (
    'stamp_ns',
    'run',
    'psi1',
    'omega1',
    'psi2',
    'omega2',
    *(f'{name}{wheel}' for wheel in (1, 2) for name in ('tags', 'error_px', 'x', 'y')),
)
"""Columns of frames.csv."""


class TrackingParams(NamedTuple):
    """The parameters of tag_tracker, as far as a video concerns them."""

    tags: TagParams = TagParams()
    view: PairViewParams = PairViewParams()
    track: TrackParams = TrackParams()
    source: SourceParams = SourceParams()


def add_film_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that choose a `TrackedVideo`."""
    parser.add_argument('video', type=Path, metavar='VIDEO')
    parser.add_argument(
        '--camera',
        type=Path,
        required=True,
        metavar='CAMERA.yaml',
        help='camera_info file of the camera that filmed, as camera_calibration writes it',
    )
    parser.add_argument('--rig', type=Path, metavar='RIG.yaml', help='what differs from the defaults')
    parser.add_argument(
        '--stamps',
        type=Path,
        metavar='FILE.csv',
        help='a line with the time stamp in ns for each frame, after a heading; the same again: a frame repeated',
    )
    parser.add_argument('--frame-rate', type=positive, metavar='HZ', help='of the camera, in the place of time stamps')
    parser.add_argument(
        '--from',
        dest='start',
        type=number,
        default=0.0,
        metavar='SECONDS',
        help='of the video, from which on it counts (default: %(default)g)',
    )
    parser.add_argument(
        '--to',
        dest='end',
        type=number,
        default=math.inf,
        metavar='SECONDS',
        help='of the video, up to which it counts (default: its end)',
    )
    parser.add_argument('--quiet', action='store_true', help='no live progress')


class TrackedVideo:
    """A video, the camera that filmed it, and the tracker that is to follow the wheels in it.

    Raises:
        ValueError: OpenCV is missing, or an argument, or what is in a file, is impossible.
        OSError: a file cannot be read.

    """

    def __init__(self, options: argparse.Namespace) -> None:
        opencv()
        self.camera: Camera = read_camera(options.camera)
        self.params = TrackingParams()
        if options.rig:
            self.params = read_parameter_file(options.rig, self.params)
        tags, view, track, source = self.params
        if not 0.0 <= options.start < options.end:
            raise ValueError(f'--from must be ≥ 0 s and less than --to, got {options.start:g} and {options.end:g}')
        self._span = options.start, options.end
        self._quiet = options.quiet
        self._stamps = self._read_stamps(options)
        rate = options.frame_rate or (1.0 if self._stamps else source.frame_rate)  # stamps take the place of a rate
        self.path: Path = options.video
        self.video = VideoFile(self.path, rate)
        self.tracker = TagTracker(tags, view, track, source.detector)
        self.tracker.look_through(self.camera)
        self.interrupted: list[int] = []
        """The signals that ended it early."""
        self.complaint = ''
        """What is wrong with the video, once it has been tracked to its end."""

    def track(self) -> Iterator[tuple[Frame, Tracked]]:
        """Every frame with what it brought; Ctrl-C ends it early.

        Raises:
            ValueError: the frames are not of the camera's size, or nothing tells when they were taken.

        """
        first_ns: int | None = None
        with interruptible() as self.interrupted, Bar('tracking', 'frames', self._quiet) as bar:
            bar.begin(self.video.count or None)
            for frame in _read_ahead(self._frames()):
                first_ns = frame.stamp_ns if first_ns is None else first_ns
                start, end = (first_ns + seconds * SECOND for seconds in self._span)
                if frame.stamp_ns > end or self.interrupted:
                    break
                bar.reach(self.video.read)
                if frame.stamp_ns >= start:
                    yield frame, self._process(frame)
            else:
                self.complaint = self.video.complaint

    def check(self) -> None:
        """Refuse a film that did not show both wheels.

        Raises:
            ValueError: it did not; what was looked for is told.

        """
        status, tags = self.tracker.status(), self.params.tags
        if not status.angles.views:
            where = ' between --from and --to' if self.video.read else ''
            raise ValueError(self.complaint or f'{self.path}: there is no frame{where}')
        frames = f'{self.path}: in {counted(status.angles.views, "frame")}'
        looked = f'of family {tags.family} (family, front.ids and rear.ids in --rig)'
        if not (status.front.frames or status.rear.frames):
            front, rear = (', '.join(map(str, ids)) for ids in status.ids)
            raise ValueError(f'{frames} no tag was seen; looked for {front} (front) and {rear} (rear) {looked}')
        for wheel, quality, ids in zip((FRONT, REAR), (status.front, status.rear), status.ids, strict=True):
            if not quality.frames:
                raise ValueError(
                    f'{frames} the {wheel} wheel was never seen; looked for tag {", ".join(map(str, ids))} {looked}'
                )
        if not status.angles.samples:
            raise ValueError(f'{frames} the wheels were never tracked together')

    def _process(self, frame: Frame) -> Tracked:
        try:
            return self.tracker.process(frame)
        except ValueError as error:
            raise ValueError(f'{self.path}: {error}') from None

    def _frames(self) -> Iterator[Frame]:
        stamp: int | None = None
        for index, frame in enumerate(self.video.frames()):
            if not self._stamps:
                yield frame
            elif index >= len(self._stamps):
                raise ValueError(f'{self.path} has more frames than there are time stamps: {len(self._stamps)}')
            elif self._stamps[index] != stamp:  # else the last frame, repeated in the place of one that was lost
                stamp = self._stamps[index]
                yield frame._replace(stamp_ns=stamp)

    def _read_stamps(self, options: argparse.Namespace) -> list[int]:
        beside = Files.of(options.video).stamps
        path = options.stamps or (beside if beside.exists() and not options.frame_rate else None)
        if path is None:
            return []
        stamps = []
        for place, (line, (cell, *_)) in enumerate(read_rows(path)):
            try:
                stamps.append(int(cell))
            except ValueError:
                if place:  # else the heading
                    raise ValueError(f'{path}, line {line}: {cell!r} is not a time stamp in ns') from None
        if not stamps or min(np.diff(stamps), default=0) < 0 or not -LATEST < stamps[0] <= stamps[-1] < LATEST:
            raise ValueError(f'{path}: the time stamps must grow from line to line')
        check_pace(path, np.unique(stamps) / SECOND, 'Stamps are in ns')
        return stamps


def _read_ahead(frames: Iterator[Frame]) -> Iterator[Frame]:
    """The same frames, decoded in a thread while others are worked on: OpenCV leaves Python alone meanwhile."""
    with ThreadPoolExecutor(1) as decoder:
        pending = deque(decoder.submit(next, frames, None) for _ in range(AHEAD))
        while (frame := pending.popleft().result()) is not None:
            pending.append(decoder.submit(next, frames, None))
            yield frame


def joint_batches(samples: Iterable[JointSample], names: PhaseParams) -> Iterator[JointBatch]:
    """Samples as the joint states that a tag tracker publishes."""
    for run, group in groupby(samples, lambda sample: sample.run):
        part = list(group)
        turns = np.array([(sample.front, sample.rear) for sample in part])
        yield JointBatch(
            '',
            (names.front_joint, names.rear_joint),
            np.array([sample.stamp_ns for sample in part], np.int64),
            turns[:, :, 0],
            turns[:, :, 1],
            np.full(turns.shape[:2], math.nan),
            run=np.full(len(part), run, np.int64),
        )


@contextmanager
def debug_video(path: Path, film: TrackedVideo, force: bool = False) -> Iterator[Callable[[Frame, Tracked], None]]:
    """What writes a frame with what was made of it drawn in.

    Raises:
        ValueError, OSError: as `writing_video`.

    """
    size, wheels = (film.camera.width, film.camera.height), (film.params.track.front, film.params.track.rear)
    with writing_video(path, film.video.own_rate or 30.0, size, True, force) as video:
        yield lambda frame, tracked: video.write(draw(frame.image, tracked, film.tracker.mounts, film.camera, wheels))


def write_frames(frames: Sequence[Tracked], path: Path) -> None:
    """Write a row for each frame (`FRAMES`)."""
    write_csv(path, FRAMES, (_row(tracked) for tracked in frames))


def _row(tracked: Tracked) -> tuple[Any, ...]:
    sample, view = tracked.sample, tracked.view
    turns = (sample.run, *sample.front, *sample.rear) if sample else [''] * 5
    return view.stamp_ns, *turns, *_columns(view.front), *_columns(view.rear)


def _columns(view: WheelView | None) -> tuple[Any, ...]:
    return (view.tags, view.error_px, *view.hub) if view else (0, '', '', '')


def quality(film: TrackedVideo, frames: Sequence[Tracked]) -> dict[str, Any]:
    """How well the wheels were tracked, for a program."""
    status = film.tracker.status()
    angles = status.angles

    def wheel(name: str) -> dict[str, Any]:
        views = [view for tracked in frames if (view := getattr(tracked.view, name))]
        track = getattr(angles, name)
        return {
            'frames': len(views),
            'reprojection_error_px': round(math.sqrt(np.mean([view.error_px**2 for view in views])), 4),
            'tag_size_px': round(float(np.mean([view.size_px for view in views])), 1),
            'tags_per_frame': round(float(np.mean([view.tags for view in views])), 2),
            'outliers': track.outliers,
            'waited_for_others': track.unconfirmed,
            'occlusions_of_more_than_a_step_restored': track.restored,
            'hub_travels_as_it_rolls': track.travels,
        }

    return {
        'frames': angles.views,
        'frames_with_both_wheels': angles.samples,
        'frame_rate_hz': round(angles.cadence.rate, 3) if math.isfinite(angles.cadence.rate) else None,
        'frames_missing': angles.cadence.lost,
        'longest_gap_s': round(angles.cadence.longest, 6),
        'frames_out_of_order': angles.out_of_order,
        'frames_with_duplicate_tags': status.duplicates,
        'tags_refused': status.refused_tags,
        'times_the_turns_were_lost': angles.lost,
        FRONT: wheel(FRONT),
        REAR: wheel(REAR),
    }

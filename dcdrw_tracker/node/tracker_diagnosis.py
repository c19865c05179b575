"""What the tag tracker's snapshots mean to a person. Pure functions; `/diagnostics` carries the result."""

import math
from typing import NamedTuple

from dcdrw_msgs_py.diagnosis import AGE, GAPS, LONGEST_GAP, LOST_SAMPLES, RATE_IN, Diagnosis, Level, Value
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_tracker.node.tag_tracker import TrackerStatus, WheelQuality
from dcdrw_tracker.wheels.wheel_angles import AnglesStatus

STALE_AFTER = 1.0
"""Age of the last frame from which the source is stale, and of a wheel's last view from which it is not seen [s]."""
MANY = 0.1
"""Share of the frames that may be passed over without a warning."""


class SourceStatus(NamedTuple):
    """How the frames come."""

    age: float
    """Since the last frame that was tracked came, by a steady clock [s]; infinite where none did."""
    problem: str = ''
    """What is wrong with the source or its frames now; empty where nothing is."""
    waiting: str = ''
    """What to say while no frame has come."""
    dropped: int = 0
    """Frames that came and went while another was worked on."""
    dropped_share: float = 0.0
    """Their share since the last report."""
    unusable: int = 0
    """Frames, or poses, that could not be used."""
    seconds: float = math.nan
    """Time that a frame takes, of late [s]."""


def diagnose_tags(status: TrackerStatus, source: SourceStatus) -> Diagnosis:
    """The diagnosis of a tracker that has a camera."""
    level, message = _judge_source(source) or _judge_tags(status) or _judge_angles(status.angles, source)
    return Diagnosis(
        level,
        message,
        {
            **_quality(status, FRONT, status.front),
            **_quality(status, REAR, status.rear),
            'frames with duplicate tags': status.duplicates,
            'tags refused: no fit': status.refused_tags,
            **_angles(status.angles),
            **_source(source),
        },
    )


def diagnose_poses(status: AnglesStatus, source: SourceStatus) -> Diagnosis:
    """The diagnosis of a tracker that is given poses."""
    level, message = _judge_source(source) or _judge_angles(status, source)
    return Diagnosis(level, message, {**_angles(status), **_source(source)})


def _judge_source(source: SourceStatus) -> tuple[Level, str] | None:
    if source.problem:
        return Level.ERROR, source.problem
    if math.isinf(source.age):
        return Level.STALE, source.waiting
    if not source.age <= STALE_AFTER:
        return Level.STALE, source.waiting or 'stale: no frames'
    return None


def _judge_tags(status: TrackerStatus) -> tuple[Level, str] | None:
    if status.duplicate_ns and _lately(status, status.duplicate_ns):
        return Level.WARN, f'tag {status.duplicate} is in the picture twice: take the other one away'
    (front, rear), qualities = status.ids, (status.front, status.rear)
    here = [bool(quality.frames) and _lately(status, quality.seen_ns) for quality in qualities]
    if not any(here):
        return Level.WARN, f'no tag is seen; looking for {_ids(front + rear)} (parameters front.ids, rear.ids, family)'
    for seen, quality, wheel, ids in zip(here, qualities, ('front', 'rear'), status.ids, strict=True):
        if not seen:
            never = 'is not seen any more' if quality.frames else 'has never been seen'
            return Level.WARN, f'the {wheel} wheel {never}; looking for {_ids(ids)} (parameter {wheel}.ids)'
    return None


def _lately(status: TrackerStatus, stamp_ns: int) -> bool:
    return status.stamp_ns - stamp_ns <= STALE_AFTER * 1e9


def _judge_angles(status: AnglesStatus, source: SourceStatus) -> tuple[Level, str]:
    for wheel, track in (('front', status.front), ('rear', status.rear)):
        if not track.taken:
            return Level.WARN, f'the {wheel} wheel is not tracked yet'
        if not track.travels:
            return Level.WARN, (
                f'the hub of the {wheel} wheel does not travel as the wheel rolls: see the parameters '
                f'camera_follows and {wheel}.length'
            )
    if source.dropped_share > MANY:
        return Level.WARN, 'tracking both wheels, but frames come faster than they are worked on'
    return Level.OK, 'tracking both wheels'


def _quality(status: TrackerStatus, wheel: str, quality: WheelQuality) -> dict[str, Value]:
    """How one wheel's tags were seen last."""
    seen = quality.frames > 0
    return {
        f'tags of the {wheel} wheel seen': quality.tags if seen and quality.seen_ns == status.stamp_ns else 0,
        f'reprojection error of the {wheel} wheel [px]': quality.error_px if seen else math.nan,
        f'size of the tags of the {wheel} wheel [px]': quality.size_px if seen else math.nan,
    }


def _angles(status: AnglesStatus) -> dict[str, Value]:
    cadence, wheels = status.cadence, ((FRONT, status.front), (REAR, status.rear))
    return {
        'frames': status.views,
        'frames with both wheels': status.samples,
        RATE_IN: cadence.rate,
        GAPS: cadence.gaps,
        LOST_SAMPLES: cadence.lost,
        LONGEST_GAP: cadence.longest,
        'frames out of order': status.out_of_order,
        **{
            f'outliers of the {wheel} wheel: {why}': count
            for wheel, track in wheels
            for why, count in track.outliers.items()
        },
        **{f'views of the {wheel} wheel that waited for others': track.unconfirmed for wheel, track in wheels},
        **{f'occlusions of the {wheel} wheel of more than a step restored': track.restored for wheel, track in wheels},
        'times the turns were lost': status.lost,
    }


def _source(source: SourceStatus) -> dict[str, Value]:
    return {
        'frames passed over while busy': source.dropped,
        'frames of no use': source.unusable,
        'processing time [ms]': 1e3 * source.seconds,
        AGE: source.age,
    }


def _ids(ids: tuple[int, ...]) -> str:
    return f'tag{"s" if len(ids) > 1 else ""} {", ".join(map(str, ids))}'

"""When joint states were sampled: by their stamps, and where these tell no time, when they were recorded. No ROS."""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw.recordings.joint_batch import JointBatch
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.values import Floats
from dcdrw_tracker.gait.phase import PhaseParams
from dcdrw_tracker.gait.rotation import LEAST_PACE

SPAN_NS = 3 * SECOND
"""Stamps are judged over so much of the recording at a time, or more."""
WINDOW_NS = SECOND // 4
"""And within it over so much: a part of a second that is missing does not show from second to second."""
FEWEST = 4
"""So many windows in which a wheel turns tell enough."""
FASTER = 100.0
"""Stamps that pass so many times as fast as the recording are in another unit."""
STANDING = 0.4
"""Stamps are too coarse where this share of them is that of the sample before."""
LARGEST_PART_NS = 2**32
"""Stamps that begin anew within this lack their seconds."""

Times = NDArray[np.int64]


class _Verdict(NamedTuple):
    """What the stamps of a source are worth."""

    is_none: bool
    """They tell no time."""
    pace: float
    """How many times as fast as the recording they pass; NaN where that is not known."""


_UNKNOWN = _Verdict(False, math.nan)


def dated(batches: Iterable[JointBatch], joints: PhaseParams) -> Iterator[JointBatch]:
    """The same batches, with the time of recording in the place of stamps that tell none.

    Those are in another unit, lack a part, stand still, or are zero. The wheels tell which clock is right: by the other
    one they turn as none does. Where both clocks are possible, the stamps are the truth, as of a trial that is
    replayed or simulated at another pace.

    Args:
        batches: as they were recorded; those of which it is not known when stay as they are.
        joints: the names of the wheels, the unit of their rotations, and how fast they can turn.

    """
    waiting: list[JointBatch] = []
    known: dict[tuple[str, ...], _Verdict] = {}
    first_ns = 0
    for batch in batches:
        if not len(batch.log_ns):
            yield from _dated(waiting, joints, known)
            waiting = []
            yield batch
            continue
        if not waiting:
            first_ns = int(batch.log_ns[0])
        waiting.append(batch)
        if int(batch.log_ns[-1]) - first_ns >= SPAN_NS:
            yield from _dated(waiting, joints, known)
            waiting = []
    yield from _dated(waiting, joints, known)


def _dated(
    batches: list[JointBatch], joints: PhaseParams, known: dict[tuple[str, ...], _Verdict]
) -> Iterator[JointBatch]:
    """Batches of one span; `known` is what was found of each source, and is kept up."""
    sources: dict[tuple[str, ...], list[JointBatch]] = {}
    for batch in batches:
        if not batch.error and {joints.front_joint, joints.rear_joint} & set(batch.names):
            sources.setdefault(batch.names, []).append(batch)
    unset: set[tuple[str, ...]] = set()
    for names, alike in sources.items():
        wheels = [names.index(name) for name in (joints.front_joint, joints.rear_joint) if name in names]
        stamp_ns, log_ns = (np.concatenate([getattr(one, time) for one in alike]) for time in ('stamp_ns', 'log_ns'))
        turns = np.concatenate([one.position[:, wheels] for one in alike]) * abs(joints.scales[0])
        known[names] = _judged(stamp_ns, log_ns, turns, joints.max_speed) or known.get(names, _UNKNOWN)
        zero = stamp_ns == 0
        if np.count_nonzero(zero) > 1 and np.ptp(turns[zero], axis=0).any():
            unset.add(names)
    for batch in batches:
        if batch.names not in sources or batch.error:
            yield batch
            continue
        is_none, pace = known[batch.names]
        none = np.full(batch.messages, is_none) | ((batch.stamp_ns == 0) & (batch.names in unset))
        yield batch._replace(
            stamp_ns=np.where(none, batch.log_ns, batch.stamp_ns), unstamped=int(np.count_nonzero(none)), pace=pace
        )


def _judged(stamp_ns: Times, log_ns: Times, turns: Floats, fastest: float) -> _Verdict | None:
    """What stamps are worth while wheels turn [rad]; None where these turn too little to tell."""
    log_ns = np.maximum.accumulate(log_ns)
    edges = np.unique(np.searchsorted(log_ns, np.arange(log_ns[0], log_ns[-1] + 1, WINDOW_NS)))
    recorded, passed = (np.diff(times[edges]) / SECOND for times in (log_ns, stamp_ns))
    passed = np.maximum(np.abs(passed), 1.0 / SECOND)
    turned = np.abs(np.diff(turns[edges], axis=0)).max(axis=1, initial=0.0)
    moving = turned > LEAST_PACE * recorded
    if np.count_nonzero(moving) < FEWEST:
        return None
    recorded, passed, turned = recorded[moving], passed[moving], turned[moving]
    paces = passed / recorded
    pace = float(np.median(paces))
    near = (paces > 0.2 * pace) & (paces < 5.0 * pace)  # no clock was set there, nor did the recorder pause
    passes = _Verdict(False, float(passed[near].sum() / recorded[near].sum()))
    if np.median(turned / recorded) > fastest:  # a simulation that goes as fast as it can
        return passes
    goes_on = (np.diff(turns, axis=0) != 0.0).any(axis=1)
    stands = np.count_nonzero(goes_on & (np.diff(stamp_ns) == 0)) > STANDING * np.count_nonzero(goes_on)
    reach = int(np.ptp(stamp_ns))
    wraps = reach < min(LARGEST_PART_NS, 0.5 * pace * int(log_ns[-1] - log_ns[0]))
    is_none = stands or wraps or pace >= FASTER or np.median(turned / passed) > fastest
    return _Verdict(True, math.nan) if is_none else passes

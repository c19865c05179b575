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
STILL_NS = SECOND // 10
"""Stamps that stand still for so long, while the wheels turn, are carried on by the time of recording."""
MOST_STILL = 2
"""Stamps that do so more often in a span are coarse ones."""
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
    carried: dict[tuple[str, ...], Times] = {}
    for names, alike in sources.items():
        wheels = [names.index(name) for name in (joints.front_joint, joints.rear_joint) if name in names]
        stamp_ns, log_ns = (np.concatenate([getattr(one, time) for one in alike]) for time in ('stamp_ns', 'log_ns'))
        turns = np.concatenate([one.position[:, wheels] for one in alike]) * abs(joints.scales[0])
        carried[names] = _carried_on(stamp_ns, log_ns, turns)
        known[names] = _judged(carried[names], log_ns, turns, joints.max_speed) or known.get(names, _UNKNOWN)
        zero = stamp_ns == 0
        if np.count_nonzero(zero) > 1 and np.ptp(turns[zero], axis=0).any():
            unset.add(names)
    for batch in batches:
        if batch.names not in sources or batch.error:
            yield batch
            continue
        is_none, pace = known[batch.names]
        none = np.full(batch.messages, is_none) | ((batch.stamp_ns == 0) & (batch.names in unset))
        stamp_ns, carried[batch.names] = np.split(carried[batch.names], [batch.messages])
        stamp_ns = np.where(none, batch.log_ns, stamp_ns)
        yield batch._replace(
            stamp_ns=stamp_ns, unstamped=int(np.count_nonzero(none | (stamp_ns != batch.stamp_ns))), pace=pace
        )


def _carried_on(stamp_ns: Times, log_ns: Times, turns: Floats) -> Times:
    """Stamps, of which those that stand still while the wheels turn [rad] go on as the recording did."""
    times: Times = stamp_ns.copy()
    begins = np.flatnonzero(np.diff(stamp_ns, prepend=stamp_ns[0] - 1))
    ends = np.append(begins[1:], len(stamp_ns))
    still = np.column_stack([begins, ends])[log_ns[ends - 1] - log_ns[begins] >= STILL_NS]
    if len(still) > MOST_STILL:
        return times
    for begin, end in still:
        if stamp_ns[begin] and end - begin < len(stamp_ns) and np.ptp(turns[begin:end], axis=0).any():
            known = end if end < len(stamp_ns) else begin
            frozen = slice(begin + 1 if begin else begin, end)
            times[frozen] = stamp_ns[known] + log_ns[frozen] - log_ns[known]
    return times


def _judged(stamp_ns: Times, log_ns: Times, turns: Floats, fastest: float) -> _Verdict | None:
    """What stamps are worth while wheels turn [rad]; None where these turn too little to tell."""
    log_ns = np.maximum.accumulate(log_ns)
    edges = np.flatnonzero(np.diff((log_ns - log_ns[0]) // WINDOW_NS, prepend=-1))
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
    begins_anew = int(np.diff(stamp_ns).min()) < -reach // 2
    went_on_ns = int(np.minimum(np.diff(log_ns), SECOND).sum())  # a pause of the recorder tells nothing
    wraps = begins_anew and reach < min(LARGEST_PART_NS, 0.5 * pace * went_on_ns)
    is_none = stands or wraps or pace >= FASTER or np.median(turned / passed) > fastest
    return _Verdict(True, math.nan) if is_none else passes

"""Stamps are the truth where they tell time; where they tell none, the time of recording is."""

from collections.abc import Callable

import numpy as np
import pytest

from dcdrw.recordings.dating import Times, dated
from dcdrw.recordings.joint_batch import JointBatch
from dcdrw_msgs_py.samples import SECOND
from dcdrw_tracker.gait.phase import PhaseParams
from tests.tracker.walking import walk
from tests.trials import batch

JOINTS = PhaseParams()
WALK = batch(walk(10.0, 50.0).samples())
SINCE = WALK.stamp_ns - WALK.stamp_ns[0]
EPOCH = 1_700_000_000 * SECOND + SINCE
SECONDS, PARTS = np.divmod(EPOCH, SECOND)

NONE: dict[str, Times] = {
    'microseconds as nanoseconds': EPOCH // 1000,
    'microseconds in the place of the nanoseconds': SECONDS * SECOND + PARTS // 1000,
    'milliseconds in the place of the nanoseconds': SECONDS * SECOND + PARTS // 1_000_000,
    'whole seconds': SECONDS * SECOND,
    'tenths of a second': EPOCH // 100_000_000 * 100_000_000,
    'no seconds': PARTS,
    'nanoseconds of 32 bits': EPOCH % 2**32,
    'milliseconds as seconds': SINCE * 1000,
    'nanoseconds as seconds, of 32 bits': (SINCE + 5000 * SECOND).astype(np.int32).astype(np.int64) * SECOND,
    'one stamp for all': np.full_like(EPOCH, SECOND),
    'zero': np.zeros_like(EPOCH),
}


def _held_up(log: Times) -> Times:
    """Times at which a recorder writes that gets the processor seldom: it first catches up, then waits for each."""
    behind = np.maximum(4 * SECOND - SINCE * 4, 0)
    return log[0] + np.maximum.accumulate(SINCE + behind)


TIMES: dict[str, Callable[[Times], tuple[Times, Times]]] = {
    'another epoch': lambda log: (SINCE, log),
    'twice as fast': lambda log: (2 * SINCE, log),
    'half as fast': lambda log: (SINCE // 2, log),
    'milliseconds': lambda log: (EPOCH // 1_000_000 * 1_000_000, log),
    'a clock that is set': lambda log: (np.where(SINCE > 5 * SECOND, EPOCH - 37 * SECOND, EPOCH), log),
    'a simulation as fast as it can': lambda log: (EPOCH, log[0] + SINCE // 300),
    'a recorder that pauses': lambda log: (EPOCH, -(-log // SECOND) * SECOND),
    'a recorder that is held up': lambda log: (EPOCH, _held_up(log)),
    'a recorder whose clock ran off once': lambda log: (EPOCH, np.where(SINCE == 0, log, log + 2**61)),
    'a recorder that knows no time': lambda log: (EPOCH, np.zeros_like(log)),
}


def whole(batches: list[JointBatch]) -> tuple[Times, int]:
    """All stamps, and how many are those of the recording."""
    found = list(dated(batches, JOINTS))
    return np.concatenate([one.stamp_ns for one in found]), sum(one.unstamped for one in found)


@pytest.mark.parametrize('stamps', NONE.values(), ids=NONE)
def test_stamps_that_tell_no_time_give_way_to_the_time_of_recording(stamps: Times) -> None:
    times, unstamped = whole([WALK._replace(stamp_ns=stamps, log_ns=EPOCH)])
    assert times.tolist() == EPOCH.tolist()
    assert unstamped == len(EPOCH)


@pytest.mark.parametrize('first', [0, 100, 130])
@pytest.mark.parametrize('last', [180, 320, len(EPOCH)])
def test_stamps_that_stand_still_for_a_while_go_on_by_the_time_of_recording(first: int, last: int) -> None:
    stamps = EPOCH.copy()
    stamps[first:last] = EPOCH[last if first == 0 and last < len(EPOCH) else first]
    times, unstamped = whole([WALK._replace(stamp_ns=stamps, log_ns=EPOCH + 7)])
    assert np.abs(times - EPOCH).max() <= 7
    assert unstamped == np.count_nonzero(times != stamps)
    assert last - first - 1 <= unstamped <= last - first


@pytest.mark.parametrize('clocks', TIMES.values(), ids=TIMES)
def test_stamps_that_tell_time_are_the_truth(clocks: Callable[[Times], tuple[Times, Times]]) -> None:
    stamps, log = clocks(EPOCH)
    times, unstamped = whole([WALK._replace(stamp_ns=stamps, log_ns=log)])
    assert (times.tolist(), unstamped) == (stamps.tolist(), 0)


def test_wheels_that_are_held_tell_nothing_of_stamps() -> None:
    held = WALK._replace(position=np.ones_like(WALK.position), stamp_ns=np.zeros_like(EPOCH), log_ns=EPOCH)
    assert whole([held])[1] == 0


def test_each_source_on_a_topic_has_a_clock_of_its_own() -> None:
    """Small batches are judged together, and handed on in their order."""
    parts = [slice(begin, begin + 5) for begin in range(0, len(EPOCH), 5)]
    front, rear = (
        [
            JointBatch('', (name,), stamps[part], *(table[part, :1] for table in WALK[3:6]), log_ns=EPOCH[part])
            for part in parts
        ]
        for name, stamps in ((JOINTS.front_joint, EPOCH), (JOINTS.rear_joint, EPOCH // 1000))
    )
    found = list(dated([one for pair in zip(front, rear, strict=True) for one in pair], JOINTS))
    assert [one.names[0] for one in found[:2]] == [JOINTS.front_joint, JOINTS.rear_joint]
    assert all((one.stamp_ns == one.log_ns).all() for one in found)
    assert {(one.names[0], one.unstamped) for one in found} == {(JOINTS.front_joint, 0), (JOINTS.rear_joint, 5)}


def test_what_stamps_were_worth_holds_while_the_wheels_tell_nothing() -> None:
    micros = WALK._replace(stamp_ns=EPOCH // 1000, log_ns=EPOCH)
    later = EPOCH + 10 * SECOND
    still = WALK._replace(position=np.ones_like(WALK.position), stamp_ns=later // 1000, log_ns=later)
    assert whole([micros, still])[1] == 2 * len(EPOCH)

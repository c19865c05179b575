"""What is kept of a long motion shows all that a picture would show of the whole."""

import tracemalloc

import numpy as np
import pytest

from dcdrw.trials.course import Course
from dcdrw.trials.motion import MOST_ROWS, MotionTable, Thinned, Whole
from dcdrw_msgs_py.samples import SECOND, Footfall

PERIOD_NS = 1_000_000


def columns(rows: np.ndarray, gap_ns: int = 0, gap_at: int = -1) -> list[np.ndarray]:
    """Rows of a motion at 1 kHz with a step every half second, and one gap."""
    stamp_ns = SECOND + PERIOD_NS * rows + np.where(rows >= gap_at, gap_ns, 0)
    turning = np.modf(rows / 500)[0] - 0.5
    zeros = np.zeros(len(rows), np.int64)
    floats = dict.fromkeys(('theta1', 'theta2', 'phi'), turning)
    made = []
    for name in MotionTable._fields[:-2]:
        if name == 'stamp_ns':
            made.append(stamp_ns)
        elif name in ('step_difference', 'restarts'):
            made.append(zeros)
        elif name == 'synchronized':
            made.append(zeros.astype(bool))
        else:
            made.append(floats.get(name, np.full(len(rows), np.nan)))
    return made


def course(count: int, **gap: int) -> tuple[Course, MotionTable]:
    whole = Whole()
    made = Course([whole])
    for begin in range(0, count, 4000):
        made.add(columns(np.arange(begin, min(begin + 4000, count)), **gap))
    assert made.motion is not None
    return made, whole.motion


def test_a_motion_of_usual_length_is_kept_as_it_is():
    made, whole = course(30_000)
    assert all((one == other).all() for one, other in zip(made.motion[:1], whole[:1], strict=True))
    assert (made.motion.row == np.arange(30_000)).all()
    assert made.samples == 30_000
    assert made.gaps == 0


@pytest.mark.parametrize('count', [50_000, 400_000])
def test_of_a_long_one_no_peak_and_no_gap_is_lost(count):
    gap_at, gap_ns = count // 2 + 17, SECOND
    made, whole = course(count, gap_ns=gap_ns, gap_at=gap_at)
    kept = made.motion
    assert MOST_ROWS // 8 < len(kept.row) <= MOST_ROWS
    assert kept.stamp_ns[[0, -1]].tolist() == whole.stamp_ns[[0, -1]].tolist()
    # Each step, a tooth of the saw, still runs from its least to its greatest angle.
    steps = kept.row // 500
    for step in np.unique(steps):
        tooth = kept.phi[steps == step]
        assert (tooth.min(), tooth.max()) == (-0.5, pytest.approx(0.498))
    assert kept.row[kept.gaps].tolist() == [gap_at]
    assert kept.row[kept.gaps - 1].tolist() == [gap_at - 1]
    assert (made.gaps, made.longest_gaps[0].seconds) == (1, 1.001)


def test_a_footfall_within_a_gap_was_not_seen():
    made = Course([])
    made.footfalls += [Footfall('front', SECOND + 5 * PERIOD_NS + 1, 0.0), Footfall('front', SECOND + SECOND, 1.0)]
    made.add(columns(np.arange(1000), gap_ns=SECOND, gap_at=500))
    assert made.motion.stamp_ns[-1] > 2 * SECOND
    assert made.unseen == {made.footfalls[1]}


def test_what_came_before_the_wheels_were_let_go_is_no_part_of_the_trial():
    whole = Whole()
    made = Course([whole])
    made.add(columns(np.arange(5000)))
    made.begin(made.rows - 1)
    made.add(columns(np.arange(5000, 9000)))
    assert made.motion.row.tolist() == list(range(4001))
    assert whole.motion.stamp_ns[0] == made.start_ns == SECOND + 4999 * PERIOD_NS
    assert made.samples == 4001


def test_memory_does_not_grow_with_the_length():
    peaks = []
    for parts in (40, 160):
        tracemalloc.start()
        kept = Thinned()
        for part in range(parts):
            rows = np.arange(part * 4000, part * 4000 + 4000)
            kept.take(MotionTable._make([*columns(rows), rows, np.zeros(4000, np.int64)]))
        assert len(kept.motion.row) <= MOST_ROWS
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]

import math

import pytest

from dcdrw_tracker.gait.cadence import LOOKS, Cadence

MS = 1_000_000


def tick(stamps_ms: list[int]) -> Cadence:
    cadence = Cadence()
    for stamp in stamps_ms:
        cadence.tick(stamp * MS)
    return cadence


def test_the_rate_is_learned_from_the_stamps() -> None:
    assert tick(list(range(0, 500, 5))).status().rate == pytest.approx(200.0)
    assert math.isnan(tick([3]).status().rate)


def test_gaps_are_counted_and_the_lost_samples_told() -> None:
    status = tick([0, 5, 10, 15, 25, 30, 35, 65, 70]).status()
    assert (status.gaps, status.lost) == (2, 6)
    assert status.longest == pytest.approx(0.030)


def test_lost_samples_do_not_spoil_the_period() -> None:
    assert tick([5 * sample for sample in range(400) if sample % 4]).status().rate == pytest.approx(200.0)


def test_jitter_is_no_gap() -> None:
    assert tick([10 * sample + (sample % 3) for sample in range(300)]).status().gaps == 0


def test_a_source_that_slows_down_makes_gaps_only_until_it_is_known() -> None:
    cadence = tick([*range(0, 100, 5), *range(100, 2000, 20)])
    assert cadence.status().rate == pytest.approx(50.0)
    assert cadence.status().gaps <= LOOKS[-1]


def test_a_jump_of_the_source_is_no_gap() -> None:
    cadence = tick(list(range(0, 100, 5)))
    cadence.jump(5000 * MS)
    cadence.tick(5005 * MS)
    assert cadence.status().gaps == 0

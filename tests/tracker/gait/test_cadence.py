import math
import random
from itertools import accumulate

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dcdrw_tracker.gait.cadence import Cadence

MS = 1_000_000


def tick(stamps_ms: list[float]) -> Cadence:
    cadence = Cadence()
    for stamp in stamps_ms:
        cadence.tick(round(stamp * MS))
    return cadence


def bursts(count: int, size: int, every: float, apart: float = 0.1) -> list[float]:
    """Stamps [ms] of samples that arrive `size` at a time."""
    return [every * (sample // size) + apart * (sample % size) for sample in range(count)]


def test_the_rate_is_learned_from_the_stamps() -> None:
    assert tick(list(range(0, 500, 5))).status().rate == pytest.approx(200.0)
    assert math.isnan(tick([3]).status().rate)


def test_gaps_are_counted_and_the_lost_samples_told() -> None:
    status = tick([0, 5, 10, 15, 25, 30, 35, 65, 70]).status()
    assert (status.gaps, status.lost) == (2, 6)
    assert status.longest == pytest.approx(0.030)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.0, 0.3))
def test_every_sample_lost_at_random_is_counted(seed: int, share: float) -> None:
    kept = [True] + [random.Random(seed * 4001 + sample).random() >= share for sample in range(1, 3999)] + [True]
    status = tick([5.0 * sample for sample, here in enumerate(kept) if here]).status()
    assert status.rate == pytest.approx(200.0)
    assert status.lost == kept.count(False)


@pytest.mark.parametrize('lost', [0, 3])
@pytest.mark.parametrize('pause', [100.0, 300.0, 2000.0])
@pytest.mark.parametrize('every', [1.0, 5.0, 16.0])
def test_samples_that_wait_for_the_end_of_a_pause_are_not_lost(every: float, pause: float, lost: int) -> None:
    """A driver that is kept waiting stamps what had come meanwhile one right after the other; some may be dropped."""
    stamps: list[float] = []
    for sample in range(round(20e3 / every)):
        at = every * sample
        for begin in (5000.0, 9000.0):
            if begin < at < begin + pause:
                at = begin + pause
        stamps.append(max(at, stamps[-1] + 0.02 if stamps else 0.0))
    first = next(place for place, stamp in enumerate(stamps) if stamp >= 5000.0 + pause)
    del stamps[first : first + lost]
    status = tick(stamps).status()
    assert (status.gaps, status.lost) == (lost > 0, lost)
    assert status.rate == pytest.approx(1e3 / every, rel=0.01)


def test_jitter_is_no_gap() -> None:
    assert tick([10 * sample + (sample % 3) for sample in range(300)]).status().gaps == 0


@pytest.mark.parametrize('before', [30, 233, 1000])
@pytest.mark.parametrize('rates', [(200.0, 50.0), (50.0, 1000.0), (200.0, 100.0, 200.0), (1000.0, 10.0)])
def test_another_rate_is_no_gap(rates: tuple[float, ...], before: int) -> None:
    stamps = [0.0]
    for rate in rates:
        stamps += [stamps[-1] + 1000.0 / rate * sample for sample in range(1, before)]
    status = tick(stamps).status()
    assert (status.gaps, status.lost) == (0, 0)
    assert status.rate == pytest.approx(rates[-1])


def test_what_is_lost_before_and_after_another_rate_is_counted() -> None:
    slow = [2000.0 + 20.0 * sample for sample in range(200) if sample != 100]
    status = tick([*(5.0 * sample for sample in range(400) if sample not in (390, 391)), *slow]).status()
    assert (status.gaps, status.lost) == (2, 3)


@pytest.mark.parametrize('pattern', [(5, 15), (5, 5, 10), (5, 5, 5, 5, 10), (4, 11, 6, 12), (15, 16, 16, 31)])
def test_intervals_that_make_up_for_one_another_are_no_gaps(pattern: tuple[int, ...]) -> None:
    intervals = pattern * (1000 // len(pattern))
    stamps = [float(stamp) for stamp in accumulate(intervals, initial=0)]
    status = tick(stamps).status()
    assert (status.gaps, status.lost) == (0, 0)
    assert status.rate == pytest.approx(1000.0 * len(intervals) / sum(intervals), rel=0.02)
    status = tick([stamp for stamp in stamps if not 2000.0 < stamp < 2300.0]).status()
    assert (status.gaps, status.longest) == (1, pytest.approx(0.3, abs=0.03))


def test_stamps_by_a_clock_that_ticks_coarsely_are_no_gaps() -> None:
    status = tick([15.625 * (20 * sample // 15.625) for sample in range(1300)]).status()
    assert (status.gaps, status.lost) == (0, 0)
    assert status.rate == pytest.approx(50.0, rel=0.01)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32), st.booleans())
def test_intervals_as_it_happens_are_no_gaps(seed: int, on_time: bool) -> None:
    """Half as long again or half as long, each by itself or by when it should end."""
    jitter = random.Random(seed)
    late = [jitter.uniform(-5.0, 5.0) for _ in range(1000)]
    stamps = [10.0 * sample + (late[sample] if on_time else sum(late[:sample])) for sample in range(1000)]
    status = tick(stamps).status()
    assert (status.gaps, status.lost) == (0, 0)
    assert status.rate == pytest.approx(100.0, rel=0.1)


def test_a_jump_of_the_source_is_no_gap() -> None:
    cadence = tick(list(range(0, 100, 5)))
    cadence.jump(5000 * MS)
    cadence.tick(5005 * MS)
    assert cadence.status().gaps == 0


@settings(max_examples=30, deadline=None)
@given(st.integers(2, 16), st.integers(0, 200), st.floats(0.005, 0.05))
def test_bursts_are_no_gaps(size: int, more: int, apart: float) -> None:
    cadence = tick(bursts(400 + more, size, 5.0 * size, apart))
    assert (cadence.status().gaps, cadence.status().lost, cadence.burst) == (0, 0, size)
    assert cadence.status().rate == pytest.approx(200.0)
    assert cadence.period_ns == 5 * MS


@settings(max_examples=20, deadline=None)
@given(st.integers(2, 8), st.integers(20, 60), st.integers(1, 5))
def test_bursts_that_are_lost_are_counted(size: int, first: int, count: int) -> None:
    stamps = bursts(100 * size, size, 20.0)
    status = tick(stamps[: first * size] + stamps[(first + count) * size :]).status()
    assert (status.gaps, status.lost) == (1, count * size)


def test_bursts_of_various_sizes_are_no_gaps() -> None:
    """Samples at 200 Hz, fetched every 16 ms, give or take 4."""
    jitter, stamps, fetched = random.Random(1), list[float](), 0
    for fetch in range(1, 600):
        at = 16.0 * fetch + jitter.uniform(-4.0, 4.0)
        fresh = range(fetched, int(at / 5.0) + 1)
        stamps += [at + 0.05 * place for place in range(len(fresh))]
        fetched += len(fresh)
    status = tick(stamps).status()
    assert status.rate == pytest.approx(200.0, rel=0.1)
    assert status.lost < 0.01 * len(stamps)


def test_a_source_that_loses_most_of_its_samples_is_no_source_of_bursts() -> None:
    kept = [sample for sample in range(20_000) if sample < 200 or sample % 100 < 10]
    status = tick([float(sample) for sample in kept]).status()
    assert status.rate == pytest.approx(1000.0)
    assert status.lost == kept[-1] + 1 - len(kept)


def flushed(count: int, largest: int, seed: int) -> list[float]:
    """Stamps [ms] of samples at 200 Hz that arrive together with however many came before, up to `largest`."""
    random_size, stamps, sample = random.Random(seed), list[float](), 0
    while sample < count:
        size = random_size.randint(1, largest)
        sample += size
        stamps += [5.0 * sample + 0.02 * place for place in range(size)]
    return stamps


@settings(max_examples=30, deadline=None)
@given(st.integers(2, 10), st.integers(0, 2**32))
def test_bursts_of_random_sizes_are_no_gaps(largest: int, seed: int) -> None:
    status = tick(flushed(3000, largest, seed)).status()
    assert status.rate == pytest.approx(200.0, rel=0.1)
    assert status.lost < 30


def test_what_is_lost_between_bursts_of_random_sizes_is_counted() -> None:
    stamps = flushed(3000, 6, 1)
    status = tick([stamp for stamp in stamps if not 5000.0 < stamp < 6000.0]).status()
    assert 180 < status.lost < 220


@pytest.mark.parametrize('size', [16, 50, 64, 200])
@pytest.mark.parametrize('lost', [0, 10])
def test_long_bursts_are_told_from_losses(size: int, lost: int) -> None:
    stamps = bursts(100 * size, size, 5.0 * size)
    kept = [stamp for place, stamp in enumerate(stamps) if not lost or place // size % lost != 7]
    status = tick(kept).status()
    assert status.lost == len(stamps) - len(kept)

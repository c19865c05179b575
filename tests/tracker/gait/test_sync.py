import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dcdrw_msgs_py.samples import PhaseSample, SyncSample, Turn
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams
from dcdrw_tracker.gait.sync import SyncMonitor, SyncParams
from tests.tracker.walking import ALPHA, PITCH, START_NS, STEP, keep, rotation, walk

SECOND = 1_000_000_000
PARAMS = SyncParams()


def phases(
    seconds: float, p0: float = 0.216, p1: float = 0.5, settle: float = 2.0, noise_deg: float = 0.0
) -> list[PhaseSample]:
    """A trial as the monitor sees it."""
    estimator = PhaseEstimator(PhaseParams())
    samples = keep(walk(seconds, 200.0, p0, p1, settle).samples(noise_deg), 0.05 if noise_deg else 0.0)
    return [update.phase for update in map(estimator.update, samples) if update]


def shift(samples: list[PhaseSample], ns: int, restarts: int = 0) -> list[PhaseSample]:
    return [sample._replace(stamp_ns=sample.stamp_ns + ns, restarts=restarts) for sample in samples]


def run(samples: list[PhaseSample], params: SyncParams = PARAMS) -> tuple[SyncMonitor, list[SyncSample]]:
    monitor = SyncMonitor(params)
    return monitor, [sync for sync in map(monitor.update, samples) if sync]


IN_STEP = 0.5 - float(rotation(np.array([STEP / 2]))[0]) / PITCH
"""The phase at a strike of the front wheel of a pair that is in step."""
SETTLED = phases(20.0)
LENGTH = SETTLED[-1].stamp_ns - START_NS + 5_000_000
"""From the first stamp of `SETTLED` to where the next sample would be [ns]."""


def test_the_error_is_the_phase_from_half_a_step() -> None:
    truth = walk(5.0)
    _, syncs = run(phases(5.0))
    assert [sync.error_percent for sync in syncs] == pytest.approx((100 * truth.phase() - 50).tolist(), abs=1e-6)
    assert [sync.error for sync in syncs] == pytest.approx(((truth.phase() - 0.5) * PITCH).tolist(), abs=1e-9)
    assert all(-ALPHA <= sync.error < ALPHA for sync in syncs)


def test_steps_to_synchronization_end_at_the_first_strike_within_the_band_for_good() -> None:
    monitor, syncs = run(SETTLED)
    status = monitor.status()
    outside = max(index for index, sync in enumerate(syncs) if abs(sync.error_percent) > 6.0)
    steps_before = math.floor((syncs[outside].stamp_ns - START_NS) * 1e-9 / STEP)
    assert status.steps_to_synchronization == steps_before + 1
    assert status.initial_phase == pytest.approx(0.216)
    assert (status.steps, status.slips, status.losses, status.stalled) == (int(20.0 / STEP), 0, 0, ())


def test_synchronized_comes_with_the_hold_steps_and_not_before() -> None:
    monitor, syncs = run(SETTLED)
    first = next(sync for sync in syncs if sync.synchronized)
    steps = math.floor((first.stamp_ns - START_NS) * 1e-9 / STEP)
    assert steps == (monitor.status().steps_to_synchronization or 0) + SyncParams().hold_steps - 1
    assert all(sync.synchronized for sync in syncs if sync.stamp_ns > first.stamp_ns)


def test_a_pair_in_step_from_the_start_took_no_steps() -> None:
    assert run(phases(5.0, p0=IN_STEP))[0].status().steps_to_synchronization == 0


def test_noise_does_not_unlatch_synchronized() -> None:
    monitor, _ = run(phases(30.0, noise_deg=0.2))
    assert monitor.status().synchronized
    assert monitor.status().losses == 0


def test_noise_is_not_taken_for_wild_samples() -> None:
    """Of 6,000 samples some lie far from where noise has them on average."""
    monitor, syncs = run(phases(30.0, p0=0.5, noise_deg=0.3))
    assert monitor.status().strays == 0
    told = [sync.synchronized for sync in syncs]
    assert sum(one != other for one, other in pairwise(told)) == 1


def test_a_pair_that_settles_outside_the_band_is_never_synchronized() -> None:
    monitor, syncs = run(phases(20.0, p1=0.4))
    assert not any(sync.synchronized for sync in syncs)
    assert monitor.status().steps_to_synchronization is None
    assert run(phases(20.0, p1=0.4), SyncParams(band_percent=15.0))[0].status().synchronized


def test_leaving_the_band_loses_synchronization() -> None:
    monitor = SyncMonitor(SyncParams())
    turning = phases(20.0, IN_STEP, 0.9, settle=2.0)
    seen = [(sync.synchronized, sync.error_percent) for sync in map(monitor.update, turning) if sync]
    # The pair is in step at once, but drifts away too soon to hold.
    assert not any(synchronized for synchronized, _ in seen)
    monitor = SyncMonitor(SyncParams(hold_steps=1, band_percent=6.0))
    drifting = filter(None, map(monitor.update, phases(20.0, IN_STEP, 0.9, 8.0)))
    assert max(sync.error_percent for sync in drifting if sync.synchronized) == pytest.approx(6.0, abs=0.3)
    status = monitor.status()
    assert (status.synchronized, status.lost, status.steps_to_synchronization) == (False, True, None)
    assert status.losses > 0


@pytest.mark.parametrize('hysteresis', [0.0, 1.0, 40.0])
def test_without_noise_the_hysteresis_changes_nothing(hysteresis: float) -> None:
    params = SyncParams(hold_steps=1, band_hysteresis_percent=hysteresis)
    drifting = phases(20.0, IN_STEP, 0.9, 8.0)
    plain = run(drifting, params._replace(band_hysteresis_percent=0.0))[1]
    assert run(drifting, params)[1] == plain


def test_noise_may_carry_the_error_beyond_the_band_by_the_hysteresis_and_no_further() -> None:
    monitor = SyncMonitor(SyncParams(hold_steps=1))
    drifting = [sync for sync in map(monitor.update, phases(20.0, IN_STEP, 0.9, 8.0, noise_deg=0.3)) if sync]
    left = next(now for last, now in pairwise(drifting) if last.synchronized and not now.synchronized)
    assert left.error_percent == pytest.approx(7.0, abs=1.5)
    assert monitor.status().losses > 0


def test_errors_at_strikes_are_interpolated() -> None:
    truth = walk(10.0, 100_000.0)
    history = run(phases(10.0))[0].status().history
    expected = np.interp(truth.front_strikes, truth.time, 100 * truth.phase() - 50)
    assert history == pytest.approx(expected.tolist(), abs=5e-3)


@pytest.mark.parametrize('noise_deg', [0.0, 0.2])
def test_the_contraction_is_that_of_the_phase(noise_deg: float) -> None:
    monitor, _ = run(phases(20.0, p0=0.15, settle=2.0, noise_deg=noise_deg))
    assert monitor.status().contraction == pytest.approx(math.exp(-STEP / 2.0), abs=0.01 if not noise_deg else 0.06)


def test_the_swing_is_that_of_the_last_whole_step() -> None:
    monitor, syncs = run(SETTLED)
    low, high = monitor.status().swing_percent
    assert low <= high
    tail = [sync.error_percent for sync in syncs if sync.stamp_ns > START_NS + 18 * SECOND]
    assert min(tail) - 0.1 <= low <= high <= max(tail) + 0.1


@settings(max_examples=10, deadline=None)
@given(st.floats(0.05, 0.95), st.integers(-(10**17), 10**17))
def test_a_common_time_shift_changes_nothing(p0: float, ns: int) -> None:
    samples = phases(4.0, p0)
    one, other = run(samples)[0].status(), run(shift(samples, ns))[0].status()
    assert other == one._replace(stamp_ns=one.stamp_ns + ns) or math.isnan(one.contraction)
    assert other.history == one.history


# --- trouble -------------------------------------------------------------------------------------------------------


def test_a_wheel_that_strikes_twice_in_a_row_has_slipped_a_step() -> None:
    monitor, _ = run(phases(20.0, p0=0.216, p1=1.4, settle=3.0))
    assert monitor.status().slips == 1
    assert not monitor.status().slipped
    assert run(SETTLED)[0].status().slips == 0


@pytest.mark.parametrize('wheel', ['front', 'rear'])
def test_a_wheel_without_strikes_has_stalled_and_is_not_synchronized(wheel: str) -> None:
    monitor, _ = run(SETTLED)
    assert monitor.status().synchronized
    last = SETTLED[-1]
    stands = {wheel: Turn(-ALPHA, 0.0)}
    seen = []
    for i in range(400):  # the other one rocks
        rocking = {'rear' if wheel == 'front' else 'front': Turn(0.1 * math.sin(0.1 * i), math.cos(0.1 * i))}
        seen.append(monitor.update(last._replace(stamp_ns=last.stamp_ns + (i + 1) * 10_000_000, **stands, **rocking)))
    status = monitor.status()
    assert (status.stalled, status.held, status.synchronized) == (('front', 'rear'), False, False)
    assert not seen[-1].synchronized


def test_a_pair_that_is_held_is_not_stalled_and_goes_on_where_it_was() -> None:
    half = len(SETTLED) // 2
    before, after = SETTLED[:half], shift(SETTLED[half:], 20 * SECOND)
    monitor, syncs = run(before)
    assert syncs[-1].synchronized
    last = before[-1]
    still = last._replace(front=Turn(last.front.angle, 0.0), rear=Turn(last.rear.angle, 0.0))
    held = [monitor.update(still._replace(stamp_ns=last.stamp_ns + i * 10_000_000)) for i in range(1, 2001)]
    status = monitor.status()
    assert (status.held, status.stalled, status.lost, status.slips) == (True, (), False, 0)
    assert not held[-1].synchronized  # it does not walk
    for phase in after:
        monitor.update(phase)
        assert monitor.status().stalled == ()
    plain, _ = run(SETTLED)
    one, other = monitor.status(), plain.status()
    assert one.history == pytest.approx(other.history, abs=1e-3)
    aside = other._asdict() | {'stamp_ns': 0, 'cadence': None, 'history': (), 'contraction': 0.0}
    assert one._replace(stamp_ns=0, cadence=None, history=(), contraction=0.0)._asdict() == aside


@pytest.mark.parametrize(
    ('pause_ns', 'restarts'),
    [
        pytest.param(-20 * SECOND, 0, id='a recording loops'),
        pytest.param(-20 * SECOND, 1, id='a recording loops, and the estimator says so'),
        pytest.param(0, 1, id='the simulator is reset'),
        pytest.param(3 * SECOND, 0, id='the estimator is killed and started again'),
        pytest.param(3 * SECOND, 1, id='the simulator is killed and started again'),
    ],
)
def test_a_restart_starts_afresh_and_is_never_falsely_synchronized(pause_ns: int, restarts: int) -> None:
    second = shift(phases(12.0, p0=0.3), LENGTH + pause_ns, restarts)
    monitor, syncs = run(SETTLED + second)
    alone, syncs_alone = run(second)
    assert syncs[len(SETTLED) :] == syncs_alone
    status = monitor.status()
    assert status.restarts == 1
    assert status._replace(restarts=0, cadence=alone.status().cadence) == alone.status()


@settings(max_examples=30, deadline=None)
@given(st.integers(1000, 2500), st.floats(0.05, 0.95))
def test_a_restart_that_is_not_announced_is_never_falsely_synchronized(at: int, p0: float) -> None:
    second = phases(3.0, p0, p1=p0)
    monitor = SyncMonitor(SyncParams())
    for sample in SETTLED[:at]:
        monitor.update(sample)
    for sample in shift(second, SETTLED[at - 1].stamp_ns + 5_000_000 - START_NS):
        sync = monitor.update(sample)
        assert sync
        assert abs(sync.error_percent) <= 12.0 or not sync.synchronized


def test_samples_that_are_lost_are_no_restart() -> None:
    kept = [sample for index, sample in enumerate(SETTLED) if index % 400 < 300]
    status, whole = run(kept)[0].status(), run(SETTLED[:3900])[0].status()
    assert (status.restarts, status.steps, status.slips) == (0, whole.steps, 0)


def test_a_sample_that_tells_nothing_is_passed_over() -> None:
    monitor, _ = run(SETTLED[:100])
    before = monitor.status()
    last = SETTLED[99]
    assert monitor.update(last) is None
    assert monitor.update(last._replace(stamp_ns=last.stamp_ns + 1, phi=Turn(math.nan))) is None
    assert repr(monitor.status()) == repr(before)


TURNS = st.builds(Turn, st.floats(), st.floats())


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.builds(
            PhaseSample,
            st.integers(-(2**63), 2**63),
            TURNS,
            TURNS,
            TURNS,
            st.integers(-(2**31), 2**31),
            st.integers(0, 2),
        ),
        max_size=40,
    )
)
def test_no_sample_whatever_breaks_the_monitor(samples: list[PhaseSample]) -> None:
    monitor, syncs = run(samples)
    assert all(-50.0 <= sync.error_percent < 50.0 for sync in syncs)
    monitor.status()


def test_a_changed_band_takes_effect_at_once() -> None:
    monitor, _ = run(SETTLED)
    monitor.configure(SyncParams(band_percent=0.01, band_hysteresis_percent=0.0))
    monitor.update(SETTLED[-1]._replace(stamp_ns=SETTLED[-1].stamp_ns + 5_000_000))
    assert not monitor.status().synchronized


@pytest.mark.parametrize(('rate', 'too_rare'), [(4.0, True), (6.0, True), (9.0, False), (20.0, False)])
def test_samples_that_are_too_rare_to_show_a_step_vouch_for_nothing(rate: float, too_rare: bool) -> None:
    every = round(200.0 / rate)
    monitor, syncs = run(SETTLED[::every])
    assert monitor.status().samples_in_step == pytest.approx(STEP * 200.0 / every, rel=0.1)
    assert monitor.status().too_rare == too_rare
    assert any(sync.synchronized for sync in syncs) != too_rare

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dcdrw_msgs_py.rig import FRONT, REAR, WheelShape
from dcdrw_msgs_py.samples import Footfall, JointSample, PhaseSample, Turn
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams, PhaseStatus, PhaseUpdate
from tests.tracker.walking import ALPHA, PITCH, START_NS, STEP, keep, walk

SECOND = 1_000_000_000
PARAMS = PhaseParams()


def run(
    samples: list[JointSample], params: PhaseParams = PARAMS
) -> tuple[list[PhaseSample], list[Footfall], PhaseStatus]:
    estimator = PhaseEstimator(params)
    updates = [update for update in map(estimator.update, samples) if update]
    falls = [fall for update in updates for fall in update.footfalls]
    return [update.phase for update in updates], falls, estimator.status()


def wrap(samples: list[JointSample], low: float = -math.pi, turns: int = 0) -> list[JointSample]:
    """The same rotations within a turn from `low`."""

    def wrapped(turn: Turn) -> Turn:
        return Turn((turn.angle - low) % math.tau + low, turn.rate)

    return [sample._replace(front=wrapped(sample.front), rear=wrapped(sample.rear)) for sample in samples]


def shift(samples: list[JointSample], ns: int = 0, front: float = 0.0, rear: float = 0.0) -> list[JointSample]:
    return [
        JointSample(s.stamp_ns + ns, Turn(s.front.angle + front, s.front.rate), Turn(s.rear.angle + rear, s.rear.rate))
        for s in samples
    ]


def same(one: list[PhaseSample], other: list[PhaseSample]) -> bool:
    """Whether two runs tell the same, but for rounding and the stamps' origin."""

    def numbers(phases: list[PhaseSample]) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
        return np.array([(p.front.angle, p.rear.angle, p.phi.angle, p.phi.rate, p.step_difference) for p in phases])

    return len(one) == len(other) and bool(np.allclose(numbers(one), numbers(other), rtol=0, atol=1e-6, equal_nan=True))


# --- the truth -----------------------------------------------------------------------------------------------------


def test_a_clean_walk_is_followed_exactly() -> None:
    truth = walk(8.0)
    phases, falls, status = run(truth.samples())
    n1, n2 = truth.steps()
    assert [phase.step_difference for phase in phases] == (n1 - n2).tolist()
    assert [phase.phi.angle for phase in phases] == pytest.approx((truth.phase() * PITCH).tolist(), abs=1e-9)
    assert [phase.front.angle for phase in phases] == pytest.approx((truth.front - PITCH * n1).tolist(), abs=1e-9)
    times: dict[str, list[float]] = {FRONT: [], REAR: []}
    for fall in falls:
        times[fall.wheel].append((fall.stamp_ns - START_NS) * 1e-9)
    assert times[FRONT] == pytest.approx(truth.front_strikes.tolist(), abs=2e-4)
    assert times[REAR] == pytest.approx(truth.rear_strikes[truth.rear_strikes < truth.time[-1]].tolist(), abs=2e-4)
    assert (status.accepted, sum(status.refused.values()), status.cadence.gaps) == (truth.time.size, 0, 0)


def test_phi_is_theta1_minus_theta2_up_to_a_step() -> None:
    for phase in run(walk(5.0).samples())[0]:
        difference = phase.phi.angle - (phase.front.angle - phase.rear.angle)
        assert math.remainder(difference, PITCH) == pytest.approx(0.0, abs=1e-9)
        assert 0.0 <= phase.phi.angle < PITCH


def test_footfalls_lie_a_step_apart_down_the_slope() -> None:
    _, falls, _ = run(walk(5.0).samples())
    step = WheelShape().step_length
    for wheel, start in ((FRONT, 0.9652 + step), (REAR, 0.0)):  # the front wheel starts just after a strike
        places = [fall.x for fall in falls if fall.wheel == wheel]
        assert places == pytest.approx([start + step * number for number in range(1, len(places) + 1)])
    assert all(earlier.stamp_ns <= later.stamp_ns for earlier, later in pairwise(falls))
    assert run(walk(1.0).samples(), PhaseParams(S0=0.5))[1][-1].wheel in (FRONT, REAR)


def test_wheels_of_unequal_spokes_each_keep_their_own_step() -> None:
    params = PhaseParams(front=WheelShape(spokes=12), rear=WheelShape(spokes=8))
    samples = [JointSample(START_NS + 5_000_000 * i, Turn(0.005 * i, 1.0), Turn(0.005 * i, 1.0)) for i in range(1000)]
    phases, _, status = run(samples, params)
    turned = samples[-1].front.angle
    assert (status.front_steps, status.rear_steps) == (
        math.floor(turned / (math.pi / 6) + 0.5),
        math.floor(turned / (math.pi / 4) + 0.5),
    )
    phase = (turned / (math.pi / 6) - turned / (math.pi / 4)) % 1
    assert phases[-1].phi.angle == pytest.approx(phase * (math.pi / 12 + math.pi / 8))


def test_a_missing_speed_is_found_from_the_rotations() -> None:
    truth = walk(4.0)
    given, found = run(truth.samples())[0], run(truth.samples(rates=False))[0]
    assert math.isnan(found[0].front.rate)
    errors = [abs(a.front.rate - b.front.rate) for a, b in zip(given[1:], found[1:], strict=True)]
    assert np.median(errors) < 0.03


# --- invariants ----------------------------------------------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(st.floats(0.05, 0.95), st.integers(-5, 5), st.integers(-5, 5))
def test_whole_turns_of_a_wheel_change_nothing(p0: float, front: int, rear: int) -> None:
    samples = walk(3.0, 100.0, p0).samples()
    assert same(run(samples)[0], run(shift(samples, 0, front * math.tau, rear * math.tau))[0])


@settings(max_examples=20, deadline=None)
@given(st.floats(0.05, 0.95), st.integers(-(10**18), 10**18))
def test_a_common_time_shift_changes_nothing(p0: float, ns: int) -> None:
    samples = walk(3.0, 100.0, p0).samples()
    shifted = run(shift(samples, ns))
    assert same(run(samples)[0], shifted[0])
    assert [fall.stamp_ns - ns for fall in shifted[1]] == [fall.stamp_ns for fall in run(samples)[1]]


@settings(max_examples=20, deadline=None)
@given(st.floats(0.05, 0.95), st.sampled_from([2, 4, 10]))
def test_the_sampling_rate_changes_nothing(p0: float, every: int) -> None:
    samples = walk(3.0, 200.0, p0).samples()
    fine, coarse = run(samples), run(samples[::every])
    assert same(fine[0][::every], coarse[0])
    for one, other in zip(fine[1], coarse[1], strict=False):
        assert (one.wheel, one.steps) == (other.wheel, other.steps)
        assert one.stamp_ns == pytest.approx(other.stamp_ns, abs=2_000_000)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.05, 0.95), st.sampled_from([-math.pi, 0.0, -1.0]), st.booleans(), st.floats(0.0, 0.3))
def test_wrapped_rotations_are_as_good_as_unbounded_ones(p0: float, low: float, rates: bool, noise_deg: float) -> None:
    samples = keep(walk(14.0, 100.0, p0).samples(noise_deg, 1, rates), 0.05)
    assert same(run(samples)[0], run(wrap(samples, low))[0])


@settings(max_examples=20, deadline=None)
@given(st.floats(0.05, 0.95))
def test_swapping_equal_wheels_mirrors_the_phase(p0: float) -> None:
    samples = walk(3.0, 100.0, p0, settle=1.0).samples()
    swapped = [sample._replace(front=sample.rear, rear=sample.front) for sample in samples]
    for one, other in zip(run(samples)[0], run(swapped)[0], strict=True):
        assert one.step_difference == -other.step_difference
        assert math.remainder(one.phi.angle + other.phi.angle, PITCH) == pytest.approx(0.0, abs=1e-9)
        assert one.phi.rate == pytest.approx(-other.phi.rate)


# --- gaps ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize('seconds', [0.3, 1.0, 3.0, 5.0, 20.0])
@pytest.mark.parametrize('wrapped', [False, True])
def test_a_gap_loses_no_steps_and_says_when_it_may_have(seconds: float, wrapped: bool) -> None:
    truth = walk(40.0, 100.0)
    gone = (truth.time > 10.0) & (truth.time < 10.0 + seconds)
    samples = [sample for sample, lost in zip(truth.samples(), gone, strict=True) if not lost]
    phases, falls, status = run(wrap(samples) if wrapped else samples)
    n1, n2 = truth.steps()
    assert phases[-1].step_difference == n1[-1] - n2[-1]
    assert status.front_steps == n1[-1]
    assert [fall.steps for fall in falls if fall.wheel == FRONT] == list(range(1, int(n1[-1]) + 1))
    assert status.n_uncertain == (seconds > STEP)
    assert (status.cadence.gaps, status.restarts) == (1, 0)
    assert status.cadence.lost == gone.sum()


def test_an_unbounded_wheel_that_stops_in_a_gap_is_not_turned() -> None:
    truth = walk(14.0, 100.0)
    samples = truth.samples()
    stopped = samples[-1]._replace(front=Turn(samples[-1].front.angle, 0.0), rear=Turn(samples[-1].rear.angle, 0.0))
    still = shift([stopped._replace(stamp_ns=stopped.stamp_ns + i * 10_000_000) for i in range(10)], 6 * SECOND)
    assert run(samples + still)[2].front_steps == truth.steps()[0][-1]


# --- what is refused -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('why', 'spoil'),
    [
        ('not finite', lambda good: good._replace(front=Turn(math.nan, 1.0))),
        ('not finite', lambda good: good._replace(rear=Turn(math.inf, 1.0))),
        ('not finite', lambda good: good._replace(rear=Turn(1e300, 1.0))),
        ('repeated', lambda good: good._replace(stamp_ns=good.stamp_ns - 5_000_000)),
        ('reversed', lambda good: good._replace(stamp_ns=good.stamp_ns - 20_000_000)),
        ('reversed', lambda good: good._replace(stamp_ns=good.stamp_ns - 20 * SECOND)),
        ('future', lambda good: good._replace(stamp_ns=good.stamp_ns + SECOND)),
        ('outlier', lambda good: good._replace(front=Turn(good.front.angle + 0.7, 1.0))),
    ],
)
def test_a_bad_sample_is_refused_and_counted_and_changes_nothing(why: str, spoil) -> None:  # type: ignore[no-untyped-def]
    samples = walk(2.0).samples()
    estimator, clean = PhaseEstimator(PhaseParams()), PhaseEstimator(PhaseParams())
    for index, sample in enumerate(samples):
        if index and index % 3 == 0:
            assert estimator.update(spoil(sample), now_ns=sample.stamp_ns) is None
        assert estimator.update(sample, now_ns=sample.stamp_ns) == clean.update(sample)
    status = estimator.status()
    assert {key: count for key, count in status.refused.items() if count} == {why: 133}
    assert (status.restarts, status.n_uncertain, status.refusal) == (0, False, None)


def test_a_speed_that_is_no_number_is_replaced() -> None:
    samples = [sample._replace(front=Turn(sample.front.angle, math.inf)) for sample in walk(1.0).samples()]
    phases, _, status = run(samples)
    assert status.accepted == len(samples)
    assert 0.5 < phases[-1].front.rate < 1.5


def test_a_clock_that_has_not_started_judges_no_stamp() -> None:
    assert PhaseEstimator(PhaseParams()).update(JointSample(START_NS, Turn(0.0), Turn(0.0)), now_ns=0)


TURNS = st.builds(Turn, st.floats(), st.floats())


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.builds(
            JointSample,
            st.integers(-(2**63), 2**63),
            TURNS,
            TURNS,
        ),
        max_size=40,
    )
)
def test_no_sample_whatever_breaks_the_estimator(samples: list[JointSample]) -> None:
    phases, _, status = run(samples)
    assert status.accepted + sum(status.refused.values()) >= len(samples)
    for phase in phases:
        assert -ALPHA <= phase.front.angle < ALPHA
        assert 0.0 <= phase.phi.angle < PITCH


# --- restarts ------------------------------------------------------------------------------------------------------


def after(first: list[JointSample], then: list[JointSample], pause_ns: int) -> list[JointSample]:
    """Two walks on end; the second's stamps begin `pause_ns` after (before, where negative) the first's end."""
    return first + shift(then, first[-1].stamp_ns + pause_ns - then[0].stamp_ns)


@pytest.mark.parametrize(
    'pause_ns',
    [
        pytest.param(-5 * SECOND, id='a recording loops'),
        pytest.param(5_000_000, id='the simulator is reset'),
        pytest.param(3 * SECOND, id='the simulator is killed and started again'),
    ],
)
@pytest.mark.parametrize('noise_deg', [0.0, 0.2])
def test_a_restart_of_the_source_counts_afresh_and_loses_no_strike(pause_ns: int, noise_deg: float) -> None:
    first, second = walk(5.0).samples(noise_deg, 1), walk(4.0, p0=0.8).samples(noise_deg, 2)
    phases, falls, status = run(after(first, second, pause_ns))
    alone, falls_alone, _ = run(second)
    assert status.restarts == 1
    assert same(phases[-len(second) + 4 :], alone[4:])

    def order(falls: list[Footfall]) -> list[tuple[str, int]]:
        return [(fall.wheel, fall.steps) for fall in falls]

    assert order(falls[-len(falls_alone) :]) == order(falls_alone)
    assert [phase.restarts for phase in phases[-len(second) + 3 :]] == [0] + [1] * (len(second) - 4)
    assert not status.n_uncertain


def test_a_new_run_of_the_source_counts_afresh_at_once() -> None:
    """Even where the wheels could have got there: the source knows that it lost them."""
    samples = walk(6.0).samples()
    marked = [sample._replace(run=7 if index < 600 else 9) for index, sample in enumerate(samples)]
    phases, falls, status = run(marked)
    alone, falls_alone, _ = run(marked[600:])
    assert [phase.restarts for phase in phases] == [0] * 600 + [1] * 600
    assert same(phases[600:], alone)
    assert falls[-len(falls_alone) :] == falls_alone
    assert (status.restarts, status.accepted) == (1, len(samples))
    assert phases[600].step_difference == 0


def test_within_a_run_no_gap_makes_n_uncertain() -> None:
    truth = walk(20.0, 100.0)
    samples = [sample._replace(run=1) for sample in truth.samples()]
    phases, _, status = run(samples[:300] + samples[800:])
    n1, n2 = truth.steps()
    assert phases[-1].step_difference == n1[-1] - n2[-1]
    assert not status.n_uncertain
    assert status.cadence.gaps == 1


def test_a_reset_begins_with_the_next_sample() -> None:
    estimator = PhaseEstimator(PhaseParams())
    samples = walk(3.0).samples()
    for sample in samples:
        estimator.update(sample)
    estimator.reset()
    assert estimator.status().front_steps == 0
    update = estimator.update(samples[0])
    assert isinstance(update, PhaseUpdate)
    assert update.phase.step_difference == 0


def test_a_changed_hysteresis_takes_effect_at_once() -> None:
    estimator = PhaseEstimator(PhaseParams(hysteresis_deg=5.0))
    angles = [ALPHA - 0.2, ALPHA - 0.1, ALPHA + 0.01, ALPHA - 0.03, ALPHA + 0.02, ALPHA - 0.03]
    steps = []
    for index, angle in enumerate(angles):
        if index == 4:
            estimator.configure(PhaseParams(hysteresis_deg=0.5))
        estimator.update(JointSample(index * 10_000_000, Turn(angle), Turn(0.0)))
        steps.append(estimator.status().front_steps)
    assert steps == [0, 0, 1, 1, 1, 0]

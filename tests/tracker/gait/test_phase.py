import math
from collections.abc import Callable
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
    return [phase for update in updates for phase in (*update.held, update.phase)], falls, estimator.status()


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
    assert status.accepted + status.duplicates + sum(status.refused.values()) == len(samples)
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
    assert same(phases[-len(second) :], alone)

    def order(falls: list[Footfall]) -> list[tuple[str, int]]:
        return [(fall.wheel, fall.steps) for fall in falls]

    assert order(falls[-len(falls_alone) :]) == order(falls_alone)
    assert [phase.restarts for phase in phases[-len(second) - 1 :]] == [0] + [1] * len(second)
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


# --- clocks, counts and hints ---------------------------------------------------------------------------------------


def stepped(samples: list[JointSample], at: int, ns: int) -> list[JointSample]:
    """The same by a clock that was set when sample `at` came."""
    return samples[:at] + shift(samples[at:], ns)


@settings(max_examples=6, deadline=None)
@given(
    st.integers(1_800, 2_100),
    st.sampled_from([37 * SECOND, -37 * SECOND, 3 * SECOND, -(10**18), 10**18]),
    st.floats(0.0, 0.3),
    st.booleans(),
)
def test_a_clock_that_is_set_while_the_wheels_go_on_changes_nothing(
    at: int, ns: int, noise_deg: float, rates: bool
) -> None:
    samples = walk(12.0).samples(noise_deg, 1, rates)
    phases, falls, status = run(stepped(samples, at, ns))
    plain, plain_falls, _ = run(samples)
    assert (status.restarts, status.accepted, sum(status.refused.values())) == (0, len(samples), 0)
    assert [step.seconds for step in status.clock_steps] == pytest.approx([ns * 1e-9], abs=0.01, rel=1e-12)
    assert phases[-1].step_difference == plain[-1].step_difference
    assert [(fall.wheel, fall.steps) for fall in falls] == [(fall.wheel, fall.steps) for fall in plain_falls]
    assert phases[-1].stamp_ns == samples[-1].stamp_ns + ns  # a phase keeps the stamp of its sample


def test_a_wrapped_source_is_bridged_where_its_samples_arrive_without_a_pause() -> None:
    samples = walk(16.0).samples()
    arrivals = [sample.stamp_ns for sample in samples]
    estimator = PhaseEstimator(PARAMS)
    for sample, arrival_ns in zip(wrap(stepped(samples, 1500, 37 * SECOND)), arrivals, strict=True):
        estimator.update(sample, arrival_ns=arrival_ns)
    assert len(estimator.status().clock_steps) == 1
    assert estimator.status().front_steps == run(samples)[2].front_steps


def test_wheels_that_stop_in_a_gap_are_no_clock_that_was_set() -> None:
    samples = walk(10.0).samples()
    last = samples[-1]
    still = last._replace(front=Turn(last.front.angle, 0.0), rear=Turn(last.rear.angle, 0.0))
    after_gap = [still._replace(stamp_ns=last.stamp_ns + 37 * SECOND + i * 5_000_000) for i in range(100)]
    _, _, status = run(samples + after_gap)
    assert (status.clock_steps, status.restarts, status.accepted) == ((), 0, len(samples) + 100)


def test_a_lone_stamp_from_the_future_is_refused_and_changes_nothing() -> None:
    samples = walk(10.0).samples()
    samples[1900] = samples[1900]._replace(stamp_ns=samples[1900].stamp_ns + 37 * SECOND)
    status = run(samples)[2]
    assert status.refusals == {'future': 1}
    assert (status.clock_steps, status.restarts, status.accepted) == ((), 0, len(samples) - 1)


def test_a_restart_tells_when_and_why() -> None:
    first, second = walk(12.0).samples(), walk(4.0).samples()
    (restart,) = run(after(first, second, 2 * SECOND))[2].restarted
    assert (restart.stamp_ns, restart.cause) == (first[-1].stamp_ns + 2 * SECOND, 'rotation')
    assert restart.seconds == pytest.approx(2.0)
    assert restart.front == pytest.approx(second[0].front.angle - first[-1].front.angle)
    (restart,) = run(after(first, second, -12 * SECOND))[2].restarted
    assert restart.cause == 'stamp'
    (restart,) = run([s._replace(run=1) for s in first] + [s._replace(run=2) for s in first])[2].restarted
    assert restart.cause == 'announced'


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.sampled_from([0.0, 0.5, -0.3, 2.0]), st.sampled_from([0, 1, 7 * SECOND, -SECOND]))
def test_every_sample_is_either_accepted_or_refused(at: int, front: float, ns: int) -> None:
    samples = walk(6.0).samples()
    for bent in (samples[:at] + shift(samples[at:], ns, front), samples[:at] + shift(samples[at : at + 3], ns, front)):
        status = run(bent)[2]
        assert status.accepted + status.duplicates + sum(status.refused.values()) == len(bent)


def test_samples_without_a_stamp_take_the_time_of_their_arrival() -> None:
    samples = walk(10.0).samples()
    estimator, whole = PhaseEstimator(PARAMS), run(samples)[2]
    for sample in samples:
        estimator.update(sample._replace(stamp_ns=0), now_ns=sample.stamp_ns)
    status = estimator.status()
    assert status.unstamped == len(samples) - 1
    assert (status.front_steps, status.rear_steps) == (whole.front_steps, whole.rear_steps)
    assert (status.restarts, status.n_uncertain, status.refusals) == (0, False, {})
    assert status.cadence.rate == pytest.approx(200.0)


@pytest.mark.parametrize(
    ('stamp', 'hints'),
    [
        (lambda since: since, ()),
        (lambda since: 2 * since, ()),
        (lambda since: since // 1000, ('stamps',)),
        (lambda since: since * 1000, ('stamps',)),
        (lambda since: (since + 1_234_567) % SECOND, ('stamps',)),
    ],
)
def test_stamps_that_do_not_pass_as_time_does_are_hinted_at(
    stamp: Callable[[int], int], hints: tuple[str, ...]
) -> None:
    estimator = PhaseEstimator(PARAMS)
    for sample in walk(10.0).samples():
        stamp_ns = 1 + stamp(sample.stamp_ns - START_NS)
        estimator.update(sample._replace(stamp_ns=stamp_ns), now_ns=10**18 + sample.stamp_ns)
    assert estimator.status().hints == hints


def test_a_simulated_clock_may_start_at_zero() -> None:
    held = [JointSample(0, Turn(-ALPHA, 0.0), Turn(0.0, 0.0))] * 5
    estimator = PhaseEstimator(PARAMS)
    for sample in held + shift(walk(2.0).samples(), 5_000_000 - START_NS):
        estimator.update(sample, now_ns=sample.stamp_ns + 10_000_000)
    assert estimator.status().unstamped == 0
    assert (estimator.status().duplicates, estimator.status().refusals) == (4, {})


@pytest.mark.parametrize('rate', [0.0, math.nan])
@pytest.mark.parametrize('later', [0, 1, 5, 40])
def test_a_message_that_comes_twice_counts_once_with_speeds_or_without(rate: float, later: int) -> None:
    estimator = PhaseEstimator(PARAMS)
    samples = walk(2.0).samples()
    for place in range(len(samples) + later):
        for sample in (*samples[place : place + 1], *samples[max(place - later, 0) : max(place - later + 1, 0)]):
            front, rear = (turn._replace(rate=turn.rate + rate) for turn in (sample.front, sample.rear))
            estimator.update(sample._replace(front=front, rear=rear))
    status = estimator.status()
    assert (status.accepted, status.duplicates) == (len(samples), len(samples))
    assert (status.refusals, status.restarts, status.cadence.lost) == ({}, 0, 0)


SIGNS = st.sampled_from([1, -1])


@settings(max_examples=12, deadline=None)
@given(st.sampled_from(['rad', 'deg', 'rev']), SIGNS, SIGNS, st.booleans())
def test_signs_and_unit_make_the_same_of_any_source(unit: str, front: int, rear: int, rates: bool) -> None:
    samples = walk(3.0, 100.0).samples(rates=rates)
    params = PhaseParams(unit=unit, front_sign=front, rear_sign=rear)
    (by_front, by_rear), scaled = params.scales, []
    for sample in samples:
        (psi1, rate1), (psi2, rate2) = sample.front, sample.rear
        scaled.append(
            sample._replace(front=Turn(psi1 / by_front, rate1 / by_front), rear=Turn(psi2 / by_rear, rate2 / by_rear))
        )
    assert same(run(scaled, params)[0], run(samples)[0])


@pytest.mark.parametrize(('front', 'rear'), [(-1, -1), (-1, 1), (1, -1), (1, 1)])
def test_a_wrong_sign_is_told_by_the_parameter_that_mends_it(front: int, rear: int) -> None:
    samples = walk(6.0).samples()
    turned = [
        s._replace(
            front=Turn(front * s.front.angle, front * s.front.rate), rear=Turn(rear * s.rear.angle, rear * s.rear.rate)
        )
        for s in samples
    ]
    hints = {'front_sign': front, 'rear_sign': rear}
    assert run(turned)[2].hints == tuple(name for name, sign in hints.items() if sign < 0)


@pytest.mark.parametrize('rate', [50.0, 200.0, 1000.0])
@pytest.mark.parametrize('rates', [True, False])
def test_degrees_are_told_by_the_parameter_that_mends_them(rate: float, rates: bool) -> None:
    samples = walk(6.0, rate).samples(rates=rates)
    of_both = [s._replace(front=in_degrees(s.front), rear=in_degrees(s.rear)) for s in samples]
    assert 'unit' in run(of_both)[2].hints
    assert run(of_both, PhaseParams(unit='deg'))[2].hints == ()
    for of_one in (
        [s._replace(front=in_degrees(s.front)) for s in samples],
        [s._replace(rear=in_degrees(s.rear)) for s in samples],
    ):
        assert 'unit' in run(of_one)[2].hints


def in_degrees(turn: Turn) -> Turn:
    return Turn(math.degrees(turn.angle), math.degrees(turn.rate))


@pytest.mark.parametrize('rate', [60.0, 200.0, 1000.0])
@pytest.mark.parametrize('size', [0.05, 0.2, 3.0])
@pytest.mark.parametrize('rates', [True, False])
def test_one_wild_sample_in_a_hundred_changes_no_other(rate: float, size: float, rates: bool) -> None:
    """Each lies apart from both neighbours; what is told of all others is as without it."""
    random = np.random.default_rng(7)
    samples = walk(15.0, rate).samples(0.01, 3, rates)
    wild = 2 * np.flatnonzero(random.random(len(samples) // 2 - 30) < 0.02) + 50
    bent = samples.copy()
    for place in wild:
        off = size * random.uniform(0.8, 1.2) * random.choice([-1.0, 1.0])
        front, rear = samples[place][1:3]
        if random.random() < 0.5:
            front = front._replace(angle=front.angle + off)
        else:
            rear = rear._replace(angle=rear.angle + off)
        bent[place] = samples[place]._replace(front=front, rear=rear)
    phases, falls, status = run(bent)
    plain, plain_falls, _ = run(samples)
    assert status.strays + sum(status.refused.values()) == len(wild)
    assert status.restarts == 0
    assert [fall[::3] for fall in falls] == [fall[::3] for fall in plain_falls]  # which wheel, and its steps
    told = {phase.stamp_ns: phase.phi.angle for phase in plain}
    assert {phase.stamp_ns: phase.phi.angle for phase in phases} == {
        phase.stamp_ns: told[phase.stamp_ns] for phase in phases
    }


@pytest.mark.parametrize('gap', [0.15, 0.25, 0.3, 0.35, 0.5, 1.0, 3.0])
@pytest.mark.parametrize('rate', [30.0, 120.0])
def test_a_gap_of_a_source_that_vouches_for_its_turns_is_no_clock_that_was_set(gap: float, rate: float) -> None:
    samples = [sample._replace(run=1) for sample in walk(12.0, rate).samples()]
    begin = round(6.0 * rate)
    seen = samples[:begin] + samples[begin + round(gap * rate) :]
    phases, _, status = run(seen)
    assert (len(phases), status.clock_steps, status.refusals) == (len(seen), (), {})


@pytest.mark.parametrize('rates', [True, False])
def test_a_wheel_that_jumps_and_goes_on_loses_no_sample(rates: bool) -> None:
    samples = walk(6.0, 200.0).samples(0.01, 3, rates)
    jumped = samples[:600] + [s._replace(front=s.front._replace(angle=s.front.angle + 0.06)) for s in samples[600:]]
    phases, _, status = run(jumped)
    assert (len(phases), status.strays, status.refusals, status.restarts) == (len(samples), 0, {}, 0)


# --- bursts and counters --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(('rate', 'size'), [(100.0, 2), (200.0, 4), (1000.0, 16), (60.0, 3)])
def test_samples_in_bursts_make_the_same_steps_as_evenly_stamped_ones(rate: float, size: int) -> None:
    even = walk(8.0, rate).samples(rates=False)
    every = round(size / rate * SECOND)
    in_bursts = [
        sample._replace(stamp_ns=START_NS + (place // size + 1) * every + place % size * 100_000)
        for place, sample in enumerate(even)
    ]
    phases, falls, status = run(in_bursts)
    plain, plain_falls, _ = run(even)
    assert (status.accepted, status.cadence.gaps, status.refusals) == (len(even), 0, {})
    assert [phase.phi.angle for phase in phases] == [phase.phi.angle for phase in plain]
    assert [(fall.wheel, fall.steps) for fall in falls] == [(fall.wheel, fall.steps) for fall in plain_falls]
    settled = slice(round(0.5 * rate), None)
    rates = [phase.front.rate for phase in phases[settled]]
    expected = [phase.front.rate for phase in plain[settled]]
    assert max(rates) < 1.5 * max(expected)
    assert min(rates) > 0.5 * min(expected)
    assert np.mean(rates) == pytest.approx(np.mean(expected), rel=0.02)


@pytest.mark.parametrize(('rate', 'size'), [(60.0, 60), (200.0, 60), (30.0, 10)])
def test_of_samples_that_come_all_at_once_after_a_pause_none_is_wild(rate: float, size: int) -> None:
    even = walk(12.0, rate).samples(rates=False)
    late = [
        sample._replace(stamp_ns=START_NS + round((place // size + 1) * size / rate * SECOND) + place % size * 100_000)
        for place, sample in enumerate(even)
    ]
    phases, _, status = run(late)
    assert (status.accepted, status.strays, status.refusals, status.restarts) == (len(even), 0, {}, 0)
    assert [phase.phi.angle for phase in phases] == [phase.phi.angle for phase in run(even)[0]]


def counted(samples: list[JointSample], per_turn: int, low: int, width: int, zero: int = 0) -> list[JointSample]:
    """The same by counters that roll over after `width` counts, from `low` on, and that were at `zero` at ψ = 0."""

    def count(turn: Turn) -> Turn:
        counts = round(turn.angle / math.tau * per_turn) + zero
        return Turn(((counts - low) % width + low) * math.tau / per_turn, turn.rate)

    return [sample._replace(front=count(sample.front), rear=count(sample.rear)) for sample in samples]


@pytest.mark.parametrize('rates', [True, False])
@pytest.mark.parametrize(
    ('per_turn', 'low', 'width', 'rollover'),
    [
        pytest.param(2000, -(2**15), 2**16, False, id='int16'),
        pytest.param(2048, 0, 2**16, False, id='uint16, whole turns'),
        pytest.param(3600, 0, 2**16, False, id='uint16'),
        pytest.param(1000, -(2**11), 2**12, False, id='12 bit, signed'),
        pytest.param(1000, 0, 2**12, True, id='12 bit, unsigned, told'),
        pytest.param(4096, 0, 8 * 4096, False, id='eight turns'),
        pytest.param(1000, -(2**9), 2**10, False, id='10 bit, little more than a turn'),
        pytest.param(1000, 0, 2**10, True, id='10 bit, told'),
        pytest.param(4000, -(2**11), 2**12, False, id='12 bit, little more than a turn'),
        pytest.param(20_000, 0, 2**16, True, id='uint16, three turns and a quarter, told'),
        pytest.param(360, -(2**7), 2**8, False, id='8 bit, less than a turn'),
        pytest.param(1000, 0, 10_000, True, id='decades, told'),
    ],
)
def test_a_counter_that_rolls_over_loses_nothing(
    per_turn: int, low: int, width: int, rollover: bool, rates: bool
) -> None:
    samples = walk(16.0).samples(rates=rates)
    zero = low + max(width - round(1.3 * per_turn), round(0.75 * width))  # each wheel rolls over after some time
    params = PhaseParams(rollover=width / per_turn * math.tau) if rollover else PARAMS
    counts = counted(samples, per_turn, low, width, zero)
    phases, falls, status = run(counts, params)
    moved = np.diff([(sample.front.angle, sample.rear.angle) for sample in counts], axis=0)
    below = width if rollover else 0  # told, a start in the upper half of the counter is one below 0
    plain, plain_falls, _ = run(counted(samples, per_turn, -(2**40), 2**41, zero - below))
    assert status.rollovers == np.count_nonzero(np.abs(moved) > 0.5 * width / per_turn * math.tau) >= 2
    assert (status.restarts, status.refusals, status.n_uncertain) == (0, {}, False)
    assert [phase.phi.angle for phase in phases] == pytest.approx([p.phi.angle for p in plain], abs=1e-2)
    assert [(fall.wheel, fall.steps) for fall in falls] == [(fall.wheel, fall.steps) for fall in plain_falls]


@pytest.mark.parametrize('factor', [0.0, -1.0, math.degrees(1.0), 0.1, 1.0 / math.tau])
def test_speeds_that_do_not_go_with_the_rotations_are_not_used(factor: float) -> None:
    samples = walk(8.0).samples()
    wrong = [s._replace(front=Turn(s.front.angle, factor * s.front.rate)) for s in samples]
    phases, falls, status = run(wrong)
    plain, plain_falls, plain_status = run(samples)
    assert falls == plain_falls
    assert [phase.phi.angle for phase in phases] == [phase.phi.angle for phase in plain]
    settled = slice(400, None)  # after two seconds
    given, right = (np.array([phase.front.rate for phase in each[settled]]) for each in (phases, plain))
    assert np.abs(given - right).mean() < 0.05
    assert plain_status.disbelieved == 0
    assert status.disbelieved > 0.75 * len(samples) or factor > 20.0  # beyond max_speed it is none at all


@pytest.mark.parametrize('missing', range(0, 12, 2))
def test_speeds_of_a_wheel_that_is_let_go_within_a_gap_are_used(missing: int) -> None:
    moving = walk(8.0).samples()[::7]  # as of a camera
    still = Turn(moving[0].front.angle, 0.0), Turn(moving[0].rear.angle, 0.0)
    held = [JointSample(moving[0].stamp_ns - (i + 1) * 33_000_000, *still) for i in reversed(range(60))]
    phases, _, status = run(held + moving[1 + missing :])
    assert status.disbelieved == 0
    assert [phase.front.rate for phase in phases[-100:]] == [sample.front.rate for sample in moving[-100:]]


def test_a_counter_of_unknown_width_asks_for_the_parameter_that_makes_it_good() -> None:
    samples = counted(walk(16.0).samples(), 4096, -2000, 6000)  # no power of two, nor whole turns, nor both ends alike
    assert run(samples)[2].hints == ('lone_jump',)
    assert run(samples, PhaseParams(rollover=6000 / 4096 * math.tau))[2].restarts == 0


def test_a_wheel_that_rocks_where_its_counter_rolls_over_loses_nothing() -> None:
    """A counter of 1024 counts and 1000 a turn, which is at its top as the wheels turn back and forth."""
    time = np.arange(0.0, 12.0, 0.005)
    angle = np.where(time < 4.0, 0.8 * time, 3.2 + 0.2 * np.sin(4.0 * (time - 4.0)))
    samples = [JointSample(START_NS + round(t * 1e9), Turn(a), Turn(a - 0.2)) for t, a in zip(time, angle, strict=True)]
    phases, falls, status = run(counted(samples, 1000, -512, 1024))
    plain, plain_falls, _ = run(counted(samples, 1000, -(2**40), 2**41))
    assert status.rollovers > 4
    assert (status.restarts, status.hints) == (0, ())
    assert [phase.phi.angle for phase in phases] == pytest.approx([p.phi.angle for p in plain], abs=1e-2)
    assert [(fall.wheel, fall.steps) for fall in falls] == [(fall.wheel, fall.steps) for fall in plain_falls]


def test_a_driver_that_starts_at_zero_again_is_no_counter_that_rolled_over() -> None:
    samples = walk(16.0).samples(rates=False)
    half = len(samples) // 2
    middle = samples[half]
    back = shift(samples[half:], 0, -middle.front.angle, -middle.rear.angle)
    for pause_ns in (0, 2 * SECOND):
        status = run(samples[:half] + shift(back, pause_ns))[2]
        assert (status.rollovers, status.restarts, status.restarted[0].cause) == (0, 1, 'rotation')


@pytest.mark.parametrize('start', [0.0, -6.4, 3.0, 100.0])
def test_degrees_taken_for_radians_are_refused_with_a_hint_and_are_no_rollover(start: float) -> None:
    scale = math.degrees(1.0)
    samples = [
        JointSample(s.stamp_ns, *(Turn(start + scale * (turn.angle + ALPHA), scale * turn.rate) for turn in s[1:3]))
        for s in walk(10.0).samples()
    ]
    phases, falls, status = run(samples)
    assert (len(phases), falls, status.rollovers, status.restarts) == (1, [], 0, 0)
    assert status.hints == ('unit',)


@pytest.mark.parametrize(('per_turn', 'bits'), [(2000, 12), (2000, 16), (10_000, 14)])
def test_where_the_zero_of_a_counter_is_not_known_a_hint_asks_and_the_parameter_tells(per_turn: int, bits: int) -> None:
    """The front wheel starts at −15°, so that its unsigned counter starts near its top."""
    samples = walk(8.0).samples()
    unsigned = counted(samples, per_turn, 0, 2**bits)
    assert run(unsigned)[2].hints == ('rollover',)
    phases, falls, status = run(unsigned, PhaseParams(rollover=2**bits / per_turn * math.tau))
    plain, plain_falls, _ = run(counted(samples, per_turn, -(2**40), 2**41))
    assert status.hints == ()
    assert [phase.phi.angle for phase in phases] == pytest.approx([p.phi.angle for p in plain], abs=1e-2)
    assert falls == plain_falls

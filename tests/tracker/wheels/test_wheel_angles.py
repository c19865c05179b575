"""Both wheels through time, against the truth of walks that were filmed."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dcdrw_msgs_py.rolling import hub_travel
from dcdrw_msgs_py.samples import SECOND, JointSample
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams
from dcdrw_tracker.tags.wheel_view import PairView
from dcdrw_tracker.wheels.wheel_angles import AnglesStatus, WheelAngles
from dcdrw_tracker.wheels.wheel_track import START_VIEWS, TrackParams
from tests.tracker.filming import between, film, hub, nothing, view
from tests.tracker.walking import ALPHA, PITCH, START_NS, STEP, Walk, walk

FPS = 60.0
PARAMS = TrackParams()
NOISE = math.radians(0.05)


def follow(views: list[PairView], params: TrackParams = PARAMS) -> tuple[list[JointSample], AnglesStatus]:
    angles = WheelAngles(params)
    return [sample for sample in map(angles.update, views) if sample], angles.status()


def at(truth: Walk, samples: list[JointSample]) -> list[int]:
    """Index in the walk of each sample."""
    return [round((sample.stamp_ns - START_NS) * 1e-9 * FPS) for sample in samples]


def turns_off(truth: Walk, samples: list[JointSample]) -> tuple[set[int], set[int]]:
    """Whole turns by which each rotation is off the truth: one number where no turn is lost; no error is larger."""
    off = []
    for psi, found in ((truth.front, [s.front.angle for s in samples]), (truth.rear, [s.rear.angle for s in samples])):
        difference = (np.array(found) - psi[at(truth, samples)]) / math.tau
        assert np.abs(difference - np.round(difference)).max() * math.tau < 6 * NOISE
        off.append(set(np.round(difference).astype(int).tolist()))
    return off[0], off[1]


def n_of(samples: list[JointSample]) -> int:
    """n at the end, as the phase estimator counts it."""
    estimator = PhaseEstimator(PhaseParams())
    phases = [update.phase for update in map(estimator.update, samples) if update]
    assert not estimator.status().n_uncertain
    assert not estimator.status().restarts
    return phases[-1].step_difference


def n_true(truth: Walk, samples: list[JointSample]) -> int:
    """n at the end of the samples since their first one, from the rotations."""
    first, last = at(truth, samples)[0], at(truth, samples)[-1]
    n1, n2 = (np.floor((psi[[first, last]] + ALPHA) / PITCH) for psi in (truth.front, truth.rear))
    return int((n1[1] - n1[0]) - (n2[1] - n2[0]))


# --- the truth -----------------------------------------------------------------------------------------------------


def test_a_walk_is_followed_through_many_turns() -> None:
    truth = walk(30.0, FPS)
    samples, status = follow(film(truth))
    assert len(samples) == truth.time.size - 2  # the first two wait for a third that agrees
    assert turns_off(truth, samples) == ({0}, {0})
    assert n_of(samples) == n_true(truth, samples)
    assert (status.run, status.lost, sum(status.front.outliers.values())) == (1, 0, 0)
    assert status.front.travels
    assert status.rear.travels


def test_hub_travels_a_step_length_per_step_without_a_jump() -> None:
    psi = np.linspace(-7, 20, 2001)
    travel = np.array([hub_travel(PhaseParams().front, p) for p in psi])
    assert travel == pytest.approx(hub(psi), abs=1e-12)
    assert np.abs(np.diff(travel)).max() < 0.9652 * (psi[1] - psi[0]) * 1.001


@pytest.mark.parametrize(('fps', 'noise_deg', 'limit'), [(60.0, 0.04, 0.05), (60.0, 0.2, 0.11), (30.0, 0.1, 0.08)])
def test_speed_is_not_smeared_across_strikes(fps: float, noise_deg: float, limit: float) -> None:
    truth = walk(15.0, fps)
    samples, _ = follow(film(truth, noise_deg))
    fine = walk(15.0, 20_000.0)
    speed = np.gradient(fine.front, fine.time)
    stamps = np.array([(s.stamp_ns - START_NS) * 1e-9 for s in samples])
    error = np.array([s.front.rate for s in samples]) - np.interp(stamps, fine.time, speed)
    since = stamps - np.array([max([t for t in truth.front_strikes if t <= stamp], default=-9.0) for stamp in stamps])
    until = np.array([min([t for t in truth.front_strikes if t > stamp], default=99.0) for stamp in stamps]) - stamps
    sure = (np.minimum(since, until) > 4 * math.radians(noise_deg)) & (stamps > 0.5)  # which side is plain to see
    after = sure & (since < 2.5 / fps)  # speed has just fallen by 13 %, 0.15 rad/s
    assert after.sum() > 20
    assert math.sqrt(np.mean(error[sure] ** 2)) < limit
    assert math.sqrt(np.mean(error[after] ** 2)) < limit
    assert abs(np.mean(error[after])) < 0.02


# --- dropped frames and occlusions ---------------------------------------------------------------------------------


def test_n_is_exact_with_a_fifth_of_the_frames_lost_and_one_tag_hidden_for_half_a_second() -> None:
    for start in (5.0, 5.2, 12.3, 20.0):
        truth = walk(30.0, FPS)
        samples, status = follow(film(truth, 0.2, 0.2, rear_hidden=between((start, start + 0.5)), seed=int(start)))
        assert n_of(samples) == n_true(truth, samples)
        assert status.lost == 0
        assert 0.9 < status.samples / (0.8 * truth.time.size - 30) < 1.1


def gaps(longest: float) -> st.SearchStrategy[list[tuple[float, float]]]:
    """Spans of a walk that are not seen, each followed by a while in which both wheels are."""
    lengths = st.lists(st.tuples(st.floats(0.2, 2.0), st.floats(0.01, longest)), min_size=1, max_size=6)

    def spans(pairs: list[tuple[float, float]]) -> list[tuple[float, float]]:
        found, time = [], 0.5
        for seen, gone in pairs:
            found.append((time + seen, time + seen + gone))
            time += seen + gone
        return found

    return lengths.map(spans)


@settings(max_examples=25, deadline=None)
@given(gaps(0.5 * 12 * STEP), st.booleans(), st.floats(0.05, 0.95), st.floats(0.0, 0.3))
def test_less_than_half_a_turn_unseen_loses_none(
    spans: list[tuple[float, float]], follows: bool, p0: float, lost: float
) -> None:
    truth = walk(spans[-1][1] + 1.0, FPS, p0)
    hidden = between(*spans)
    samples, status = follow(
        film(truth, lost=lost, front_hidden=hidden, rear_hidden=hidden, follows=follows),
        TrackParams(camera_follows=follows),
    )
    assert turns_off(truth, samples) == ({0}, {0})
    assert status.lost == 0


@settings(max_examples=25, deadline=None)
@given(st.floats(1.0, 30.0), st.booleans(), st.booleans())
def test_hub_travel_restores_the_turns_of_a_wheel_however_long_it_was_hidden(
    seconds: float, follows: bool, front: bool
) -> None:
    truth = walk(seconds + 6.0, FPS)
    hidden = between((3.0, 3.0 + seconds))
    sides = (hidden, nothing) if front else (nothing, hidden)
    samples, status = follow(film(truth, 0.05, 0.0, *sides, follows), TrackParams(camera_follows=follows))
    assert turns_off(truth, samples) == ({0}, {0})
    assert status.lost == 0
    assert (status.front if front else status.rear).restored == 1
    assert len({sample.run for sample in samples}) == 1


def test_a_fixed_camera_restores_both_wheels_at_once() -> None:
    truth = walk(20.0, FPS)
    hidden = between((3.0, 15.0))
    samples, status = follow(film(truth, front_hidden=hidden, rear_hidden=hidden))
    assert turns_off(truth, samples) == ({0}, {0})
    assert (status.lost, status.front.restored, status.rear.restored) == (0, 1, 1)
    assert n_of(samples) == n_true(truth, samples)


def test_where_nothing_tells_the_turns_a_new_run_begins() -> None:
    truth = walk(20.0, FPS)
    hidden = between((3.0, 15.0))
    samples, status = follow(
        film(truth, front_hidden=hidden, rear_hidden=hidden, follows=True), TrackParams(camera_follows=True)
    )
    runs = [sample.run for sample in samples]
    assert runs == sorted(runs)
    assert set(runs) == {1, 1 + status.lost}
    assert status.lost >= 1
    for run in set(runs):  # within a run nothing is lost
        front, rear = turns_off(truth, [sample for sample in samples if sample.run == run])
        assert (len(front), len(rear)) == (1, 1)
    estimator = PhaseEstimator(PhaseParams())
    phases = [update.phase for update in map(estimator.update, samples) if update]
    assert len(phases) == len(samples)
    assert [phase.restarts for phase in phases] == [0 if run == 1 else 1 for run in runs]


def test_a_camera_that_moves_unawares_is_noticed_and_its_hubs_are_not_believed() -> None:
    truth = walk(20.0, FPS)
    hidden = between((8.0, 14.0))
    _, status = follow(film(truth, front_hidden=hidden, rear_hidden=hidden, follows=True))
    assert not status.front.travels
    assert status.lost >= 1


def test_a_wheel_that_is_hidden_at_first_joins_later() -> None:
    truth = walk(10.0, FPS)
    samples, status = follow(film(truth, rear_hidden=between((0.0, 4.0))))
    assert samples[0].stamp_ns - START_NS == pytest.approx(4.0e9, abs=0.05e9)
    assert status.lost == 0


# --- outliers ------------------------------------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.01, 0.2), st.floats(0.0, 0.2))
def test_outliers_never_leak(seed: int, share: float, lost: float) -> None:
    random = np.random.default_rng(seed)
    truth = walk(10.0, FPS)
    views = film(truth, lost=lost, front_hidden=between((4.0, 4.8)), seed=seed % 1000)
    spoilt = [
        pair._replace(front=pair.front._replace(rotation=pair.front.rotation + random.uniform(0.15, 6.1)))
        if pair.front and index > 3 and bad
        else pair
        for index, (pair, bad) in enumerate(zip(views, (random.random(len(views)) < share).tolist(), strict=True))
    ]
    samples, status = follow(spoilt)
    assert turns_off(truth, samples) == ({0}, {0})
    assert status.lost == 0
    assert sum(status.front.outliers.values()) + status.front.unconfirmed > 0
    assert status.rear.outliers == {'misfit': 0, 'jump': 0}


def test_a_tag_that_is_flipped_for_some_frames_is_not_followed() -> None:
    truth = walk(6.0, FPS)
    views = film(truth)
    for index in range(200, 209):
        front = views[index].front
        assert front
        views[index] = views[index]._replace(front=front._replace(rotation=front.rotation + math.pi / 2))
    samples, status = follow(views)
    assert turns_off(truth, samples) == ({0}, {0})
    assert status.front.outliers == {'misfit': 0, 'jump': 9}


def test_a_misfit_is_refused() -> None:
    truth = walk(3.0, FPS)
    views = film(truth)
    bad = views[100].front
    assert bad
    views[100] = views[100]._replace(front=bad._replace(error_px=8.0))
    samples, status = follow(views)
    assert status.front.outliers == {'misfit': 1, 'jump': 0}
    assert len(samples) == len(views) - 3


def test_a_wheel_that_is_carried_back_begins_a_new_run() -> None:
    """Somebody takes the rig back up the slope, in view: the rotations that come do not go on from the old ones."""
    first, second = film(walk(8.0, FPS)), film(walk(6.0, FPS, p0=0.4), seed=1)
    offset = first[-1].stamp_ns + 2_000_000_000 - second[0].stamp_ns
    samples, status = follow(first + [pair._replace(stamp_ns=pair.stamp_ns + offset) for pair in second])
    assert status.lost >= 1
    assert samples[-1].run > samples[0].run
    assert len(samples) > len(first) + len(second) - 20


def test_a_wheel_that_is_pushed_is_followed_again() -> None:
    still = [PairView(START_NS + i * 16_666_667, view(0.1), view(0.2)) for i in range(60)]
    moved = [PairView(START_NS + (60 + i) * 16_666_667, view(0.7), view(0.2)) for i in range(60)]
    samples, status = follow(still + moved)
    assert status.front.outliers['jump'] == 9
    assert samples[-1].front.angle == pytest.approx(0.7)
    assert status.lost == 0


def test_standing_and_held_wheels_have_no_speed() -> None:
    random = np.random.default_rng(0)
    for psi in (0.0, -ALPHA, ALPHA - 1e-4, ALPHA + 1e-4, 5 * PITCH + ALPHA):
        samples, _ = follow(
            [
                PairView(START_NS + i * 16_666_667, view(psi + 1e-3 * random.standard_normal()), view(1.0))
                for i in range(300)
            ]
        )
        rates = np.array([sample.front.rate for sample in samples[60:]])
        assert abs(rates.mean()) < 0.02
        assert rates.std() < 0.1


# --- stamps --------------------------------------------------------------------------------------------------------


def test_repeated_and_reversed_stamps_are_passed_over() -> None:
    views = film(walk(3.0, FPS))
    twice = [pair for index, pair in enumerate(views) for pair in (pair, views[max(index - 5, 0)])[: 1 + index % 2]]
    samples, status = follow(twice)
    assert samples == follow(views)[0]
    assert status.out_of_order == len(twice) - len(views)


def test_a_recording_that_loops_begins_a_new_run() -> None:
    views = film(walk(5.0, FPS))
    samples, status = follow(views + views)
    assert {sample.run for sample in samples} == {1, 2}
    assert status.lost == 1
    assert len(samples) == 2 * (len(views) - 2) - 9


def test_a_clock_that_is_set_back_while_both_wheels_go_on_begins_no_new_run() -> None:
    views = film(walk(6.0, FPS))
    half = len(views) // 2
    back = [pair._replace(stamp_ns=pair.stamp_ns - 37 * SECOND) for pair in views[half:]]
    samples, status = follow(views[:half] + back)
    even, _ = follow(views)
    assert {sample.run for sample in samples} == {1}
    assert (status.lost, status.out_of_order) == (0, START_VIEWS)
    told = {sample.stamp_ns: sample.front.angle for sample in even}
    for sample in samples:
        ahead = 37 * SECOND if sample.stamp_ns < views[0].stamp_ns else 0
        assert sample.front.angle == pytest.approx(told[sample.stamp_ns + ahead], abs=1e-9)


VIEWS = st.none() | st.builds(view, st.floats(-10, 10), st.floats(-1e6, 1e6), st.floats())


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.builds(PairView, st.integers(0, 2**62) | st.integers(0, 10**9), VIEWS, VIEWS), max_size=60),
    st.booleans(),
)
def test_no_view_whatever_breaks_it(views: list[PairView], follows: bool) -> None:
    samples, status = follow(views, TrackParams(camera_follows=follows))
    assert status.views == len(views)
    for sample in samples:
        assert math.isfinite(sample.front.angle)
        assert math.isfinite(sample.rear.angle)

"""A verdict says what it leaves out, and a trial that was not run has none."""

import json
import math
from functools import cache

import numpy as np
import pytest

from dcdrw.recordings.dating import dated
from dcdrw.suite.parameter_file import TrialParams
from dcdrw.trials.analysis import Analysis, analyze
from dcdrw.trials.results import write_results
from dcdrw.trials.summary import summarize
from dcdrw_msgs_py.diagnosis import PairState
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import SECOND, JointSample, Turn
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams
from dcdrw_tracker.gait.diagnostics import diagnose_sync
from dcdrw_tracker.gait.sync import SyncParams
from tests.tracker.walking import walk
from tests.trials import batch

WALK = walk(20.0).samples()
RATE = 200


def trial(samples: list[JointSample]) -> Analysis:
    return analyze([batch(samples)], TrialParams())


def later(samples: list[JointSample], seconds: float) -> list[JointSample]:
    return [sample._replace(stamp_ns=sample.stamp_ns + round(seconds * SECOND)) for sample in samples]


@cache
def rolled(rate: int, k: float = 5.25, b: float = 100.0) -> list[JointSample]:
    """A trial, exactly; the paper's by default."""
    rig = SimulatedRig(RigParams(k=k, b=b), SimulatorParams(rate=float(rate)))
    samples = (rig.read(i / rate, SECOND + i * SECOND // rate) for i in range(26 * rate))
    return [sample for sample in samples if sample]


def held(seconds: float) -> list[JointSample]:
    first = WALK[0]
    return [
        JointSample(first.stamp_ns + i * SECOND // RATE, Turn(first.front.angle, 0.0), Turn(first.rear.angle, 0.0))
        for i in range(round(seconds * RATE))
    ]


def test_a_whole_trial_needs_no_remark():
    summary = summarize(trial(WALK))
    assert (summary.state, summary.reason, summary.complete) == (PairState.SYNCHRONIZED, None, True)
    assert (summary.remarks, summary.judged_from_s) == ((), 0.0)
    assert summary.sentence.count('. ') == 0


@pytest.mark.parametrize('gaps', [[(18.172, 18.241), (18.31, 18.483)], [(4.659, 4.78), (6.39, 6.6), (18.31, 18.483)]])
def test_samples_that_are_missing_leave_the_steps_as_they_are(gaps):
    """Over a gap the phase is foretold badly; that is no noise, for which the band would be wider."""
    samples = rolled(RATE)
    seen = [sample for i, sample in enumerate(samples) if not any(begin < i / RATE < end for begin, end in gaps)]
    summary = summarize(trial(seen))
    assert summary.samples.lost == len(samples) - len(seen) > 40
    assert summary.steps_to_synchronization == 38


@pytest.mark.parametrize('length', [0.06, 0.2, 0.5, 0.8])
def test_steps_are_left_open_where_a_gap_may_hide_the_last_excursion_and_there_alone(length):
    certain = 0
    for begin in np.arange(18.0, 23.0, 0.37).tolist():
        seen = [sample for i, sample in enumerate(rolled(RATE)) if not begin < i / RATE < begin + length]
        analysis = trial(seen)
        summary = summarize(analysis)
        first, last = summary.steps_to_synchronization, summary.steps_to_synchronization_at_latest
        assert first <= 38 <= last <= 38 + 3
        told = f'{first}' if first == last else f'{first} to {last}'
        assert f'in {told} steps;' in summary.sentence
        assert diagnose_sync(analysis.status, 0.0, 1.0).message == f'synchronized after {told} steps'
        assert ('A gap may hide that the error left the band later' in summary.sentence) == (first < last)
        certain += first == last
    assert certain >= 7  # of 14


def test_samples_lost_all_along_leave_no_steps_open_where_their_speeds_tell_what_came_between():
    lost = np.random.default_rng(1).random(26 * RATE) < 0.2
    summary = summarize(trial([sample for i, sample in enumerate(rolled(RATE)) if not lost[i]]))
    assert summary.samples.gaps > 800
    assert summary.steps_to_synchronization == summary.steps_to_synchronization_at_latest == 38


def test_an_excursion_that_fell_into_a_gap_is_not_ruled_out():
    seen = [sample for i, sample in enumerate(rolled(RATE)) if not 21.0 < i / RATE < 21.3]
    summary = summarize(trial(seen))
    assert (summary.steps_to_synchronization, summary.steps_to_synchronization_at_latest) == (37, 38)
    assert 'in 37 to 38 steps;' in summary.sentence


@pytest.mark.parametrize(
    ('counts', 'rate'),
    [
        *((counts, 200) for counts in (12, 64, 360, 400, 512, 4096, 1 << 16)),
        (400, 20),
        (512, 20),
        (400, 1000),
        (512, 1000),
    ],
)
def test_encoders_too_coarse_for_the_band_are_said_and_finer_ones_change_nothing(counts, rate):
    """A count of both wheels together is as much as the band at 400 counts in a turn."""
    count = math.tau / counts
    seen = [
        sample._replace(
            front=Turn(count * math.floor(sample.front.angle / count + 0.3)),
            rear=Turn(count * math.floor(sample.rear.angle / count + 0.8)),
        )
        for sample in rolled(rate)
    ]
    summary = summarize(trial(seen))
    coarse = counts <= 400
    assert summary.complete != coarse
    assert ('too coarse for the band' in summary.sentence) == coarse
    assert summary.resolution_percent == pytest.approx(2400.0 / counts if counts <= 4096 else 0.0, abs=1e-3)
    assert coarse or summary.state is PairState.SYNCHRONIZED


SPEEDS = {
    'none': lambda samples, i: (math.nan, math.nan),
    'those of a moment ago': lambda samples, i: (samples[max(i - 20, 0)].front.rate, samples[max(i - 20, 0)].rear.rate),
    'all the same': lambda samples, i: (1.0, 1.0),
    'noisy': lambda samples, i: (
        samples[i].front.rate + math.sin(1e3 * i * i),
        samples[i].rear.rate + math.cos(1e3 * i * i),
    ),
}


@pytest.mark.parametrize(('coupler', 'steps'), [((5.25, 100.0), 38), ((16.0, 10.0), 6), ((41.1, 14.7), None)])
@pytest.mark.parametrize('rate', [60, 200])
@pytest.mark.parametrize('speeds', SPEEDS)
def test_steps_to_synchronization_rest_on_the_rotations_whatever_the_speeds_are(speeds, rate, coupler, steps):
    """The last one's limit cycle swings by 0.6 % beyond the band: it is never in step."""
    samples = rolled(rate, *coupler)
    told = [SPEEDS[speeds](samples, i) for i in range(len(samples))]
    seen = [
        sample._replace(front=Turn(sample.front.angle, front), rear=Turn(sample.rear.angle, rear))
        for sample, (front, rear) in zip(samples, told, strict=True)
    ]
    summary = summarize(trial(seen))
    assert (summary.steps_to_synchronization, summary.losses_of_synchronization) == (steps, 0)


def test_what_is_too_coarse_depends_on_the_band():
    count = math.tau / 720
    seen = [
        sample._replace(**{wheel: Turn(count * math.floor(getattr(sample, wheel).angle / count))})
        for sample in rolled(200)
        for wheel in ('front',)
    ]
    for band, complete in ((6.0, True), (1.7, True), (1.6, False)):
        params = TrialParams(sync=SyncParams(band_percent=band))
        assert summarize(analyze([batch(seen)], params)).complete is complete


def test_a_synchronizer_that_was_in_fault_is_said():
    start_ns = WALK[0].stamp_ns
    acts = ((start_ns, 'active'), (start_ns + 5 * SECOND, 'fault'), (start_ns + 7 * SECOND, 'disabled'))
    faulty = summarize(trial(WALK)._replace(acts=acts))
    assert 'The synchronizer was in fault for 2.0 of 20.0 s, from 5.0 s on' in faulty.sentence
    assert faulty.complete
    assert 'fault' not in summarize(trial(WALK)._replace(acts=acts[:1])).sentence


def test_a_trial_that_ends_within_the_band_too_early_is_not_said_to_be_outside():
    entered = summarize(trial(WALK)).steps_to_synchronization
    strikes = [fall.stamp_ns for fall in trial(WALK).footfalls if fall.wheel == 'front']
    summary = summarize(trial([sample for sample in WALK if sample.stamp_ns < strikes[entered] + SECOND // 10]))
    assert abs(summary.final_phase_percent - 50.0) < 6.0
    assert summary.sentence.startswith('Not synchronized')
    assert 'within ±6 % of 50 %, but not for 3 whole steps' in summary.sentence


def ended(strikes: int) -> list[JointSample]:
    """A trial that starts in step, and ends just after so many strikes of the front wheel."""
    samples = walk(5.0, p0=0.52).samples()
    falls = [fall.stamp_ns for fall in trial(samples).footfalls if fall.wheel == 'front']
    return [sample for sample in samples if sample.stamp_ns < falls[strikes - 1] + SECOND // 50]


@pytest.mark.parametrize(
    ('samples', 'steps'),
    [
        (WALK[:2], '0 steps'),
        (WALK[:3], '0 steps'),
        (WALK[:100], '0 steps'),
        (ended(1), '1 step'),
        (ended(2), '2 steps'),
    ],
)
def test_fewer_strikes_than_could_make_a_pair_synchronized_are_too_little_to_judge(samples, steps):
    summary = summarize(trial(samples))
    assert (summary.state, summary.synchronized, summary.complete) == (PairState.CONVERGING, None, False)
    assert summary.reason == f'{steps} of the 3 that a verdict takes'
    assert summary.sentence.startswith(f'Too little to judge: {summary.reason}, from ')


def test_as_many_strikes_as_the_rule_needs_are_enough_either_way():
    near = summarize(trial(ended(3)))
    assert (near.state, near.steps_to_synchronization, near.complete) == (PairState.SYNCHRONIZED, 0, True)
    far = summarize(trial(WALK[:450]))
    assert (far.front_steps, far.synchronized, far.reason, far.complete) == (3, False, None, True)
    params = TrialParams(sync=SyncParams(hold_steps=4))
    assert not summarize(analyze([batch(WALK[:450])], params)).complete


def test_wheels_that_stall_in_their_first_step_are_judged():
    first = ended(1)[-1]
    stands = [
        first._replace(stamp_ns=first.stamp_ns + i * SECOND // RATE, front=Turn(first.front.angle + 0.03 * math.sin(i)))
        for i in range(1, 4 * RATE)
    ]
    summary = summarize(trial([*ended(1), *stands]))
    assert (summary.state, summary.reason) == (PairState.STALLED, None)


def test_wheels_that_were_held_throughout_have_no_verdict(tmp_path):
    summary = summarize(trial(held(5.0)))
    assert (summary.state, summary.synchronized, summary.steps_to_synchronization) == (PairState.HELD, None, None)
    assert not summary.complete
    assert summary.reason in summary.sentence
    write_results(trial(held(5.0)), tmp_path, {})
    told = json.loads((tmp_path / 'summary.json').read_text())
    assert (told['state'], told['synchronized'], told['reason']) == ('held', None, summary.reason)
    assert not (tmp_path / 'trial.png').exists()


def test_where_nothing_came_there_are_no_data(tmp_path):
    empty = analyze([], TrialParams())
    summary = summarize(empty)
    assert (summary.state, summary.synchronized, summary.complete) == (PairState.NO_DATA, None, False)
    write_results(empty, tmp_path, {})
    assert json.loads((tmp_path / 'summary.json').read_text())['state'] == 'no_data'
    assert not (tmp_path / 'trial.png').exists()


def test_a_pause_takes_nothing_back():
    half = len(WALK) // 2
    rest = [
        WALK[half]._replace(
            stamp_ns=WALK[half].stamp_ns + (i + 1) * SECOND // RATE,
            front=Turn(WALK[half].front.angle, 0.0),
            rear=Turn(WALK[half].rear.angle, 0.0),
        )
        for i in range(5 * RATE)
    ]
    summary = summarize(trial([*WALK[: half + 1], *rest]))
    assert summary.state is PairState.SYNCHRONIZED
    assert summary.complete


def test_stamps_that_stand_still_are_refused_and_counted():
    stuck = [sample._replace(stamp_ns=WALK[0].stamp_ns) if i < 100 else sample for i, sample in enumerate(WALK)]
    summary = summarize(trial(stuck))
    assert summary.samples.refused == {'repeated': 99}
    assert not summary.complete
    assert '99 of 4000 joint states were refused: the stamp stands still.' in summary.sentence


def test_lost_samples_are_said_though_the_verdict_rests_on_all_that_there_is():
    kept = [sample for i, sample in enumerate(WALK) if not 3000 <= i < 3040]  # long in step
    summary = summarize(trial(kept))
    assert (summary.samples.lost, summary.samples.gaps) == (40, 1)
    assert summary.samples.longest_gap_s == pytest.approx(0.205)
    assert summary.complete
    assert '40 of 4000 samples are missing, in 1 gap of up to 0.205 s' in summary.sentence
    assert summary.steps_to_synchronization == summarize(trial(WALK)).steps_to_synchronization


def test_a_source_that_starts_anew_is_said_with_when_and_by_how_much():
    half = len(WALK) // 2
    shift = WALK[half - 1].stamp_ns - WALK[0].stamp_ns + 2 * SECOND
    summary = summarize(trial([*WALK[:half], *later(WALK, shift / SECOND)]))
    (restart,) = summary.samples.restarts
    assert restart.cause == 'rotation'
    assert restart.front == pytest.approx(WALK[0].front.angle - WALK[half - 1].front.angle)
    assert summary.judged_from_s == pytest.approx(shift / SECOND)
    assert not summary.complete
    assert 'The source began anew after 10.0 s' in summary.sentence
    assert 'what came before is left out' in summary.sentence
    alone = summarize(trial(WALK))
    assert summary.steps_to_synchronization == alone.steps_to_synchronization
    assert summary.final_band_percent == alone.final_band_percent


def test_a_long_silence_begins_the_judgement_anew_and_is_said():
    kept = [sample for i, sample in enumerate(WALK) if not 1000 <= i < 1500]
    summary = summarize(trial(kept))
    assert not summary.complete
    assert 'No sample of use came for 2.5 s after 5.0 s' in summary.sentence
    assert 'n may be off' in summary.sentence


def test_a_clock_that_was_set_is_said_and_costs_nothing():
    half = len(WALK) // 2
    summary = summarize(trial([*WALK[:half], *later(WALK[half:], 37.0)]))
    assert summary.complete
    assert 'The clock of the source was set by +37 s' in summary.sentence
    assert summary.steps_to_synchronization == summarize(trial(WALK)).steps_to_synchronization
    assert summary.duration_s == pytest.approx(20.0, abs=0.1)


def test_stamps_that_tell_no_time_are_said_and_cost_nothing():
    whole = batch(WALK)
    params = TrialParams()
    summary = summarize(analyze(dated([whole._replace(stamp_ns=whole.stamp_ns // 1000)], params.phase), params))
    assert summary.complete
    assert summary.samples.unstamped == len(WALK)
    assert f'{len(WALK)} joint states had no stamp of use: the time of recording' in summary.sentence
    assert summary.steps_to_synchronization == summarize(trial(WALK)).steps_to_synchronization


@pytest.mark.parametrize('pace', [0.5, 2.0, 20.0])
def test_stamps_that_pass_at_another_pace_are_said(pace):
    """By which wheels may seem to stall."""
    whole, params = batch(WALK), TrialParams()
    stamps = ((whole.stamp_ns - whole.stamp_ns[0]) * pace).astype(np.int64)
    summary = summarize(analyze(dated([whole._replace(stamp_ns=stamps)], params.phase), params))
    assert f'Time passed {pace:g} times as fast by the stamps as by the recording.' in summary.sentence
    assert summary.complete == (summary.state is PairState.SYNCHRONIZED) == (pace < 20.0)


@pytest.mark.parametrize('size', [2, 3, 4, 7])
def test_samples_in_bursts_give_the_same_verdict(size):
    """Stamped on arrival: each burst comes with the last of its samples, one 20 µs after the other."""
    last = [WALK[min(i - i % size + size, len(WALK)) - 1].stamp_ns for i in range(len(WALK))]
    summary = summarize(
        trial([sample._replace(stamp_ns=last[i] + 20_000 * (i % size)) for i, sample in enumerate(WALK)])
    )
    alone = summarize(trial(WALK))
    assert summary.remarks == ()
    assert summary.steps_to_synchronization == pytest.approx(alone.steps_to_synchronization, abs=1)
    assert summary.final_band_percent == pytest.approx(alone.final_band_percent, abs=0.1)


@pytest.mark.parametrize(('rate', 'size'), [(200, 64), (1000, 100)])
@pytest.mark.parametrize('rates', [True, False])
def test_long_bursts_cost_no_step(rate, size, rates):
    """Within which a wheel takes half a step: also before they are known, and without speeds."""
    samples = rolled(rate)
    last = [samples[min(i - i % size + size, len(samples)) - 1].stamp_ns for i in range(len(samples))]
    flushed = [sample._replace(stamp_ns=last[i] + 20_000 * (i % size)) for i, sample in enumerate(samples)]
    if not rates:
        flushed = [one._replace(front=Turn(one.front.angle), rear=Turn(one.rear.angle)) for one in flushed]
    summary = summarize(trial(flushed))
    assert (summary.steps_to_synchronization, summary.remarks) == (38, ())
    assert summary.initial_phase_percent == pytest.approx(21.6, abs=0.3)


def test_joint_states_that_come_twice_cost_nothing():
    summary = summarize(trial([sample for sample in WALK for _ in range(2)]))
    assert (summary.samples.duplicates, summary.samples.refused, summary.complete) == (len(WALK), {}, True)
    assert f'{len(WALK)} joint states came again as they were, and count once.' in summary.sentence
    assert summary.steps_to_synchronization == summarize(trial(WALK)).steps_to_synchronization


def test_of_one_of_a_kind_it_is_said_in_the_singular():
    odd = [*WALK[:3000], WALK[2999], *WALK[3001:3010], WALK[3010]._replace(front=Turn(math.nan, 0.0)), *WALK[3011:]]
    said = summarize(trial(odd)).sentence
    assert '1 of 4000 joint states was refused: a rotation' in said
    assert 'samples are missing, in 2 gaps' in said
    assert '1 joint state came again as it was, and counts once.' in said


def test_rotations_in_revolutions_bring_a_hint_at_the_unit():
    turns = [
        sample._replace(
            **{wheel: Turn(*(value / math.tau for value in getattr(sample, wheel))) for wheel in ('front', 'rear')}
        )
        for sample in WALK
    ]
    summary = summarize(trial(turns))
    assert (summary.samples.hints, summary.complete) == (('revolutions',), False)
    assert 'in revolutions? (parameter unit' in summary.sentence
    assert summarize(trial(WALK)).samples.hints == ()


def test_a_single_sample_of_use_is_no_trial():
    stuck = [sample._replace(stamp_ns=WALK[0].stamp_ns) for sample in WALK]
    summary = summarize(trial(stuck))
    assert (summary.state, summary.reason) == (PairState.NO_DATA, 'a single joint state was of use')


def test_wheels_that_roll_uphill_bring_a_hint_at_the_sign():
    mirrored = [sample._replace(front=Turn(-sample.front.angle, -sample.front.rate)) for sample in WALK]
    summary = summarize(trial(mirrored))
    assert summary.samples.hints == ('front_sign',)
    assert not summary.complete
    assert 'front_sign' in summary.sentence


def test_every_count_is_json(tmp_path):
    half = len(WALK) // 2
    odd = [*WALK[:half], WALK[half]._replace(front=Turn(math.nan, 0.0)), *later(WALK, 30.0)]
    write_results(trial(odd), tmp_path, {})
    told = json.loads((tmp_path / 'summary.json').read_text(), parse_constant=pytest.fail)
    assert told['samples']['refused'] == {'not finite': 1}
    assert told['samples']['restarts'][0]['cause'] == 'rotation'
    assert [remark['rests_on_less'] for remark in told['remarks'][:2]] == [True, True]
    assert np.isfinite(told['duration_s'])


@pytest.mark.parametrize('seconds', [-0.3, 0.2, 0.3, 0.45])
def test_a_clock_that_is_set_a_little_costs_no_step(seconds):
    samples = rolled(RATE)
    half = len(samples) // 3
    summary = summarize(trial(samples[:half] + later(samples[half:], seconds)))
    assert (summary.steps_to_synchronization, summary.complete) == (38, True)
    assert [step.seconds for step in summary.samples.clock_steps] == pytest.approx([seconds])


def test_a_clock_that_is_set_again_and_again_is_told_once():
    samples = [sample for i in range(5) for sample in later(rolled(RATE)[i * 1000 : i * 1000 + 1000], -0.9 * i)]
    summary = summarize(trial(samples))
    assert len(summary.samples.clock_steps) == 4
    assert summary.sentence.count('The clock of the source was set') == 1
    assert 'by -0.9 s to -0.9 s, 4 times, while' in summary.sentence


@pytest.mark.parametrize('rates', [True, False])
@pytest.mark.parametrize('glitch', [-0.1, -0.06, 0.05, 0.1])
def test_a_lone_wild_sample_is_passed_over_and_told(glitch, rates):
    samples = rolled(RATE)
    if not rates:
        samples = [sample._replace(front=Turn(sample.front.angle), rear=Turn(sample.rear.angle)) for sample in samples]
    wild = samples[-300]
    samples = [
        *samples[:-300],
        wild._replace(front=wild.front._replace(angle=wild.front.angle + glitch)),
        *samples[-299:],
    ]
    summary = summarize(trial(samples))
    assert summary.steps_to_synchronization == 38
    assert '1 sample lay apart from both neighbours, and is passed over.' in summary.sentence


def test_speeds_that_are_always_zero_hide_no_beginning():
    samples = rolled(RATE)
    still = [
        sample._replace(front=Turn(sample.front.angle, 0.0), rear=Turn(sample.rear.angle, 0.0)) for sample in samples
    ]
    summary = summarize(trial(still))
    assert summary.steps_to_synchronization == 38
    assert summary.initial_phase_percent == pytest.approx(21.6, abs=0.5)


@pytest.mark.parametrize('at', [0.0, 2.0, 3.6])
def test_wheels_that_a_hand_moves_by_less_than_a_degree_are_held(at):
    """Until they are let go: from then on it is the trial that it would have been."""
    moved = [
        sample._replace(
            front=Turn(sample.front.angle + 0.015 * math.sin(10 * t) ** 2, 0.15 * math.sin(20 * t)),
        )
        if 0.0 < (t := i / RATE - at) < 0.3
        else sample
        for i, sample in enumerate(held(4.0))
    ]
    summary = summarize(trial(moved))
    assert (summary.state, summary.reason) == (PairState.HELD, 'the wheels were held all the time')
    assert summarize(trial(moved + later(WALK, 4.0))).sentence == summarize(trial(WALK)).sentence


@pytest.mark.parametrize(('percent', 'zero'), [(44.0, 0.0), (56.0, 1000.0), (44.0, 30000.0)])
def test_an_error_on_the_edge_of_the_band_is_within(percent, zero):
    pitch = SyncParams().front.alpha * 2.0
    psi = [-0.5 * pitch + round(zero / pitch) * pitch + i / RATE for i in range(10 * RATE)]
    samples = [
        JointSample(SECOND + i * SECOND // RATE, Turn(angle, 1.0), Turn(angle - percent / 100.0 * pitch, 1.0))
        for i, angle in enumerate(psi)
    ]
    assert summarize(trial(samples)).steps_to_synchronization == 0
    outside = [
        sample._replace(rear=Turn(sample.rear.angle - math.copysign(1e-4, percent - 50.0), 1.0)) for sample in samples
    ]
    assert summarize(trial(outside)).state is PairState.CONVERGING


@pytest.mark.parametrize('first', [0, 1])
def test_messages_of_another_robot_take_nothing_from_the_verdict_and_are_told(first):
    """Joints of other names are ignored, also where none of them is this rig's."""
    samples = rolled(RATE)
    arm = batch(samples[:1])._replace(names=('shoulder', 'elbow', 'wrist'))
    pieces = [batch(samples[i : i + 100]) for i in range(0, len(samples), 100)]
    summary = summarize(
        analyze([one for piece in pieces for one in ((arm, piece), (piece, arm))[first]], TrialParams())
    )
    assert (summary.steps_to_synchronization, summary.complete, summary.samples.refused) == (38, True, {})
    assert summary.samples.foreign == len(pieces)
    assert f'{len(pieces)} messages name neither wheel' in summary.sentence


@pytest.mark.parametrize(('front', 'rear'), [(2.0, 1.0), (1.0, 2.0), (1.0, 0.5), (1.5, 1.0)])
def test_a_wheel_that_takes_far_more_steps_than_the_other_is_asked_about(front, rear):
    """The coupler would be torn: its encoder has another gear."""
    geared = [
        sample._replace(front=Turn(front * sample.front.angle), rear=Turn(rear * sample.rear.angle))
        for sample in rolled(RATE)
    ]
    summary = summarize(trial(geared))
    assert (summary.samples.hints, summary.complete) == (('ratio',), False)
    assert 'One wheel takes more steps than the other' in summary.sentence


def test_a_wheel_that_stands_still_has_no_other_gear():
    samples = rolled(RATE)
    stuck = samples[2000].rear.angle
    seen = [sample if i < 2000 else sample._replace(rear=Turn(stuck, 0.0)) for i, sample in enumerate(samples)]
    summary = summarize(trial(seen))
    assert (summary.state, summary.samples.hints) == (PairState.STALLED, ())


def test_a_wrong_zero_is_said_with_what_mends_it_which_then_says_nothing():
    """Both zeros alike leave the phase as it is, but not the steps."""
    off = [
        sample._replace(front=Turn(sample.front.angle + 0.2), rear=Turn(sample.rear.angle - 0.15))
        for sample in rolled(60)
    ]
    summary = summarize(trial(off))
    front, rear = summary.samples.contradictions
    assert (front.parameter, rear.parameter, summary.complete) == ('front_zero', 'rear_zero', False)
    assert (front.value, rear.value) == pytest.approx((0.2, -0.15), abs=0.04)
    assert f'(parameter front_zero; {front.value:.2f} rad would go with its strikes)' in summary.sentence
    params = TrialParams()
    params = params._replace(phase=params.phase._replace(front_zero=0.2, rear_zero=-0.15))
    mended = summarize(analyze([batch(off)], params))
    assert (mended.complete, mended.steps_to_synchronization) == (True, 38)


def test_encoders_of_both_wheels_with_another_gear_are_asked_about():
    geared = [
        sample._replace(front=Turn(2.0 * sample.front.angle), rear=Turn(2.0 * sample.rear.angle))
        for sample in rolled(60)
    ]
    summary = summarize(trial(geared))
    assert not summary.complete
    assert summarize(analyze([batch(geared)], TrialParams(), rolls=False)).complete, 'where it is a person who walks'
    assert [(one.parameter, one.value) for one in summary.samples.contradictions] == [
        ('front.spokes', pytest.approx(6.0)),
        ('rear.spokes', pytest.approx(6.0)),
    ]


@pytest.mark.parametrize('glitch', [-1.0, 0.2, 0.3, 0.5])
def test_wild_samples_of_a_camera_are_refused_and_cost_no_step(glitch):
    """At 60 Hz, within reach of the fastest wheel, but not of one that rolls as it did."""
    samples = rolled(60)
    wild = [
        one._replace(front=one.front._replace(angle=one.front.angle + glitch)) if i % 97 == 50 else one
        for i, one in enumerate(samples)
    ]
    summary = summarize(trial(wild))
    assert (summary.steps_to_synchronization, summary.judged_from_s) == (38, 0.0)
    assert summary.samples.refused == {'outlier': len(samples) // 97}
    assert not summary.complete

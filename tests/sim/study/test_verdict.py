"""What is made of a motion's strikes."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dcdrw_msgs_py.in_step import HOLD_STEPS
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.map.regression import steps_to_stay
from dcdrw_sim.map.return_map import ReturnMap
from dcdrw_sim.model.dynamics import State, hub_distance
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.rigs import rig_at, take
from dcdrw_sim.model.scaling import Scales, dimensional
from dcdrw_sim.motion.ends import End
from dcdrw_sim.motion.ensemble import TOO_FAST, WATCHED_STRIKE, Ensemble, run_ensemble, run_pairs, spread
from dcdrw_sim.study.verdict import BAND, HOLD, Verdict, judge
from tests.sim.rigs import ALPHA, GENTLE, UNCOUPLED, between

SWEEP = preset('paper-sweep').resolved()


def walk(theta2_deg, end=End.TIME, late=1.0, rocked=None, swing=0.0):
    """A pair that walks with these θ2 at the sections, one step per second; backward strikes at section `rocked`."""
    strikes = []
    for k, theta2 in enumerate(theta2_deg):
        if k == rocked:
            strikes += [(2, -1, k - 0.6, (0.0, 1.0, -ALPHA, -1.0)), (2, 1, k - 0.55, (0.0, 1.0, ALPHA, 1.0))]
        strikes += [(2, 1, k - 0.5, (0.0, 1.0, ALPHA, 1.1)), (1, 1, float(k), (ALPHA, 1.2, math.radians(theta2), 1.3))]
    strikes = strikes[1:]  # from the first section on
    # As if the phase went straight from strike to strike, but for a swing to either side of the goal.
    records, phase = np.zeros((1, len(strikes)), WATCHED_STRIKE), 0.5 - math.radians(theta2_deg[0]) / (2 * ALPHA)
    for record, (wheel, direction, t, state) in zip(records[0], strikes, strict=True):
        before, phase = phase, 0.5 - state[2] / (2 * ALPHA) if wheel == 1 else 0.5
        record['wheel'], record['direction'], record['t'], record['state'] = wheel, direction, t, state
        record['low'], record['high'] = min(before, phase, 0.5 - swing / 100), max(before, phase, 0.5 + swing / 100)
    tail = np.array([[0.5, 0.5]])
    return Ensemble(records, np.array([len(strikes)]), np.array([end]), np.array([len(theta2_deg) - 1 + late]), tail)


def judged(*arguments, capacity=50, **options):
    (judgement, sections) = judge(walk(*arguments, **options), spread(RigParams(), 1, {}), capacity)
    return type(judgement)(*(value[0] for value in judgement)), sections


# Verdicts

OUT, IN = [9.0, 7.0, 5.0, 3.0], [0.9, 0.5, -0.3, 0.2, 0.1]
"""θ2 at the section [°]; ±6 % of a step are ±1.8°."""


@pytest.mark.parametrize(
    ('theta2', 'options', 'verdict'),
    [
        (OUT + IN, {}, Verdict.IN_STEP),
        (IN[:1] * (HOLD_STEPS + 1), {}, Verdict.IN_STEP),
        (OUT + IN[3:], {}, Verdict.UNDECIDED),  # not long enough
        ([*OUT, *IN, 1.9], {}, Verdict.UNDECIDED),
        (OUT + IN, {'swing': 6.1}, Verdict.UNDECIDED),
        ([*OUT, *IN, *[0.2] * (HOLD + 1)], {'swing': 6.1}, Verdict.SWINGS),
        ([*OUT, *IN, *[0.2] * (HOLD + 1)], {'swing': 5.9}, Verdict.IN_STEP),
        ([*OUT, -3.0, -4.0, -3.5, -3.2, -3.3], {}, Verdict.UNDECIDED),  # across the band, but never seen within
        ([4.0] * (HOLD + 1), {}, Verdict.ELSEWHERE),
        ([*OUT, *IN, *[1.9] * (HOLD + 1)], {}, Verdict.ELSEWHERE),
        ([15.0, -15.0] * HOLD, {}, Verdict.ELSEWHERE),  # both strike at one instant: before or after, by a hair
        (OUT + IN, {'rocked': 6}, Verdict.STALLS),
        ([9.0, *OUT, *IN], {'rocked': 1}, Verdict.IN_STEP),  # long ago
        (OUT + IN, {'late': 3.5}, Verdict.STALLS),
        (OUT + IN, {'end': End.STALLED}, Verdict.STALLS),
        (OUT + IN, {'end': End.STANDING}, Verdict.STANDS),
        (OUT + IN, {'end': End.FALLEN}, Verdict.FALLS),
        (OUT + IN, {'end': End.HUBS_MET}, Verdict.COLLIDES),
        (OUT + IN, {'end': TOO_FAST}, Verdict.RACES),
        (OUT + IN, {'end': End.STRIKES, 'late': 0.0}, Verdict.IN_STEP),
        ([0.0], {}, Verdict.UNDECIDED),
        ([9.0], {}, Verdict.UNDECIDED),
    ],
)
def test_verdict(theta2, options, verdict):
    assert Verdict(judged(theta2, **options)[0].verdict) is verdict


def test_every_verdict_has_a_meaning_and_the_worst_is_the_largest():
    assert len({verdict.meaning for verdict in Verdict}) == len(Verdict)
    assert list(Verdict) == sorted(Verdict)
    assert Verdict.IN_STEP < Verdict.UNDECIDED < Verdict.SWINGS < Verdict.ELSEWHERE < Verdict.STALLS < Verdict.STANDS


def test_a_motion_of_no_strike_is_undecided():
    nothing = Ensemble(
        np.zeros((1, 4), WATCHED_STRIKE), np.array([0]), np.array([End.TIME]), np.array([0.1]), np.zeros((1, 2))
    )
    judgement, sections = judge(nothing, spread(RigParams(), 1, {}), 3)
    assert judgement.verdict[0] == Verdict.UNDECIDED
    assert math.isnan(judgement.theta2[0])
    assert np.isnan(sections.time).all()


def test_a_motion_whose_extremes_nobody_watched_is_not_judged():
    ensemble = run_ensemble(GENTLE, [(-0.2, 0.1, 0.1, 1.4)], 4.0, 400)
    with pytest.raises(ValueError, match='extremes=True'):
        judge(ensemble, spread(GENTLE, 1, {}), 50)


# The paper's condition


def test_enters_is_told_whatever_comes_after():
    for end in (End.TIME, End.STANDING):
        judgement, _ = judged([9.0, 0.5, 7.0, 8.0], end=end)
        assert judgement.enters
        assert (judgement.steps_to_enter, judgement.time_to_enter) == (1, 1.0)
        assert math.isnan(judgement.steps)


@given(st.lists(between(-3.0, 3.0), min_size=HOLD + 2, max_size=20))
def test_settling_is_staying_within_the_band_at_the_last_sections(theta2):
    judgement, _ = judged(theta2)
    steps = steps_to_stay(np.radians(theta2), 0.0)
    inside = np.abs(np.radians(theta2)) <= BAND
    assert judgement.enters == inside.any()
    assert judgement.settles == inside[-HOLD:].all()
    assert judgement.steps_to_settle == pytest.approx(steps if judgement.settles else math.nan, nan_ok=True)
    if inside.any():
        assert judgement.steps_to_enter == np.argmax(inside)


# In step


def off_the_edge(theta2):
    """Not on the band's edge, 1.8°, where rounding decides."""
    return abs(abs(theta2) - 1.8) > 1e-9


@given(st.lists(between(-5.0, 5.0).filter(off_the_edge), min_size=HOLD_STEPS + 1, max_size=20), between(0.0, 5.0))
def test_steps_are_counted_to_the_strike_that_opens_the_first_step_wholly_inside_for_good(theta2, swing):
    judgement, _ = judged(theta2, swing=swing)
    outside = np.abs(np.radians(theta2)) > 0.06 * 2 * ALPHA
    last = int(np.flatnonzero(outside)[-1]) if outside.any() else -1  # this strike ends one step and opens another
    in_step = len(theta2) - 1 - last >= HOLD_STEPS + (last < 0)
    assert judgement.steps == pytest.approx(last + 1 if in_step else math.nan, nan_ok=True)
    assert judgement.strike_steps == pytest.approx(judgement.steps, nan_ok=True)
    assert judgement.time == pytest.approx(judgement.steps, nan_ok=True)


def test_a_wider_band_is_entered_no_later():
    ensemble, rigs = walk(OUT + IN), spread(RigParams(), 1, {})
    steps = [float(judge(ensemble, rigs, 50, band)[0].steps[0]) for band in (3.0, 12.0, 20.0, 40.0)]
    assert steps == [4, 3, 2, 0]


# Sections


def test_sections_are_those_of_the_return_map():
    return_map = ReturnMap(SWEEP)
    start = return_map.at_phase(0.3)
    ensemble = run_ensemble(SWEEP, [(SWEEP.front.alpha, *start)], 40.0, 200, extremes=True)
    judgement, sections = judge(ensemble, spread(SWEEP, 1, {}), 30)
    count = int(judgement.sections[0])
    states = return_map.iterate(start, count - 1)
    assert count > 15
    assert np.column_stack([value[0, :count] for value in sections[1:]]) == pytest.approx(
        return_map.raw(states), abs=1e-9
    )
    assert np.isnan(sections.time[0, count:]).all()
    assert judgement.theta2[0] == sections.theta2[0, count - 1]
    assert judgement.slips[0] == judgement.step_difference[0] == 0


def test_a_slipped_step_is_told_and_lengthens_the_coupler():
    start = State(SWEEP.front.alpha, 0.36, -0.2, 1.0)  # the rear wheel overtakes
    ensemble = run_ensemble(SWEEP._replace(k=0.0, b=0.0), [start], 30.0, 100, extremes=True)
    judgement, sections = judge(ensemble, spread(SWEEP, 1, {}), 30)
    assert judgement.slips[0] >= 1
    n = int(judgement.step_difference[0])
    assert n < 0
    last = int(judgement.sections[0]) - 1
    state = State(SWEEP.front.alpha, 0.0, sections.theta2[0, last], 0.0)
    assert sections.coupler_length[0, last] == pytest.approx(
        hub_distance(SWEEP, state, SWEEP.S0 + n * SWEEP.front.step_length), abs=1e-12
    )


def test_what_there_is_no_room_for_is_still_judged():
    judgement, sections = judged(OUT + IN, capacity=2)
    assert judgement.verdict == Verdict.IN_STEP
    assert judgement.sections == 9
    assert sections.time.tolist() == [[0.0, 1.0]]


# Real motions


def test_verdicts_of_motions_that_are_known():
    start = (SWEEP.front.alpha, *ReturnMap(SWEEP).at_phase(0.3))
    rigs = spread(
        SWEEP,
        5,
        {
            'b': [3.0, 1.0, 0.0, 0.15, 0.15],
            'k': [5e-3, 5e-3, 0.0, 5e-3, 5e-3],
            'slope': [SWEEP.slope] * 3 + [-0.02, SWEEP.slope],
        },
    )
    judgement, _ = judge(run_pairs(rigs, [start] * 5, 200.0, 1000, extremes=True), rigs, 200)
    assert [*map(Verdict, judgement.verdict)] == [
        Verdict.IN_STEP,
        Verdict.STANDS,
        Verdict.ELSEWHERE,
        Verdict.STANDS,
        Verdict.SWINGS,
    ]  # uncoupled wheels keep their phase


def test_a_wheel_that_rocks_when_time_is_over_has_stalled():
    ensemble = run_ensemble(GENTLE, [(-0.2, 0.1, 0.1, 1.4)], 4.0, 400, extremes=True)
    assert judge(ensemble, spread(GENTLE, 1, {}), 50)[0].verdict[0] == Verdict.STALLS
    assert (
        judge(run_ensemble(UNCOUPLED, [(-0.1, -1.5, 0.1, 1.4)], 6.0, 400, extremes=True), spread(GENTLE, 1, {}), 50)[
            0
        ].verdict[0]
        == Verdict.FALLS
    )


@settings(max_examples=20, deadline=None)
@given(between(0.05, 0.95), between(0.0, 1e-2), between(0.0, 3.0))
def test_units_do_not_matter_to_a_judgement(phase, k, b):
    scales = Scales(0.9652, 10.0, 9.81)
    rig = SWEEP._replace(k=k, b=b)
    judgements = []
    for one, time in ((rig, 1.0), (dimensional(rig, scales), scales.time)):
        start = (one.front.alpha, *ReturnMap(one).at_phase(phase))
        judgements.append(
            judge(run_ensemble(one, [start], 60.0 * time, 600, extremes=True), spread(one, 1, {}), 100)[0]
        )
    assert judgements[0].sections[0] == judgements[1].sections[0]
    assert judgements[0].theta2[0] == pytest.approx(judgements[1].theta2[0], abs=1e-6)


def test_take_gives_the_rigs_of_some():
    rigs = spread(RigParams(), 3, {'front.mass': [8.0, 9.0, 10.0]})
    assert take(rigs, np.array([2, 0])).front.mass.tolist() == [10.0, 8.0]
    assert rig_at(rigs, 1).front.mass == 9.0

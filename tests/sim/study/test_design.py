"""Choosing the coupler."""

import math

import numpy as np
import pytest

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.model.scaling import nondimensional
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.study.design import Task, assess, mesh, score, search, worst_cases
from dcdrw_sim.study.points import judge_points, study
from dcdrw_sim.study.sweep import default_seconds
from dcdrw_sim.study.verdict import Verdict

RIG = RigParams()
TASK = Task(RIG, default_seconds(RIG))
QUICK = Task(RIG, default_seconds(RIG) / 10, phases=(0.2, 0.7))
RANGES = (1.0, 100.0), (1.0, 100.0)


def test_score_is_the_judgement_of_each_point():
    k, b = np.array([5.25, 12.0, 30.0]), np.array([100.0, 8.0, 1.0])
    scores = score(TASK, k, b)
    for index in range(3):
        found = judge_points(spread(RIG._replace(k=k[index], b=b[index]), 1, {}), TASK.seconds)
        assert scores.verdict[index] == found['verdict'][0]
        assert scores.steps[index] == found['steps'][0]
        assert scores.mean_steps[index] == found['start_steps'].mean()


def test_score_does_not_depend_on_units():
    reduced, scales = nondimensional(RIG)
    k, b = mesh((1.0, 50.0), (2.0, 200.0))
    some = slice(0, None, 50)
    here = score(TASK, k[some], b[some])
    there = score(Task(reduced, TASK.seconds / scales.time), k[some] / scales.stiffness, b[some] / scales.damping)
    np.testing.assert_array_equal(here.verdict, there.verdict)
    np.testing.assert_array_equal(here.steps, there.steps)


def test_order_goes_from_coming_into_step_fast_to_not_at_all():
    scores = score(TASK, np.array([5.25, 12.0, 0.01]), np.array([100.0, 8.0, 1000.0]))
    assert scores.order().tolist() == [1, 0, 2]
    assert math.isnan(scores.steps[2])


def test_wheels_that_do_not_roll_stall():
    scores = score(TASK, np.full(2, 16.0), np.full(2, 10.0), np.radians([1.0, 2.0]))  # they roll from 1.083° on
    assert [Verdict(verdict) for verdict in scores.verdict] == [Verdict.STALLS, Verdict.IN_STEP]


def test_search_finds_no_worse_than_its_first_look_within_the_bounds():
    progress = []
    found = search(QUICK, *RANGES, report=progress.append)
    fastest = score(QUICK, *(np.array([value]) for value in found.fastest))
    assert fastest.steps[0] <= np.nanmin(found.grid.steps)
    for pair in (found.fastest, found.forgiving):
        assert all(low <= value <= high for value, (low, high) in zip(pair, RANGES, strict=True))
    pairs = np.array([found.fastest, found.forgiving]).T
    assert worst_cases(QUICK, *pairs, 0.3).order[0] == 1 or found.fastest == found.forgiving


def test_what_is_fastest_but_swings_beyond_the_band_on_a_slope_a_little_gentler_is_not_forgiving():
    k, b = np.array([60.0, 47.81]), np.array([43.01, 58.68])
    assert score(TASK, k, b).order()[0] == 0
    assert worst_cases(TASK, k, b, 0.0).order[0] == 1


def test_margins_are_where_coming_into_step_ends():
    found = assess(TASK, 22.0, 8.0)
    slope = found.margins['slope']
    assert 0.9 < slope.low < 1.0
    inside, outside = (
        score(TASK, np.array([22.0]), np.array([8.0]), np.array([factor * slope.low * RIG.slope]))
        for factor in (1.0 + 1e-9, 0.995)
    )
    assert inside.verdict[0] == Verdict.IN_STEP
    assert outside.verdict[0] > Verdict.IN_STEP
    stiff = found.margins['k']
    assert score(TASK, np.array([22.0 * stiff.high]), np.array([8.0])).verdict[0] == Verdict.IN_STEP
    assert score(TASK, np.array([22.0 * stiff.high * 1.005]), np.array([8.0])).verdict[0] > Verdict.IN_STEP


def test_masses_only_scale_the_coupler():
    found = assess(TASK, 22.0, 8.0)
    heavier = next(one for one in found.sensitivity if one.parameter == 'mass' and one.factor > 1.0)
    lighter = score(TASK, np.array([22.0 / 1.3]), np.array([8.0 / 1.3]))
    assert heavier.steps == lighter.steps[0]


CONTRACT = (
    # k, b; swing of the limit cycle; steps and strike steps from the worst of nine starts
    (5.25, 100.0, (47.19, 52.70), 45, 45),
    (16.0, 10.0, (44.13, 55.83), 6, 3),
    (41.1, 14.7, (43.37, 56.58), None, 2),
)


@pytest.mark.parametrize(('k', 'b', 'swing', 'steps', 'strike_steps'), CONTRACT)
def test_the_contract_s_couplers(k, b, swing, steps, strike_steps):
    found = study(spread(RIG, 1, {'k': k, 'b': b}), TASK.seconds)
    assert (50.0 + found.cycles.swings[0]) == pytest.approx(swing, abs=0.005)
    assert found.steps.max() == pytest.approx(steps or math.nan, nan_ok=True)
    assert found.motions.strike_steps.max() == strike_steps
    assert found.verdicts.max() == (Verdict.IN_STEP if steps else Verdict.SWINGS)


def test_the_paper_s_trial_takes_38_steps_and_22_at_strikes():
    found = study(spread(RIG, 1, {}), TASK.seconds, (0.216,))
    assert (found.steps[0, 0], found.motions.strike_steps[0]) == (38, 22)


def test_beyond_the_fold_nothing_is_in_step_for_good_however_long_it_holds():
    slopes = np.radians([1.4485, 1.4495])
    found = study(spread(RIG, 2, {'slope': slopes}), TASK.seconds)
    assert np.isfinite(found.motions.steps).all()  # by the clock all are
    assert np.isfinite(found.steps).all(axis=1).tolist() == [False, True]
    later = study(spread(RIG, 1, {'slope': math.radians(1.44)}), 100.0)
    assert (later.verdicts == Verdict.STANDS).all()


@pytest.mark.parametrize('wheel', [WheelParams(spokes=6), WheelParams(spokes=8)])
def test_a_rig_that_does_not_roll_is_refused(wheel):
    with pytest.raises(ValueError, match='too gentle'):
        search(Task(RigParams(wheel, wheel), 10.0), *RANGES)


@pytest.mark.parametrize('bounds', [((2.0, 1.0), (1.0, 2.0)), ((0.0, 1.0), (1.0, 2.0))])
def test_impossible_bounds_are_refused(bounds):
    with pytest.raises(ValueError, match='bounds'):
        search(TASK, *bounds)

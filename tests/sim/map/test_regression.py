from itertools import pairwise

import numpy as np
import pytest

from dcdrw_sim.map.regression import fit_affine, fit_raw, measure, steps_to_stay
from dcdrw_sim.map.return_map import ReturnMap, SectionState
from dcdrw_sim.model.presets import preset

MAP = ReturnMap(preset('paper-sweep'))
WEAK = ReturnMap(preset('paper-sweep')._replace(k=1e-4, D0=1.0))
FIXED = MAP.fixed_point()
KICKS = 1e-5 * np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 1, 1], [0, -1, 2]])
NEAR = [MAP.iterate(SectionState(*(np.array(FIXED.state) + kick).tolist()), 6) for kick in KICKS]
"""Trials so near the fixed point that the map is linear."""


# The paper's defect (erratum 5)


@pytest.mark.parametrize(('k', 'b'), [(5e-3, 0.15), (1e-2, 0.2), (1e-3, 3.0)])
def test_raw_has_an_eigenvalue_1_whatever_the_coupler(k, b):
    return_map = ReturnMap(preset('paper-sweep')._replace(k=k, b=b))
    trials = [return_map.iterate(return_map.at_phase(phase), 60) for phase in (0.2, 0.4, 0.6, 0.8)]
    raw, affine = fit_raw(map(return_map.raw, trials)), fit_affine(trials)
    assert raw.eigenvalues[0] == pytest.approx(1.0, abs=1e-4)
    assert abs(affine.eigenvalues[0]) < 0.98


def test_that_eigenvalue_is_the_fixed_point_which_does_not_vanish():
    fixed = MAP.raw([FIXED.state])[0]
    assert abs(fixed).min() > 0.01  # θ1′, θ2, θ2′ and D
    raw = fit_raw(map(MAP.raw, NEAR))
    assert raw.eigenvalues[0] == pytest.approx(1.0, abs=1e-7)
    assert raw.matrix @ fixed == pytest.approx(fixed, abs=1e-7)  # A x* = x*: its eigenvector
    assert abs(raw.eigenvalues[1:]) == pytest.approx(abs(FIXED.multipliers), abs=1e-3)  # hidden behind it


def test_data_at_rest_on_the_fixed_point_give_that_eigenvalue_alone():
    still = fit_raw([np.tile(MAP.raw([FIXED.state]), (10, 1))])
    assert still.rank == 1
    assert still.eigenvalues == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-12)
    assert still.condition > 1e20


# The corrected form


def test_affine_gives_the_exact_multipliers_for_small_deviations():
    for fit in (fit_affine(NEAR), fit_affine(NEAR, FIXED.state)):
        assert fit.rank == 3
        assert fit.eigenvalues == pytest.approx(FIXED.multipliers, abs=2e-4)
        assert fit.matrix == pytest.approx(FIXED.derivative, abs=1e-3)
        assert fit.matrix @ FIXED.state + fit.offset == pytest.approx(np.array(FIXED.state), abs=1e-8)


def test_the_section_has_three_independent_coordinates():  # erratum 4
    four = fit_affine(map(MAP.raw, NEAR), tolerance=1e-4)
    assert four.rank == 3  # D is a function of θ2
    assert four.eigenvalues == pytest.approx([*FIXED.multipliers, 0.0], abs=1e-3)


# Least squares


def test_raw_is_the_papers_a_equal_to_b_p():
    trials = [MAP.raw(MAP.iterate(MAP.at_phase(phase), 20)) for phase in (0.3, 0.6, 0.8)]
    inverse = sum(np.outer(x, x) for states in trials for x in states[:-1])
    B = sum(np.outer(y, x) for states in trials for x, y in pairwise(states))
    raw = fit_raw(trials)
    assert raw.matrix == pytest.approx(B @ np.linalg.inv(inverse), abs=1e-6)
    assert raw.condition == pytest.approx(np.linalg.cond(inverse), rel=1e-4)
    assert not raw.offset.any()


def test_each_form_finds_a_map_of_its_own_form():
    random = np.random.default_rng(1)
    A, c = random.normal(size=(3, 3)) / 3, random.normal(size=3)
    for offset, fit in ((0.0 * c, fit_raw), (c, fit_affine)):
        trials = [[random.normal(size=3)] for _ in range(4)]
        for states in trials:
            for _ in range(5):
                states.append(A @ states[-1] + offset)
        found = fit(trials)
        assert found.matrix == pytest.approx(A, abs=1e-12)
        assert found.offset == pytest.approx(offset, abs=1e-12)


def test_where_data_are_missing_the_rank_tells():
    x = np.array([3.0, 4.0])
    found = fit_raw([[x, 0.5 * x, 0.25 * x]])
    assert found.rank == 1
    assert found.eigenvalues == pytest.approx([0.5, 0.0])
    assert found.matrix @ [4.0, -3.0] == pytest.approx([0.0, 0.0], abs=1e-15)


@pytest.mark.parametrize('trajectories', [[], [np.ones((1, 3))]])
def test_nothing_to_fit_is_told(trajectories):
    for fit in (fit_raw, fit_affine):
        with pytest.raises(ValueError, match='needs a trajectory of at least two'):
            fit(trajectories)


# Steps


@pytest.mark.parametrize(
    ('values', 'steps'),
    [([5, 3, 0.5, 3, 0.9, -0.9], 4), ([0.0, 0.1], 0), ([5, 3, 2], None), ([0, 0, 2], None), ([5, 0], 1), ([], None)],
)
def test_steps_count_until_the_values_stay(values, steps):
    assert steps_to_stay([10 + value for value in values], 10, 1.0) == steps


def test_all_measures_stand_side_by_side():
    found = measure(MAP, phases=(0.2, 0.5), steps=30)
    assert found.fixed_point.state == pytest.approx(FIXED.state, abs=1e-10)
    assert [trial.steps_to_cycle for trial in found.trials] == [21, 0]
    inside = abs(np.degrees(found.trials[0].states[:, 1] - FIXED.state.theta2)) <= 1.0
    assert not inside[20]
    assert inside[21:].all()
    assert found.raw.matrix.shape == (4, 4)
    assert found.affine.matrix.shape == (3, 3)


STIFF = preset('paper-sweep')._replace(k=1000.0)


def test_a_trial_that_does_not_walk_on_is_told_and_left_out():
    found = measure(ReturnMap(STIFF._replace(b=10.0)), phases=(0.9, 0.3), steps=5)
    rocked, whole = found.trials
    assert (rocked.steps_to_cycle, rocked.states.shape) == (None, (0, 3))
    assert 'rocked back' in rocked.trouble
    assert not whole.trouble
    assert found.affine.matrix == pytest.approx(fit_affine([whole.states]).matrix)


def test_the_fixed_point_is_told_where_every_trial_fails():
    found = measure(ReturnMap(STIFF._replace(b=1.0)), phases=(0.9,), steps=5)
    assert found.raw is None
    assert found.affine is None
    assert found.fixed_point.derivative.shape == (3, 3)
    assert 'rocked back' in found.trials[0].trouble


def test_trials_are_those_of_the_map_step_by_step():
    (trial,) = measure(MAP, phases=(0.2,), steps=30).trials
    assert trial.states == pytest.approx(MAP.iterate(MAP.at_phase(0.2), 30), rel=0, abs=1e-12)

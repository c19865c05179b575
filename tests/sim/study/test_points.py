"""Many rigs judged at once: what each of the direct functions says of one."""

import math

import numpy as np
import pytest
from hypothesis import given, settings

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.map.regression import TRIAL_PHASES, fit_affine, fit_raw
from dcdrw_sim.map.return_map import ReturnMap
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.scaling import nondimensional
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.study.points import judge_points, section_room
from dcdrw_sim.study.sweep_dataset import VARIABLES
from dcdrw_sim.study.verdict import Verdict
from tests.sim.rigs import GENTLE, UNCOUPLED, between

SWEEP = preset('paper-sweep').resolved()
SIN = math.sin(math.pi / 12)
TABLE = np.array(
    [  # contract §3: D0, k̂, b̂, θ2* [deg], moduli
        (1.0, 1e-4, 0.15, -0.615, 0.9477, 0.7826, 0.394),
        (1.0, 1e-3, 0.3, -0.128, 0.9166, 0.8298, 0.1845),
        (1.0 + SIN, 5e-3, 0.15, -0.863, 0.8911, 0.7829, 0.4188),
        (1.0 + SIN, 1e-2, 0.2, -0.933, 0.8450, 0.7976, 0.3429),
        (1.0 + SIN, 1e-3, 3.0, -0.971, 0.9481, 0.8078, 0.000),
    ]
)
STARTS = (0.3, 0.5, 0.8)


def judged(rig, seconds, phases=STARTS, **columns):
    count = max([1, *(np.size(column) for column in columns.values())])
    return judge_points(spread(rig, count, columns), seconds, phases)


def test_the_contract_s_table_from_trajectories():
    D0, k, b, theta2_deg = TABLE[:, :4].T
    found = judged(SWEEP, 200.0, TRIAL_PHASES, D0=D0, k=k, b=b)
    assert np.degrees(found['cycle_theta2']) == pytest.approx(theta2_deg, abs=0.01)
    assert found['multipliers'] == pytest.approx(TABLE[:, 4:], abs=1e-3)
    assert found['stable'].all()
    assert found['raw_eigenvalues'][:, 0] == pytest.approx(1.0, abs=2e-3)
    assert (found['affine_eigenvalues'][:, 0] < 0.99).all()
    assert found['verdict'].tolist() == [Verdict.SWINGS] * 4 + [Verdict.IN_STEP]
    assert (abs(found['cycle_low']) > 6.0).tolist() == [True] * 4 + [False]


def test_a_point_is_what_the_direct_functions_say():
    return_map = ReturnMap(SWEEP)
    found = {name: value[0] for name, value in judged(SWEEP, 60.0).items()}
    fixed = return_map.fixed_point()
    cycle = [found[f'cycle_{name}'] for name in ('omega1', 'theta2', 'omega2')]
    assert cycle == pytest.approx(list(fixed.state), abs=1e-10)
    assert found['cycle_period'] == pytest.approx(fixed.period)
    assert found['multipliers'] == pytest.approx(abs(fixed.multipliers), abs=1e-7)
    trials = [
        return_map.iterate(return_map.at_phase(phase), int(count) - 1)
        for phase, count in zip(STARTS, found['start_sections'], strict=True)
    ]
    for states, *columns in zip(
        trials, *(found[f'section_{name}'] for name in ('omega1', 'theta2', 'omega2', 'coupler_length')), strict=True
    ):
        assert np.array(columns)[:, : len(states)].T == pytest.approx(return_map.raw(states), abs=1e-8)
    raw, affine = fit_raw(map(return_map.raw, trials)), fit_affine(trials)
    assert found['raw_eigenvalues'] == pytest.approx(abs(raw.eigenvalues), abs=1e-5)
    assert found['affine_eigenvalues'] == pytest.approx(abs(affine.eigenvalues), abs=1e-6)
    assert (found['raw_rank'], found['affine_rank']) == (raw.rank, affine.rank) == (4, 3)


def test_angles_and_moduli_are_those_of_complex_numbers():
    found = judged(SWEEP, 60.0, k=1e-2, b=np.linspace(0.02, 0.08, 4))
    values = found['affine_eigenvalues'] * np.exp(1j * found['affine_eigenvalue_angles'])
    assert (found['affine_eigenvalue_angles'] != 0.0).any()
    assert values.imag.sum(axis=1) == pytest.approx(0.0, abs=1e-12)  # in conjugate pairs


def test_what_the_starts_have_in_common():
    found = judged(SWEEP, 100.0, (0.35, 0.5, 0.65), k=[5e-3, 1e-2, 5e-3], b=[0.15, 3.0, 1.0])
    starts = found['start_verdict']
    assert found['verdict'].tolist() == starts.max(axis=1).tolist()
    assert found['in_step'].tolist() == [np.mean(row == Verdict.IN_STEP) for row in starts]
    assert found['settles'].tolist() == found['start_settles'].mean(axis=1).tolist()
    assert found['enters'].tolist() == found['start_enters'].mean(axis=1).tolist()
    assert found['in_step'][1] == 1.0
    assert found['steps'][1] == found['start_steps'][1].max()
    assert found['strike_steps'][1] == found['start_strike_steps'][1].max()
    assert found['time'][1] == found['start_time'][1].max()
    assert math.isnan(found['steps'][2])  # the stall
    assert found['verdict'][2] == Verdict.STANDS
    for name in ('cycle_theta2', 'speed', 'strike_loss', 'damper_loss'):
        assert np.isfinite(found[name]).tolist() == [True, True, False]
    assert found['raw_rank'].tolist() == [4, 4, 0]
    assert np.isnan(found['raw_eigenvalues'][2]).all()


def test_a_point_depends_on_no_other():
    k, b = np.geomspace(1e-4, 1e-2, 7), np.geomspace(0.1, 10.0, 7)
    rigs = {'k': k, 'b': b}
    together = judge_points(spread(SWEEP, 7, rigs), 80.0, STARTS, room=60)
    for index in range(7):
        alone = judge_points(spread(SWEEP, 1, {'k': k[index], 'b': b[index]}), 80.0, STARTS, room=60)
        for name, value in alone.items():
            whole = together[name][index : index + 1]
            if name.startswith('section_'):
                assert np.isnan(whole[..., value.shape[-1] :]).all()
                whole = whole[..., : value.shape[-1]]
            assert np.ascontiguousarray(whole).tobytes() == np.ascontiguousarray(value).tobytes(), name


@settings(max_examples=10, deadline=None)
@given(between(1.0, 20.0), between(0.5, 1.5), between(0.0, 60.0), between(5.0, 100.0))
def test_units_do_not_matter(mass, length, k, b):
    wheel = RigParams().front._replace(mass=mass, length=length)
    rig = RigParams(wheel, wheel, k=k * mass / 10.0, b=b * mass / 10.0, slope=math.radians(3.0))
    bare, scales = nondimensional(rig)
    one, other = judged(rig, 30.0 * scales.time, (0.4,)), judged(bare, 30.0, (0.4,))
    assert one['cycle_theta2'] == pytest.approx(other['cycle_theta2'], abs=1e-8, nan_ok=True)
    assert one['multipliers'] == pytest.approx(other['multipliers'], abs=1e-6, nan_ok=True)
    assert one['speed'] == pytest.approx(other['speed'] * scales.length / scales.time, rel=1e-8, nan_ok=True)
    assert one['strike_loss'] == pytest.approx(other['strike_loss'] * scales.force, rel=1e-8, nan_ok=True)


def test_uncoupled_wheels_walk_on_at_every_phase():
    found = judged(UNCOUPLED, 20.0, (0.2, 0.45, 0.5))
    assert found['start_verdict'][0].tolist() == [Verdict.ELSEWHERE, Verdict.SWINGS, Verdict.SWINGS]
    assert found['start_settles'][0].tolist() == [False, False, True]
    assert np.degrees(found['start_theta2'][0]) == pytest.approx([9.0, 1.5, 0.0], abs=1e-6)
    assert found['multipliers'][0, 0] == pytest.approx(1.0, abs=1e-6)
    assert not found['stable'][0]


def test_wheels_that_step_differently_far_are_judged_but_have_no_cycle():
    found = judged(RigParams(), 20.0, **{'rear.spokes': [12.0, 14.0]})
    assert np.isfinite(found['speed']).tolist() == [True, False]
    assert found['verdict'][1] > Verdict.IN_STEP


def test_there_is_room_for_every_section():
    rigs = spread(SWEEP, 1, {})
    assert section_room(rigs, 200.0) > judged(SWEEP, 200.0)['start_sections'].max()


def test_too_gentle_a_slope_is_refused():
    with pytest.raises(ValueError, match='too gentle for the front wheel'):
        judged(GENTLE, 10.0)


def test_every_variable_is_declared():
    assert {*judged(SWEEP, 10.0)} == {variable.name for variable in VARIABLES}

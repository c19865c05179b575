import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.wheel import limit_cycle_speed
from dcdrw_sim.motion import trajectory
from dcdrw_sim.motion.ends import BACKWARD, End, MotionError
from dcdrw_sim.motion.ensemble import run_ensemble
from tests import ROOT
from tests.patience import PATIENCE
from tests.sim.rigs import ALPHA, GENTLE, UNCOUPLED, UNEQUAL, between, rigs, rolling, starts

few = settings(max_examples=25, deadline=None)

SWEEP = preset('paper-sweep').resolved()


def sweep(count=60, seed=1):
    """Starts and columns from the paper's sweep, in no order."""
    rng = np.random.default_rng(seed)
    theta2 = rng.uniform(-0.9, 0.9, count) * SWEEP.front.alpha
    speed = limit_cycle_speed(SWEEP.front, SWEEP.slope, 1.0)
    states = np.column_stack(
        [
            np.full(count, -SWEEP.front.alpha),
            np.full(count, speed),
            theta2,
            limit_cycle_speed(SWEEP.front, SWEEP.slope, 1.0, theta2),
        ]
    )
    return states, {'k': 10.0 ** rng.uniform(-4, -2, count), 'b': 10.0 ** rng.uniform(-1, 1, count)}


def strikes(ensemble, index):
    return ensemble.strikes[index, : ensemble.counts[index]]


def assert_agrees(ensemble, index, run, time=1e-9, state=1e-8):
    got = strikes(ensemble, index)
    assert End(ensemble.ends[index]) == run.end
    assert [(s['wheel'], s['direction']) for s in got] == [(s.wheel, s.direction) for s in run.strikes]
    if run.strikes:
        assert got['t'] == pytest.approx([s.t for s in run.strikes], abs=time)
        assert np.abs(got['state'] - [s.state for s in run.strikes]).max() < state


# What a pair does


@few
@given(rigs, st.lists(starts, min_size=1, max_size=4))
def test_a_pair_does_what_it_does_alone(rig, parts):
    states = [rolling(rig, *part) for part in parts]
    ensemble = run_ensemble(rig, states, 3.0, 40)
    for index, state in enumerate(states):
        run = trajectory.run(rig, state, 3.0, 40)
        # Strikes at one instant, or at the end, may fall on either side.
        assume(np.diff([*(strike.t for strike in run.strikes), 3.0]).min(initial=1.0) > 1e-6)
        assert_agrees(ensemble, index, run)


def test_the_paper_s_sweep_agrees_for_a_hundred_time_units():
    states, columns = sweep()
    ensemble = run_ensemble(SWEEP, states, 100.0, 400, **columns)
    errors = []
    for index, state in enumerate(states):
        rig = SWEEP._replace(**{name: float(values[index]) for name, values in columns.items()})
        run = trajectory.run(rig, State(*map(float, state)), 100.0)
        assert_agrees(ensemble, index, run, 1e-6, 1e-6)
        errors += [abs(a['t'] - b.t) for a, b in zip(strikes(ensemble, index), run.strikes, strict=True)]
    assert np.quantile(errors, 0.99) < 1e-9
    assert {End.TIME, End.STANDING} <= {*ensemble.ends}


@pytest.mark.parametrize(
    ('column', 'low', 'high'),
    [('k', 0.0, 40.0), ('b', 0.0, 150.0), ('D0', 0.5, 1.5), ('S0', 0.8, 1.4), ('slope', 0.05, 0.1)],
)
def test_a_column_is_a_parameter_of_its_pair(column, low, high):
    values, state = np.linspace(low, high, 5), State(-0.2, 1.3, 0.1, 1.4)
    ensemble = run_ensemble(UNEQUAL, [state] * 5, 4.0, 40, **{column: values})
    for index, value in enumerate(values):
        assert_agrees(ensemble, index, trajectory.run(UNEQUAL._replace(**{column: float(value)}), state, 4.0))


def test_a_column_of_one_number_is_of_all_pairs():
    state = State(-0.2, 1.3, 0.1, 1.4)
    ensemble = run_ensemble(UNEQUAL, [state], 4.0, 40, k=7.0)
    assert_agrees(ensemble, 0, trajectory.run(UNEQUAL._replace(k=7.0), state, 4.0))


def test_the_length_at_rest_follows_the_stance_distance_of_its_pair():
    given_, derived = (
        run_ensemble(UNEQUAL, [(-0.2, 1.3, 0.1, 1.4)] * 2, 4.0, 40, S0=[0.9, 1.3], **more)
        for more in ({'D0': np.array([0.9, 1.3]) + UNEQUAL.front.length * math.sin(UNEQUAL.front.alpha)}, {})
    )
    assert given_.strikes.tobytes() == derived.strikes.tobytes()


def test_watching_the_phase_between_strikes_changes_no_motion():
    states, columns = sweep(30)
    plain, watched = (run_ensemble(SWEEP, states, 60.0, 300, extremes=asked, **columns) for asked in (False, True))
    for name in ('wheel', 'direction', 't', 'state'):
        assert plain.strikes[name] == pytest.approx(watched.strikes[name], abs=1e-12)
    assert np.isnan(plain.tails).all()
    assert (watched.tails[:, 0] <= watched.tails[:, 1]).all()


# Lanes


@pytest.mark.parametrize('seed', [1, 2])
def test_a_pair_s_result_depends_neither_on_its_lane_nor_on_its_neighbours(seed):
    states, columns = sweep(50, seed)
    order = np.random.default_rng(seed).permutation(50)
    straight = run_ensemble(SWEEP, states, 60.0, 300, **columns)
    shuffled = run_ensemble(SWEEP, states[order], 60.0, 300, **{name: value[order] for name, value in columns.items()})
    alone = run_ensemble(SWEEP, states[7:8], 60.0, 300, **{name: value[7:8] for name, value in columns.items()})
    for whole, part in zip(straight, shuffled, strict=True):
        assert whole[order].tobytes() == part.tobytes()
    for whole, part in zip(straight, alone, strict=True):
        assert whole[7:8].tobytes() == part.tobytes()


@pytest.mark.parametrize('count', [0, 1, 15, 16, 17])
def test_any_number_of_pairs_runs(count):
    states, columns = sweep(17)
    ensemble = run_ensemble(SWEEP, states[:count], 5.0, 30, **{name: value[:count] for name, value in columns.items()})
    assert len(ensemble.counts) == count
    assert (ensemble.counts > 0).all()


def test_two_wheels_that_strike_at_one_instant_both_strike():
    wheel = WheelParams(1.0, 5.0, 9.0)
    rig, state = RigParams(wheel, wheel, k=0.0, b=0.0, slope=0.0625), State(0.0, 1.0, 0.0, 1.0)
    both = strikes(run_ensemble(rig, [state], 3.0, 40), 0)
    run = trajectory.run(rig, state, 3.0)
    assert both['t'][::2] == pytest.approx(both['t'][1::2], abs=1e-12)
    assert [strike.t for strike in run.strikes] == pytest.approx(both['t'], abs=1e-9)


# Ends


def test_time_ends_a_pair():
    ensemble = run_ensemble(UNEQUAL, [(-0.2, 1.3, 0.1, 1.4)], 4.0, 40)
    assert (ensemble.ends[0], ensemble.durations[0]) == (End.TIME, 4.0)
    assert run_ensemble(UNEQUAL, [(-0.2, 1.3, 0.1, 1.4)], 0.0, 40).durations[0] == 0.0


@pytest.mark.parametrize('capacity', [1, 5])
def test_a_pair_with_as_many_strikes_as_there_is_room_for_ends(capacity):
    ensemble = run_ensemble(UNEQUAL, [(-0.2, 1.3, 0.1, 1.4)] * 2, math.inf, capacity)
    assert ensemble.strikes.shape == (2, capacity)
    assert list(ensemble.counts) == [capacity] * 2
    assert list(ensemble.ends) == [End.STRIKES] * 2
    assert ensemble.durations[0] == ensemble.strikes[0, -1]['t']


FRONT_TOO_SLOW = State(-0.2, 0.1, 0.1, 1.4)


@pytest.mark.parametrize(
    ('rig', 'state', 'end'),
    [
        (GENTLE, FRONT_TOO_SLOW, End.STANDING),
        (UNCOUPLED, State(-ALPHA, 0.0, -ALPHA, 0.0), End.STANDING),
        (UNCOUPLED, State(-0.1, -1.5, 0.1, 1.4), End.FALLEN),
        (UNCOUPLED._replace(slope=0.0), State(0.0, 0.0, 0.0, 0.0), End.STALLED),
        (UNCOUPLED._replace(S0=1e-9), State(0.0, 1.0, 0.0, 1.0), End.HUBS_MET),
    ],
)
def test_a_pair_ends_as_it_does_alone(rig, state, end):
    ensemble = run_ensemble(rig, [state], 500.0, 1000)
    assert End(ensemble.ends[0]) == end
    if end != End.HUBS_MET:  # which `run` refuses at the start
        run = trajectory.run(rig, state, 500.0)
        assert run.end == end
        assert len(run.strikes) == ensemble.counts[0]


def test_a_wheel_at_rest_goes_where_the_coupler_pushes_it():
    rig = RigParams(k=2000.0, b=10.0, D0=2.5)
    state = State(-rig.front.alpha, 0.0, -rig.rear.alpha, 0.0)
    ensemble = run_ensemble(rig, [state], 3.0, 4)
    run = trajectory.run(rig, state, 3.0, 4)
    assert run.strikes
    assert_agrees(ensemble, 0, run, 1e-6, 1e-5)


def test_a_rocking_wheel_strikes_both_ways():
    ensemble = run_ensemble(GENTLE, [FRONT_TOO_SLOW], 100.0, 400)
    assert {*strikes(ensemble, 0)['direction']} == {1, BACKWARD}


# Refusals


@pytest.mark.parametrize(
    ('states', 'more', 'message'),
    [
        ([[0.0] * 3], {}, r'shape \(N, 4\), got \(1, 3\)'),
        ([0.0] * 4, {}, r'shape \(N, 4\)'),
        ([[0.3, 1.0, 0.0, 1.0]], {}, 'angles within'),
        ([[0.0, math.nan, 0.0, 1.0]], {}, 'finite'),
        ([[0.0, math.inf, 0.0, 1.0]], {}, 'finite'),
        ([[0.0, 1.0, 0.0, 1.0]], {'k': -1.0}, 'k must be'),
        ([[0.0, 1.0, 0.0, 1.0]], {'b': [math.nan]}, 'b must be'),
        ([[0.0, 1.0, 0.0, 1.0]], {'slope': 1.0}, 'slope must be'),
        ([[0.0, 1.0, 0.0, 1.0]], {'D0': math.inf}, 'D0 must be'),
        ([[0.0, 1.0, 0.0, 1.0]], {'k': [1.0, 2.0]}, r'k must be a scalar or of shape \(1,\), got \(2,\)'),
        ([[0.0, 1.0, 0.0, 1.0]], {'mass': 1.0}, 'mass is not a parameter of a rig; known are front.length'),
        ([[0.0, 1.0, 0.0, 1.0]], {'seconds': math.nan}, 'seconds must be'),
        ([[0.0, 1.0, 0.0, 1.0]], {'seconds': -1.0}, 'seconds must be'),
        ([[0.0, 1.0, 0.0, 1.0]], {'capacity': 0}, 'capacity'),
    ],
)
def test_what_cannot_be_is_refused(states, more, message):
    with pytest.raises(ValueError, match=message):
        run_ensemble(RigParams(), states, **{'seconds': 1.0, 'capacity': 9, **more})


def test_a_motion_too_fast_to_follow_is_told():
    with pytest.raises(MotionError, match=r'pair 1 .* too fast'):
        run_ensemble(RigParams(), [[0.0, 1.0, 0.0, 1.0], [0.0, 1e12, 0.0, 1.0]], 1.0, 9)


@few
@given(between(-ALPHA, ALPHA), between(-1e3, 1e3), between(-ALPHA, ALPHA), between(-1e3, 1e3))
def test_no_start_runs_forever(theta1, omega1, theta2, omega2):
    ensemble = run_ensemble(RigParams(), [(theta1, omega1, theta2, omega2)], 10.0, 200)
    assert ensemble.ends[0] in [*End]


# Numba

SMALL_CASE = """
import sys
if 'plain' in sys.argv:
    sys.modules['numba'] = None
import numpy as np
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.motion import compiled
from dcdrw_sim.motion.ensemble import run_ensemble
assert compiled.AVAILABLE != ('plain' in sys.argv)
ensemble = run_ensemble(RigParams(slope=0.02), [(-0.2, 1.3, 0.1, 1.4), (-0.2, 0.1, 0.1, 1.4)], 3.0, 60, k=[5.0, 9.0])
print(repr([ensemble.counts.tolist(), ensemble.ends.tolist(), ensemble.strikes['t'].tolist()]))
"""


def small_case(*arguments):
    process = subprocess.run(
        [sys.executable, '-W', 'error', '-c', SMALL_CASE, *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    return eval(process.stdout)


def test_plain_python_agrees_with_compiled_code():
    pytest.importorskip('numba')
    counts, ends, times = small_case()
    plain_counts, plain_ends, plain_times = small_case('plain')
    assert (counts, ends) == (plain_counts, plain_ends)
    assert np.abs(np.subtract(times, plain_times)).max() < 1e-9

import math

import numpy as np
import pytest

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.ends import STALL_TIME, End, MotionError
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.motion.trajectory import run
from tests.sim.rigs import ALPHA, GENTLE, UNCOUPLED, UNEQUAL

START = start(UNEQUAL, 0.25)
RUN = run(*START, seconds=4.0)


def test_segments_join_without_gaps_from_the_start_to_the_end():
    assert RUN.segments[0].start == 0.0
    assert RUN.segments[-1].end == RUN.duration == 4.0
    assert all(one.end == other.start for one, other in zip(RUN.segments, RUN.segments[1:], strict=False))


def test_dense_output_is_the_motion_of_the_simulation():
    simulation = Simulation(*START)
    times = np.linspace(0.0, 4.0, 173)
    trajectory = RUN.at(times)
    for j, time in enumerate(times):
        motion = simulation.advance_to(float(time))
        row = State(*(column[j] for column in trajectory[1:5]))
        assert list(row) == pytest.approx(list(simulation.state), abs=1e-12)
        assert (trajectory.steps1[j], trajectory.steps2[j]) == tuple(simulation.steps)
        assert [
            trajectory.rotation1[j],
            trajectory.rotation2[j],
            trajectory.coupler_length[j],
            trajectory.coupler_rate[j],
            trajectory.coupler_force[j],
        ] == pytest.approx([motion.rotation1, motion.rotation2, motion.length, motion.rate, motion.force], abs=1e-10)


def test_times_may_come_in_any_order_and_alone():
    times = np.array([3.0, 0.5, 2.0, 0.5])
    together = RUN.at(times)
    for j, time in enumerate(times):
        for column, alone in zip(together, RUN.at(time), strict=True):
            assert alone.shape == (1,)
            assert column[j] == alone[0]
    assert RUN.at([]).theta1.shape == (0,)


def test_at_a_strike_the_state_is_that_after_it():
    for strike in RUN.strikes:
        after = RUN.at(strike.t)
        theta, wheel = ((after.theta1, UNEQUAL.front), (after.theta2, UNEQUAL.rear))[strike.wheel - 1]
        assert theta[0] == -wheel.alpha


@pytest.mark.parametrize('times', [[-0.1], [4.1], [1.0, math.nan], [math.inf]])
def test_times_outside_the_run_are_refused(times):
    with pytest.raises(ValueError, match=r'times must lie in \[0, 4\] s'):
        RUN.at(times)


# Ends


def test_a_run_ends_with_its_time_or_with_its_strikes():
    assert RUN.end is End.TIME
    counted = run(*START, strikes=5)
    assert (counted.end, len(counted.strikes)) == (End.STRIKES, 5)
    assert counted.duration == counted.strikes[-1].t
    assert counted.strikes == RUN.strikes[:5]
    assert run(*START, seconds=4.0, strikes=5).end is End.STRIKES
    assert run(*START, seconds=0.01, strikes=5).end is End.TIME
    assert (RUN.wheel, RUN.reason) == (0, 'the time asked for is over')


def test_a_run_of_no_time_holds_its_start():
    empty = run(*START, seconds=0.0)
    assert (empty.end, empty.strikes, empty.duration) == (End.TIME, [], 0.0)
    assert empty.at(0.0).theta2[0] == START.state.theta2


def test_on_too_gentle_a_slope_a_wheel_ends_standing():
    result = run(GENTLE, State(-ALPHA, 1.0, 0.1, 1.0), seconds=100.0)
    assert result.end is End.STANDING
    assert result.duration < 30.0
    assert result.wheel in (1, 2)
    assert 'stands still on two spokes' in result.reason


def test_a_wheel_that_stands_at_the_start_ends_the_run_at_once():
    result = run(UNCOUPLED, State(0.0, 1.0, -ALPHA, 0.0), seconds=1.0)
    assert (result.end, result.wheel, result.duration) == (End.STANDING, 2, 0.0)


def test_a_wheel_pulled_over_its_apex_backwards_ends_fallen():
    result = run(RigParams(k=300.0, b=0.0, D0=0.2), State(-0.2, 0.0, 0.1, 0.0), seconds=10.0)
    assert (result.end, result.wheel) == (End.FALLEN, 1)
    assert result.reason == 'the front wheel was pushed over: it passed its apex backwards and rolls uphill'


def test_wheels_on_a_slope_the_other_way_end_fallen():
    result = run(UNCOUPLED._replace(slope=-0.1), State(0.1, -1.0, 0.0, -1.2), seconds=10.0)
    assert result.end is End.FALLEN
    assert len(result.strikes) < 6


def test_wheels_in_balance_end_stalled():
    rig = RigParams(slope=0.0, S0=1.0, D0=1.0)
    result = run(rig, State(0.0, 0.0, 0.0, 0.0), strikes=3)
    patience = STALL_TIME * math.sqrt(rig.front.length / rig.gravity)
    assert (result.end, result.wheel, result.strikes) == (End.STALLED, 1, [])
    assert patience < result.duration < 1.1 * patience
    assert result.reason.startswith('the front wheel hangs')


def test_hubs_that_meet_end_the_run_where_they_do():
    result = run(UNCOUPLED._replace(S0=0.0), State(0.0, 1.0, -0.1, 2.0), seconds=1.0)
    assert result.end is End.HUBS_MET
    assert result.at(result.duration).coupler_length[0] < 1e-6


@pytest.mark.parametrize(
    'limits',
    [
        {},
        {'seconds': -1.0},
        {'seconds': math.nan},
        {'strikes': 0},
        {'strikes': math.nan},
        {'seconds': math.inf, 'strikes': math.inf},
    ],
)
def test_a_run_without_sensible_limit_is_refused(limits):
    with pytest.raises(ValueError, match='a run needs a limit, seconds ≥ 0 or strikes ≥ 1'):
        run(*START, **limits)


def test_a_motion_too_fast_to_follow_is_refused():
    with pytest.raises(MotionError, match='too fast to follow'):
        run(UNEQUAL, State(0.0, 1e200, 0.0, 1.0), seconds=1.0)

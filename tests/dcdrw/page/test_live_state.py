"""What the live page is told: of the simulated rig, of odd samples, of hours."""

import gc
import json
import math
import tracemalloc
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw.page.live_state import LATE_DATA, STEPS_SHOWN, STRANGERS_SHOWN, Command, LiveState, read_command
from dcdrw.suite.parameter_file import TrialParams
from dcdrw_msgs_py.diagnosis import (
    LOST_SAMPLES,
    REFUSED,
    RESTARTS,
    STATE,
    Diagnosis,
    Level,
    PairState,
    RecorderState,
    SourceState,
)
from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_msgs_py.samples import CouplerSample, Footfall, JointSample, PhaseSample, Turn
from dcdrw_sim.rig.simulator import SimulatedRig
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams, PhaseUpdate

START_NS = 1_700_000_000_000_000_000
UNEQUAL = RigParams(
    front=WheelParams(0.9, 9.0, 12.0), rear=WheelParams(1.0, 11.0, 13.0), k=60.0, b=150.0, slope=math.radians(3.0)
)
RIGS = [RigParams(), UNEQUAL]


def walk(
    rig: RigParams,
    seconds: float,
    rate: float = 500.0,
    begin: float = 0.0,
) -> Iterator[tuple[float, JointSample, PhaseUpdate]]:
    """A simulated rig through the estimator, which may come late."""
    params = TrialParams.of_rig(rig)
    source, estimator = SimulatedRig(rig, params.simulator), PhaseEstimator(params.phase)
    for i in range(round(begin * rate), round(seconds * rate)):
        joints = source.read(i / rate, START_NS + round(i / rate * 1e9))
        update = estimator.update(joints)
        if update:
            yield i / rate, joints, update


def show(state: LiveState, now: float, joints: JointSample, update: PhaseUpdate) -> None:
    state.take_joints(joints, now)
    state.take_phase(update.phase, now)
    for fall in update.footfalls:
        state.take_footfall(fall)


def frames(rig: RigParams, seconds: float, begin: float = 0.0, coupler: bool = True) -> Iterator[dict[str, Any]]:
    state = LiveState(TrialParams.of_rig(rig))
    for i, (now, joints, update) in enumerate(walk(rig, seconds, begin=begin)):
        show(state, now, joints if coupler else joints._replace(coupler=CouplerSample()), update)
        if i % 20 == 19:
            yield {**state.frame(now), 'D': joints.coupler.length}


def hubs(rig: RigParams, drawn: dict[str, Any]) -> float:
    """Distance of the hubs as drawn: foot, stance leg, stance leg, foot."""
    (theta1, theta2), l1, l2 = drawn['theta'], rig.front.length, rig.rear.length
    return math.hypot(
        drawn['S'] + l1 * math.sin(theta1) - l2 * math.sin(theta2), l1 * math.cos(theta1) - l2 * math.cos(theta2)
    )


@pytest.mark.parametrize('begin', [0.0, 1.3])
@pytest.mark.parametrize('rig', RIGS)
def test_feet_stand_still_between_strikes_whenever_the_page_opens(rig, begin):
    stances = [frame['rig']['S'] for frame in frames(rig, 6.0, begin)]
    moves = {0.0, rig.front.step_length, -rig.rear.step_length}
    seen = {
        min(moves, key=lambda move: abs(move - (now - last)))
        for last, now in pairwise(stances)
        if min(abs(move - (now - last)) for move in moves) < 1e-3
    }
    assert seen == moves
    odd = [now - last for last, now in pairwise(stances) if min(abs(move - (now - last)) for move in moves) > 1e-3]
    # both wheels within one frame
    assert all(abs(move - rig.front.step_length + rig.rear.step_length) < 1e-3 for move in odd)


@pytest.mark.parametrize('rig', RIGS)
def test_drawn_coupler_is_as_long_as_the_real_one_even_where_it_is_not_measured(rig):
    for known in (True, False):
        drawn = list(frames(rig, 6.0, coupler=known))
        for frame in drawn[40:]:  # each wheel has struck
            assert hubs(rig, frame['rig']) == pytest.approx(frame['D'], abs=1e-4)


def test_phase_sample_is_drawn_with_the_joints_that_it_came_from():
    state = LiveState(TrialParams())
    samples = list(walk(RigParams(), 2.0))
    for now, joints, update in samples:
        state.take_joints(joints, now)
        if now < 1.5:
            state.take_phase(update.phase, now)  # the phase lags by half a second
    drawn = state.frame(2.0)['rig']
    (joints,) = [joints for _, joints, _ in samples if str(joints.stamp_ns) == drawn['stamp_ns']]
    assert drawn['stamp_ns'] == str(samples[749][1].stamp_ns)
    assert drawn['force'] == pytest.approx(joints.coupler.force, abs=0.01)
    alpha = RigParams().front.alpha
    assert drawn['theta'][0] + 2.0 * alpha * drawn['legs'][0] == pytest.approx(joints.front.angle, abs=1e-4)


def test_points_are_few_and_keep_every_peak_of_the_force():
    state = LiveState(TrialParams())
    phis, forces = [], []
    for i, (now, joints, update) in enumerate(walk(RigParams(), 2.0, rate=1000.0)):
        coupler = joints.coupler._replace(force=999.0) if i == 1234 else joints.coupler
        show(state, now, joints._replace(coupler=coupler), update)
        if i % 40 == 39:
            frame = state.frame(now)
            phis += frame.get('phis', [])
            forces += frame.get('forces', [])
            assert len(json.dumps(frame)) < 4000
    assert len(phis) == pytest.approx(100, abs=2)
    assert len(forces) == pytest.approx(100, abs=2)
    assert [most for _, _, most in forces].count(999.0) == 1
    assert [t for t, _ in phis] == sorted(t for t, _ in phis)


def says(state: Any, message: str = '', level: Level = Level.OK) -> Diagnosis:
    return Diagnosis(level, message, {STATE: state})


def test_state_is_what_the_monitor_says_while_it_speaks():
    state = LiveState(TrialParams())
    assert state.frame(0.0)['state'] == PairState.NO_DATA.value
    for now, joints, update in walk(RigParams(), 2.0):
        show(state, now, joints, update)
    assert state.frame(2.0)['state'] == PairState.CONVERGING.value
    state.take_health('sync_monitor', says(PairState.SYNCHRONIZED, 'words'), 2.0)
    assert (state.frame(2.0)['state'], state.frame(2.0)['detail']) == (PairState.SYNCHRONIZED.value, 'words')
    for now in (3.0, 4.0, 5.5):  # the monitor has been killed: its verdict is no longer to be trusted
        state.take_phase(update.phase._replace(stamp_ns=START_NS + round(now * 1e9)), now)
    assert state.frame(5.5)['state'] == PairState.CONVERGING.value
    assert state.frame(6.6)['state'] == LATE_DATA


@pytest.mark.parametrize('pair', list(PairState)[1:])
def test_every_state_of_the_monitor_is_shown_whatever_words_it_has_for_it(pair):
    state = LiveState(TrialParams())
    for now, joints, update in walk(RigParams(), 0.1):
        show(state, now, joints, update)
    state.take_health('sync_monitor', says(pair, 'synchronized paused recording stalled'), 0.1)
    assert state.frame(0.1)['state'] == pair.value


def test_own_judgement_stands_in_for_a_monitor():
    rig = RigParams(k=60.0)
    state = LiveState(TrialParams.of_rig(rig))
    for now, joints, update in walk(rig, 12.0, rate=200.0):
        show(state, now, joints, update)
    frame = state.frame(12.0)
    assert frame['state'] == PairState.SYNCHRONIZED.value
    board = frame['board']
    assert len(board['errors']) == board['steps'] > 15
    assert abs(board['errors'][0]) > 15.0 > 6.0 > abs(board['errors'][-1])


def comes_to_rest(state: LiveState, theta: float, begin: float, end: float) -> None:
    """Both wheels turn to an angle within half a second, and stay there."""
    frame = state.frame(begin)
    last = frame['rig']['theta'][0] if 'rig' in frame else theta
    for i in range(round(100 * begin), round(100 * end)):
        share = min((i / 100 - begin) / 0.5, 1.0)
        turn = Turn(last + share * (theta - last), 2.0 * (theta - last) if share < 1.0 else 0.0)
        state.take_phase(PhaseSample(START_NS + i * 10_000_000, turn, turn, Turn(0.2, 0.0), 0), i / 100)


def test_wheels_that_stand_have_stalled_and_wheels_that_rest_elsewhere_are_held():
    state = LiveState(TrialParams())
    comes_to_rest(state, -0.1, 0.0, 1.0)
    assert state.frame(1.0)['state'] == PairState.HELD.value  # not yet let go
    comes_to_rest(state, -math.pi / 12, 1.0, 6.0)
    frame = state.frame(6.0)
    assert frame['state'] == PairState.STALLED.value
    assert 'the front and the rear wheel' in frame['detail']
    comes_to_rest(state, -0.1, 6.0, 12.0)
    assert state.frame(12.0)['state'] == PairState.HELD.value
    comes_to_rest(state, -math.pi / 12, 12.0, 16.0)
    state.take_health('simulator', says(SourceState.PAUSED, 'words'), 16.0)
    frame = state.frame(16.0)
    assert (frame['state'], frame['detail']) == (PairState.HELD.value, 'words')
    assert frame['board']['nodes'][0]['message'] == 'words'  # one source for both


def test_no_data_and_late_data_are_two_states_and_say_why():
    state = LiveState(TrialParams())
    frame = state.frame(0.0)
    assert (frame['state'], frame['age']) == (PairState.NO_DATA.value, None)
    assert 'is the source running' in frame['detail']
    state.take_joints(JointSample(START_NS, Turn(0.0, 1.0), Turn(0.1, 1.0)), 1.0)
    assert 'does phase_estimator run' in state.frame(1.1)['detail']
    state.take_phase(PhaseSample(START_NS, Turn(0.0, 1.0), Turn(0.1, 1.0), Turn(0.2, 0.0), 0), 1.2)
    frame = state.frame(1.3)
    assert (frame['state'], frame['age']) == (PairState.CONVERGING.value, 0.1)
    frame = state.frame(9.2)
    assert (frame['state'], frame['detail'], frame['age']) == (LATE_DATA, 'nothing has come for 8 s', 8.0)


def test_restart_of_the_source_clears_the_charts():
    state = LiveState(TrialParams())
    for now, joints, update in walk(RigParams(), 2.0):
        show(state, now, joints, update)
    run = state.frame(2.0)['run']
    assert run == 1
    state.take_phase(update.phase._replace(restarts=1, stamp_ns=START_NS + 2_500_000_000), 2.5)
    frame = state.frame(2.5)
    assert frame['run'] == 2
    assert len(frame['phis']) == 1
    assert frame['board']['steps'] == 0
    state.take_phase(update.phase._replace(restarts=1, stamp_ns=START_NS), 2.6)  # a recording that is played again
    assert state.frame(2.6)['run'] == 3


@pytest.mark.parametrize('seconds', [37.0, -3600.0, 1e9])
def test_a_clock_that_was_set_begins_clean_charts(seconds):
    """Stamps jump while the wheels roll on, and time goes on: state and age as ever, one run after the other."""
    state, step_ns = LiveState(TrialParams.of_rig(RigParams(k=60.0))), round(seconds * 1e9)
    estimator = PhaseEstimator(PhaseParams())
    frames = []
    for now, joints, _ in walk(RigParams(k=60.0), 8.0):
        set_joints = joints._replace(stamp_ns=joints.stamp_ns + (step_ns if now >= 4.0 else 0))
        state.take_joints(set_joints, now)
        update = estimator.update(set_joints, 0, round(now * 1e9))
        for phase in (*update.held, update.phase) if update else ():
            state.take_phase(phase, now)
        for fall in update.footfalls if update else ():
            state.take_footfall(fall)
        if not round(now * 500) % 20:
            frames.append(state.frame(now))
    assert [frame['run'] for frame in frames] == sorted(frame['run'] for frame in frames)
    assert frames[-1]['run'] == 2
    later = [frame for frame in frames if frame['run'] == 2]
    assert all(frame['state'] not in (LATE_DATA, PairState.NO_DATA.value) and frame['age'] < 0.5 for frame in frames)
    for name in ('phis', 'forces'):
        times = [point[0] for frame in later for point in frame.get(name, [])]
        assert times == sorted(times)
        assert times[-1] - times[0] < 4.1
    boards = [frame['board'] for frame in later if 'board' in frame]
    assert 0 < boards[-1]['steps'] <= 8  # counted from where the clock was set


def test_a_silence_is_a_gap_in_the_charts():
    state = LiveState(TrialParams())
    for now, joints, update in walk(RigParams(), 4.0):
        if not 1.0 < now < 3.0:
            show(state, now, joints, update)
    assert state.frame(4.0)['run'] == 1


def test_node_that_falls_silent_is_stale_and_its_controls_are_off():
    state = LiveState(TrialParams())
    state.take_health('simulator', says(SourceState.RUNNING), 0.0)
    state.take_health('recorder', says(RecorderState.RECORDING), 0.0)
    state.take_controls(RigParams(k=7.0))
    board = state.frame(1.0)['board']
    assert (board['simulated'], board['recorder'], board['recording']) == (True, True, True)
    assert next(control['value'] for control in board['controls'] if control['name'] == 'k') == 7.0
    board = state.frame(4.0)['board']
    assert (board['simulated'], board['recorder']) == (False, False)
    assert board['nodes'][1] == {'name': 'simulator', 'level': 'STALE', 'message': 'silent for 4 s'}


def test_what_is_missing_and_refused_is_said_beside_the_rate():
    state = LiveState(TrialParams())
    assert state.frame(0.0)['board']['left_out'] == ''
    counts = {LOST_SAMPLES: 4, REFUSED: '3', RESTARTS: 0}
    state.take_health('phase_estimator', Diagnosis(Level.OK, '', counts), 1.0)
    assert state.frame(1.0)['board']['left_out'] == ', 4 missing, 3 refused'
    for restarts, told in ((1, ', begun anew 1 time'), (2, ', begun anew 2 times')):
        state.take_health('phase_estimator', Diagnosis(Level.OK, '', {RESTARTS: restarts}), 2.0)
        assert state.frame(2.0)['board']['left_out'] == told


def test_strangers_push_out_none_of_the_suite_and_take_little_room():
    state = LiveState(TrialParams())
    state.take_health('simulator', says(SourceState.PAUSED), 0.0)
    for i in range(1000):
        state.take_health(f'driver_{i}', Diagnosis(Level.OK, 'x' * 500_000, {'dump': 'y' * 500_000}), 0.1)
    board = state.frame(0.2)['board']
    assert board['paused']
    assert len(board['nodes']) == STRANGERS_SHOWN + 1
    assert len(json.dumps(board)) < 10_000


def test_sliders_have_the_bounds_and_units_of_the_parameters():
    controls = {control['name']: control for control in LiveState(TrialParams()).frame(0.0)['board']['controls']}
    assert (controls['k']['low'], controls['k']['high'], controls['k']['unit']) == (0.0, 1e6, 'N/m')
    slope = controls['slope']
    assert (slope['low'] * slope['scale'], slope['high'] * slope['scale']) == pytest.approx((-45.0, 45.0))
    assert slope['unit'] == '°'
    assert controls['front.gyration']['top'] == 2.0
    assert [name for name, control in controls.items() if not control['more']] == ['k', 'b', 'slope']


def test_command_is_read_or_refused_with_the_reason():
    assert read_command('{"do": "set", "name": "k", "value": 12}') == Command('set', 'k', 12.0)
    assert read_command('{"do": "pause", "value": true}') == Command('pause', value=True)
    assert read_command('{"do": "reset"}') == Command('reset')
    assert read_command('{"do": "stop"}') == Command('stop')
    assert read_command('{"do": "enable", "value": true}') == Command('enable', value=True)
    for text, reason in (
        ('{"do": "set", "name": "k", "value": -1}', 'k must be ≥ 0'),
        ('{"do": "set", "name": "slope", "value": 2}', 'slope must be'),
        ('{"do": "set", "name": "k", "value": "1"}', 'k must be a number'),
        ('{"do": "set", "name": "rate", "value": 1}', 'not a command'),
        ('{"do": "set", "name": [], "value": 1}', 'not a command'),
        ('{"do": "pause", "value": 1}', 'not a command'),
        ('{"do": "enable"}', 'not a command'),
        ('[]', 'must be an object'),
        ('{', 'Expecting'),
        ('', 'Expecting'),
    ):
        with pytest.raises(ValueError, match=reason):
            read_command(text)


def test_person_and_synchronizer_are_told_while_they_speak():
    state = LiveState(TrialParams(), may_enable=True)
    for force in (3.0, -4.0, math.nan):
        state.take_person_force(force, 1.0)
    state.take_synchronizer_state('armed')
    state.take_health('synchronizer', Diagnosis(Level.OK, 'armed', {}), 1.0)
    board = state.frame(1.0)['board']
    assert board['person'] == {'peak': 4.0, 'rms': 3.5}
    assert (board['synchronizer'], board['may_enable']) == ('armed', True)
    board = state.frame(20.0)['board']
    assert (board['person'], board['synchronizer']) == (None, None)


numbers = st.floats(allow_nan=True, allow_infinity=True)
turns = st.builds(Turn, numbers | st.floats(-4.0, 4.0), numbers)
stamps = st.integers(-(2**62), 2**62) | st.integers(0, 5).map(lambda i: START_NS + i * 20_000_000)


@given(
    st.lists(
        st.one_of(
            st.builds(JointSample, stamps, turns, turns, st.builds(CouplerSample, numbers, numbers, numbers)),
            st.builds(PhaseSample, stamps, turns, turns, turns, st.integers(-9, 9), st.integers(0, 2)),
            st.builds(Footfall, st.sampled_from(['front', 'rear', 'other']), stamps, numbers, st.integers(-9, 9)),
        ),
        max_size=20,
    )
)
def test_frame_is_json_whatever_comes(samples):
    state = LiveState(TrialParams())
    for sample in samples:
        if isinstance(sample, JointSample):
            state.take_joints(sample, 1.0)
        elif isinstance(sample, PhaseSample):
            state.take_phase(sample, 1.0)
        else:
            state.take_footfall(sample)
        json.dumps(state.frame(1.0), allow_nan=False)


def test_hours_take_no_more_memory_than_minutes():
    state = LiveState(TrialParams())
    stamp_ns, theta = START_NS, 0.0

    def go_on(seconds: int) -> int:
        """Wheels that turn fast, 100 samples and 33 strikes a second, nodes that come and go, nobody who looks."""
        nonlocal stamp_ns, theta
        for i in range(100 * seconds):
            stamp_ns += 10_000_000
            theta = math.remainder(theta + 0.0524, math.pi / 6)
            now = (stamp_ns - START_NS) * 1e-9
            turn = Turn(theta, 5.24)
            state.take_joints(JointSample(stamp_ns, turn, turn, CouplerSample(1.0, 0.0, float(i % 7))), now)
            state.take_phase(PhaseSample(stamp_ns, turn, turn, Turn(0.26, 0.0), 0), now)
            if i % 3 == 0:
                state.take_footfall(Footfall('front', stamp_ns, now, i))
                state.take_health(f'node_{i}', says('well', 'fine'), now)
                state.notice('well', ok=True)
        return len(json.dumps(state.frame(now)))

    tracemalloc.start()
    try:
        size = go_on(40)
        gc.collect()
        before, _ = tracemalloc.get_traced_memory()
        assert go_on(40) <= 1.05 * size
        gc.collect()
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < 50_000  # the monitor's history of errors may still grow, to ten thousand floats
    board = state.frame(math.inf)['board']
    assert len(board['nodes']) == STRANGERS_SHOWN
    assert len(board['errors']) == STEPS_SHOWN

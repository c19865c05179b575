"""The reference of the robot's legs, against a controller, even and uneven people, and whatever may happen."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import LATE_GOAL, ORDER_GOAL, on_the_treadmill, simulated_person, stopping, walking_20_m

from dcdrw_control.reference.diagnosis import diagnose_reference
from dcdrw_control.reference.joint_table import DEFAULT, read_joint_table
from dcdrw_control.reference.params import ReferenceParams
from dcdrw_control.reference.person import GaitSample
from dcdrw_control.reference.plan import SLOWEST_RAMP
from dcdrw_control.reference.reference import LegReference, State
from dcdrw_msgs_py.diagnosis import Level
from tests.control.reference.controller import Controller

TABLE = read_joint_table(DEFAULT)
STEP = 0.01
BEGIN = 100.0


class World:
    """A person, the reference at 100 Hz and a controller that executes it."""

    def __init__(self, **params) -> None:
        self.params = ReferenceParams(**params)
        self.core = LegReference(self.params, TABLE)
        self.controller = Controller(len(self.core.joints))
        self.time, self.stride = BEGIN, 0.0
        self.states, self.falls, self.renewals = [], [], 0
        self.positions, self.speeds = [], []

    def walk(self, seconds: float, pace: float = 0.9, enabled: bool = True, heard: bool = True) -> None:
        for _ in range(round(seconds / STEP)):
            self.time += STEP
            self.stride += STEP * pace
            if enabled:
                self.core.enable(self.time, True)
            if heard:
                self.hear(GaitSample(round(self.time * 1e9), (self.stride, self.stride - 0.5)))
            for share in (0.3, 0.8):
                position, speed = self.controller.state(self.time + share * STEP)
                self.positions.append(position)
                self.speeds.append(speed)
            self.states.append(self.core.status().state)

    def hear(self, sample: GaitSample) -> None:
        update = self.core.update(sample, self.time, sample.stamp_ns)
        if update is None:
            return
        self.falls += update.falls
        if update.trajectory:
            self.renewals += 1
            self.controller.accept(update.trajectory, self.time)

    def check(self) -> None:
        """The joints keep to their largest speed, and never jump."""
        assert np.abs(self.speeds).max() <= self.params.max_speed
        moved = np.abs(np.diff(self.positions, axis=0)).max()
        assert moved <= self.params.max_speed * 0.5 * STEP * (1.0 + 1e-9)


@pytest.fixture(scope='module')
def even():
    world = World()
    world.walk(12.0)
    return world


def test_it_stands_first_then_the_gait_grows_within_its_strides(even):
    starts = even.states.index(State.STARTING)
    walks = even.states.index(State.WALKING)
    ramp = (walks - starts) * STEP - even.params.approach - even.params.lead
    assert ramp == pytest.approx(even.params.ramp_strides / 0.9, abs=0.1)
    assert even.states[-1] is State.WALKING
    even.check()


def test_behind_an_even_walk_the_joints_are_those_of_the_table_a_quarter_stride_ahead(even):
    position, speed = even.controller.state(even.time)
    ahead = np.array([even.stride, even.stride - 0.5]) + 0.25
    assert position == pytest.approx(TABLE.angles(ahead).ravel(), abs=2e-3)
    assert speed == pytest.approx(0.9 * TABLE.slopes(ahead).ravel(), abs=5e-2)


def test_the_controllers_own_way_to_date_what_it_commanded_costs_no_more_than_a_cycle():
    period = 0.002
    ideal, real = World(approach=0.2, ramp_strides=1.0), World(approach=0.2, ramp_strides=1.0)
    real.controller = Controller(len(real.core.joints), period)
    for world in (ideal, real):
        world.walk(4.0)
    off = np.abs(np.array(real.positions) - ideal.positions).max()
    assert 0.0 < off <= period * ideal.params.max_speed
    assert np.abs(real.speeds).max() <= ideal.params.max_speed


def test_its_feet_fall_in_the_order_1_4_2_3_a_quarter_stride_before_the_persons(even):
    status = even.core.status()
    assert (status.order.wrong, status.order.falls > 15) == (0, True)
    assert status.order.lead_error < 1e-3
    assert diagnose_reference(status, 0.0, 1.0).level is Level.OK


def test_what_is_not_renewed_comes_to_rest():
    world = World(approach=0.2, ramp_strides=1.0)
    world.walk(4.0)
    world.walk(1.0, heard=False)
    end = world.params.lead + world.params.horizon + world.params.brake
    assert not np.any(world.speeds[-2 * round((1.0 - end) / STEP) + 10 :])
    world.check()
    world.walk(6.0)  # first it stands, then it starts anew
    assert State.STOPPING in world.states
    assert world.states[-1] is State.WALKING
    world.check()


@pytest.mark.parametrize(('pace', 'enabled'), [(0.9, False), (0.0, True)], ids=['released', 'the person stands'])
def test_it_comes_to_stand_and_then_says_no_more(pace, enabled):
    world = World(standing=(0.1, 0.2), approach=0.2, ramp_strides=1.0)
    world.walk(4.0)
    world.walk(2.0 * world.params.ramp_strides / min(SLOWEST_RAMP, pace or 1.0) + 1.0, pace, enabled)
    position, speed = world.controller.state(world.time)
    assert position == pytest.approx([0.1, 0.2] * 2)
    assert not speed.any()
    assert world.states[-1] is (State.OFF if not enabled else State.WAITING)
    renewals = world.renewals
    world.walk(1.0, pace, enabled)
    assert world.renewals == renewals
    world.check()


def test_joints_that_are_too_slow_are_told_and_keep_to_their_speed():
    world = World(max_speed=3.0)
    world.walk(6.0, pace=1.2)
    world.check()
    said = diagnose_reference(world.core.status(), 0.0, 1.0)
    assert said.level is not Level.OK


def test_without_a_heartbeat_nothing_is_commanded():
    world = World()
    world.walk(2.0, enabled=False)
    assert world.renewals == 0
    assert set(world.states) == {State.OFF}


def test_bad_samples_are_counted_and_change_nothing():
    world = World()
    world.walk(1.0)
    now_ns = round(world.time * 1e9)
    assert world.core.update(GaitSample(now_ns + 1, (math.nan, 0.0)), 0.0, now_ns) is None
    assert world.core.update(GaitSample(now_ns - 10**9, (1.0, 0.5)), 0.0, now_ns) is None
    assert world.core.update(GaitSample(now_ns + 10**9, (1.0, 0.5)), 0.0, now_ns) is None
    assert world.core.status().refused == {'unreadable': 0, 'not finite': 1, 'old': 1, 'future': 1}


def test_standing_angles_must_be_as_many_as_the_joints():
    with pytest.raises(ValueError, match='hip, knee'):
        LegReference(ReferenceParams(standing=(1.0,)), TABLE)


events = st.lists(
    st.tuples(
        st.floats(0.05, 1.5),  # seconds
        st.sampled_from([0.0, 0.3, 0.8, 1.0, 1.6, 3.0]),  # pace
        st.booleans(),  # enabled
        st.booleans(),  # heard
        st.sampled_from([0.0, 0.0, 0.3, 7.4, -50.0]),  # leap of the phase
    ),
    max_size=5,
)


@settings(max_examples=10)
@given(events, st.sampled_from([3.0, 10.0]))
def test_whatever_happens_no_joint_jumps_or_exceeds_its_speed_and_the_end_is_rest(course, max_speed):
    world = World(max_speed=max_speed, approach=0.2, ramp_strides=0.5)
    world.walk(2.0)
    for seconds, pace, enabled, heard, leap in course:
        world.stride += leap
        world.walk(seconds, pace, enabled, heard)
    world.walk(1.0, heard=False)
    world.check()
    assert not world.speeds[-1].any()


@pytest.mark.parametrize('person', [walking_20_m, on_the_treadmill, lambda: simulated_person(20.0, None)])
def test_the_robots_feet_fall_a_quarter_stride_ahead_of_people(person):
    score = person()
    assert score.falls > 20
    assert score.rms <= LATE_GOAL
    assert score.right >= ORDER_GOAL


@pytest.mark.parametrize('seed', [0, 1])
def test_a_person_who_stops_anywhere_and_starts_again_is_no_warning(seed):
    score = stopping(40.0, seed)
    assert score.falls > 50
    assert (score.right, score.alarms) == (1.0, 0)


def test_the_goals_are_those_promised():
    assert (LATE_GOAL, ORDER_GOAL) == (0.025, 0.99)

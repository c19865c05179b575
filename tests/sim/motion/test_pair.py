import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.model.dynamics import State, coupler, damper_power, mechanical_energy, resistance_power, stance_distance
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.scaling import Scales, dimensional
from dcdrw_sim.model.start import start
from dcdrw_sim.model.wheel import limit_cycle_speed
from dcdrw_sim.motion import pair as module
from dcdrw_sim.motion.ends import BACKWARD, FORWARD, HubsMetError, MotionError
from dcdrw_sim.motion.pair import Simulation
from tests.sim.oracle import integrate, paper_rates
from tests.sim.rigs import ALPHA, GENTLE, REAL, UNCOUPLED, UNEQUAL, between, rigs, rolling, starts

PAPER = preset('paper').resolved()
START = start(PAPER, 0.216)
few = settings(max_examples=20, deadline=None)


def strikes_of(rig, state, seconds, force=0.0):
    simulation = Simulation(rig, state)
    simulation.external_force = force
    return simulation.advance_to(seconds).strikes


# Truths of the motion


@pytest.mark.parametrize(
    'rig', [PAPER, UNEQUAL.resolved(), PAPER._replace(b=5234.0), PAPER._replace(b=0.0, k=200.0), REAL]
)
def test_energy_changes_by_what_coupler_and_resistance_take_and_the_external_work_alone(rig):
    nodes, weights = np.polynomial.legendre.leggauss(16)
    simulation = Simulation(*start(rig, 0.3))
    rig = simulation.rig
    scale = rig.front.mass * rig.gravity * rig.front.length
    for force in np.linspace(-10.0, 10.0, 40):
        simulation.external_force = force
        segment, strike = simulation.step()
        before, after = segment.at(segment.start), strike.state if strike else simulation.state
        half = 0.5 * (segment.end - segment.start)
        inside = segment.at(segment.start + half * (1 + nodes))
        rate = coupler(rig, inside, stance_distance(rig, *segment.steps)).rate
        lost = damper_power(rig, rate) + resistance_power(rig, inside)
        work = -half * np.sum(weights * (lost + force * rate))
        gain = mechanical_energy(rig, after, *segment.steps) - mechanical_energy(rig, before, *segment.steps)
        assert gain == pytest.approx(work, abs=1e-12 * scale)


@pytest.mark.parametrize('spokes', [8.0, 12.0, 20.0])
def test_an_uncoupled_wheel_comes_to_its_limit_cycle_in_speed_and_period(spokes):
    wheel = WheelParams(spokes=spokes)
    rig = RigParams(wheel, wheel, k=0.0, b=0.0, slope=math.radians(9.0))
    strikes = [strike for strike in strikes_of(rig, State(0.0, 2.0, 0.0, 3.0), 60.0) if strike.wheel == 1]
    closed_form = math.sqrt(
        math.cos(2 * wheel.alpha) ** 2
        * 4
        * rig.gravity
        / wheel.length
        * math.sin(rig.slope)
        * math.sin(wheel.alpha)
        / math.sin(2 * wheel.alpha) ** 2
    )
    assert strikes[-1].state.omega1 * math.cos(2 * wheel.alpha) == pytest.approx(closed_form, rel=1e-12)

    def struck(t, y):
        return y[0] - wheel.alpha

    struck.terminal = True
    leg = solve_ivp(
        lambda t, y: (y[1], rig.gravity / wheel.length * math.sin(y[0] + rig.slope)),
        (0.0, 5.0),
        (-wheel.alpha, closed_form),
        'DOP853',
        events=struck,
        rtol=1e-13,
        atol=1e-15,
    )
    assert strikes[-1].t - strikes[-2].t == pytest.approx(leg.t[-1], abs=1e-11)


@pytest.mark.parametrize(
    ('rig', 'state'),
    [
        start(UNEQUAL, 0.25),
        start(UNEQUAL._replace(k=200.0, b=0.0, D0=1.4), 0.8),
        start(REAL, 0.4),
        (UNEQUAL._replace(S0=-0.9, D0=0.9), State(0.1, 1.5, -0.1, 1.3)),  # the rear wheel is ahead
        (START.rig._replace(b=5234.0), START.state),
    ],
)
def test_an_integration_of_the_paper_s_equations_by_other_means_agrees(rig, state):
    expected, end = integrate(rig, state, 3.0)
    simulation = Simulation(rig, state)
    got = simulation.advance_to(3.0).strikes
    assert [strike.wheel for strike in got] == [event.wheel for event in expected]
    for strike, event in zip(got, expected, strict=True):
        assert strike.t == pytest.approx(event.t, abs=1e-9)
        assert list(strike.state) == pytest.approx(event.state, abs=1e-9)
    assert list(simulation.state) == pytest.approx(end, abs=1e-9)


# Symmetries


def assume_apart(strikes):
    """Two strikes at one instant may come in either order."""
    assume(all(later.t - strike.t > 1e-6 for strike, later in pairwise(strikes)))


def mirrored(state):
    return State(*(-value for value in state))


@few
@given(rigs, starts, between(-5.0, 5.0))
def test_to_swap_the_wheels_is_to_swap_their_names(rig, start, force):
    state = rolling(rig, *start)
    swapped = rig._replace(front=rig.rear, rear=rig.front, S0=-rig.S0)
    there = strikes_of(rig, state, 2.0, force)
    assume_apart(there)
    back = strikes_of(swapped, State(state.theta2, state.omega2, state.theta1, state.omega1), 2.0, force)
    assert len(there) == len(back)
    for one, other in zip(there, back, strict=True):
        assert (one.wheel, one.direction) == (3 - other.wheel, other.direction)
        assert one.t == pytest.approx(other.t, abs=1e-8)
        assert [*one.state[2:], *one.state[:2]] == pytest.approx(list(other.state), abs=1e-8)


@few
@given(rigs, starts, between(-5.0, 5.0))
def test_seen_in_a_mirror_the_wheels_roll_backwards_down_the_mirrored_slope(rig, start, force):
    state = rolling(rig, *start)
    there = strikes_of(rig, state, 2.0, force)
    assume_apart(there)
    mirror = strikes_of(rig._replace(slope=-rig.slope, S0=-rig.S0), mirrored(state), 2.0, force)
    assert len(there) == len(mirror)
    for one, other in zip(there, mirror, strict=True):
        assert (one.wheel, one.direction) == (other.wheel, -other.direction)
        assert one.t == pytest.approx(other.t, abs=1e-8)
        assert list(one.state) == pytest.approx(list(mirrored(other.state)), abs=1e-8)


@few
@given(between(0.0, 4.0))
def test_the_motion_depends_on_its_state_not_on_the_time(shift):
    whole = strikes_of(*start(UNEQUAL, 0.25), 6.0)
    simulation = Simulation(*start(UNEQUAL, 0.25))
    passed = len(simulation.advance_to(shift).strikes)
    again = simulation.rig._replace(S0=simulation.stance_distance)
    rest = strikes_of(again, simulation.state, 6.0 - shift)
    assert [strike.wheel for strike in rest] == [strike.wheel for strike in whole[passed:]]
    assert [strike.t + shift for strike in rest] == pytest.approx([strike.t for strike in whole[passed:]], abs=1e-9)


@few
@given(rigs, starts, st.builds(Scales, between(0.1, 6.0), between(0.1, 10.0), between(0.1, 10.0)))
def test_the_motion_scales(rig, start, scales):
    state = rolling(rig, *start)
    there = strikes_of(rig, state, 2.0)
    assume_apart(there)
    scaled = strikes_of(dimensional(rig, scales), scales.restore(state), 2.0 * scales.time)
    assert [strike.wheel for strike in there] == [strike.wheel for strike in scaled]
    for one, other in zip(there, scaled, strict=True):
        assert one.t == pytest.approx(other.t / scales.time, abs=1e-8)
        assert list(one.state) == pytest.approx(list(scales.reduce(other.state)), abs=1e-8)


# Sampling


@few
@given(st.lists(between(0.0, 5.0), min_size=1, max_size=30))
def test_how_often_one_looks_does_not_change_what_happens(times):
    watched, undisturbed = (Simulation(*start(UNEQUAL, 0.25)) for _ in range(2))
    seen = [strike for time in sorted(times) for strike in watched.advance_to(time).strikes]
    assert (*seen, *watched.advance_to(5.0).strikes) == undisturbed.advance_to(5.0).strikes
    assert watched.state == undisturbed.state


def test_steps_and_samples_mix():
    simulation, stepped = Simulation(*START), Simulation(*START)
    segments = [stepped.step()[0] for _ in range(30)]
    for segment in segments:
        simulation.advance_to(0.5 * (segment.start + segment.end))
        again, _ = simulation.step()
        assert (again.start, again.end) == (segment.start, segment.end)
        assert simulation.time == segment.end


def test_samples_between_two_steps_cost_no_new_series(monkeypatch):
    expansions = []
    expand = module.taylor.expand
    monkeypatch.setattr(module.taylor, 'expand', lambda *arguments: expansions.append(expand(*arguments)))
    simulation = Simulation(*START)
    for j in range(2001):
        simulation.advance_to(0.001 * j)
        simulation.external_force, simulation.rig = 0.0, PAPER  # nothing new
    many = len(expansions)
    expansions.clear()
    Simulation(*START).advance_to(2.0)
    assert many == len(expansions) < 60


def test_a_sample_holds_what_sensors_would_read():
    simulation = Simulation(*start(UNEQUAL, 0.25))
    simulation.external_force = 3.0
    motion = simulation.advance_to(3.0)
    rig, state = simulation.rig, simulation.state
    spring = coupler(rig, state, simulation.stance_distance)
    assert motion.time == simulation.time == 3.0
    assert motion.rotation1 == pytest.approx(state.theta1 + 2 * rig.front.alpha * simulation.steps[0])
    assert motion.rotation2 == pytest.approx(state.theta2 + 2 * rig.rear.alpha * simulation.steps[1])
    assert (motion.omega1, motion.omega2) == (state.omega1, state.omega2)
    assert (motion.length, motion.rate) == (spring.length, spring.rate)
    assert motion.force == pytest.approx(rig.k * (spring.length - rig.D0) + rig.b * spring.rate + 3.0)
    assert sum(simulation.steps) == len(motion.strikes)


def test_rotations_and_coupler_pass_a_strike_without_a_jump():
    simulation = Simulation(*START)
    while not (strike := simulation.step()[1]):
        pass
    after = simulation.advance_to(strike.t)
    before = Simulation(*START).advance_to(strike.t - 1e-9)
    assert after.strikes == ()  # told by `step` already
    assert after[1::2][:3] == pytest.approx(before[1::2][:3], abs=1e-8)
    assert after.omega2 == pytest.approx(before.omega2 * math.cos(2 * ALPHA), abs=1e-6)


@pytest.mark.parametrize('time', [0.9, -1.0, math.nan, math.inf])
def test_time_only_goes_on(time):
    simulation = Simulation(*START)
    simulation.advance_to(1.0)
    with pytest.raises(ValueError, match=r'time must be finite and not before 1\.0 s'):
        simulation.advance_to(time)


# Changes on the way


@pytest.mark.parametrize('change', [{'k': 50.0}, {'b': 0.0}, {'D0': 0.5}, {'slope': 0.1}, {'gravity': 5.0}])
def test_a_changed_parameter_holds_from_the_present_time_on(change):
    simulation = Simulation(*START)
    simulation.advance_to(0.43)
    steps, state = tuple(simulation.steps), simulation.state
    simulation.rig = PAPER._replace(**change)
    assert simulation.state == state
    again = Simulation(PAPER._replace(**change, S0=simulation.stance_distance), state)
    strikes = simulation.advance_to(2.43).strikes
    assert [(s.wheel, s.t - 0.43) for s in strikes] == [
        (s.wheel, pytest.approx(s.t, abs=1e-12)) for s in again.advance_to(2.0).strikes
    ]
    assert list(simulation.state) == pytest.approx(list(again.state), abs=1e-11)
    assert simulation.steps == [a + b for a, b in zip(steps, again.steps, strict=True)]


def test_the_external_force_adds_to_the_coupler_s():
    simulation = Simulation(*START)
    simulation.external_force = 2.0
    shifted = Simulation(START.rig._replace(D0=PAPER.D0 - 2.0 / PAPER.k), START.state)
    assert simulation.advance_to(1.5).rotation1 == pytest.approx(shifted.advance_to(1.5).rotation1, abs=1e-11)


def test_wheels_and_places_of_the_feet_do_not_change_on_the_way():
    simulation = Simulation(*START)
    simulation.rig = UNEQUAL._replace(S0=7.0, D0=1.5)
    kept = START.rig
    assert simulation.rig == UNEQUAL._replace(front=kept.front, rear=kept.rear, S0=kept.S0, D0=1.5)


def test_gyration_restitution_and_friction_may_change_on_the_way():
    simulation = Simulation(*START)
    before = simulation.advance_to(1.0)
    simulation.rig = REAL._replace(k=PAPER.k)
    assert simulation.rig.front == PAPER.front._replace(gyration=0.5, restitution=0.1)
    assert (simulation.rig.coupler_friction, simulation.rig.rolling_resistance) == (0.5, 0.004)
    assert simulation.advance_to(1.0).rotation1 == before.rotation1
    changed = Simulation(simulation.rig._replace(S0=simulation.stance_distance), simulation.state)
    assert simulation.advance_to(2.0).omega1 == pytest.approx(changed.advance_to(1.0).omega1, abs=1e-10)


def test_the_rest_length_derived_by_default_stays_as_it_was_at_the_start():
    simulation = Simulation(*START)
    simulation.rig = preset('paper')._replace(k=9.0)
    assert simulation.rig == START.rig._replace(k=9.0)


@pytest.mark.parametrize('force', [math.nan, math.inf])
def test_a_force_that_is_none_is_refused(force):
    simulation = Simulation(*START)
    with pytest.raises(ValueError, match='external_force must be finite'):
        simulation.external_force = force
    assert simulation.external_force == 0.0


@pytest.mark.parametrize('torques', [(math.nan, 0.0), (0.0, math.inf)])
def test_torques_that_are_none_are_refused(torques):
    simulation = Simulation(*START)
    with pytest.raises(ValueError, match=r'the torque on the (front|rear) hub must be finite'):
        simulation.torques = torques
    assert simulation.torques == (0.0, 0.0)


def test_a_torque_on_a_hub_works_by_the_angle_that_it_turns_through():
    simulation = Simulation(*start(UNCOUPLED, 0.9))
    rig, before, work = simulation.rig, mechanical_energy(simulation.rig, simulation.state, 0, 0), 0.0
    simulation.torques = 3.0, -2.0
    for _ in range(20):  # each is changed on the way, and holds from then on
        at = simulation.state
        simulation.advance_to(simulation.time + 0.01)
        force = simulation.torques
        work += force[0] * (simulation.state.theta1 - at.theta1) + force[1] * (simulation.state.theta2 - at.theta2)
        simulation.torques = force[1], force[0]
    assert simulation.steps == [0, 0]
    assert mechanical_energy(rig, simulation.state, 0, 0) - before == pytest.approx(work, abs=1e-10)


def test_a_torque_pushes_a_standing_wheel_over_its_spoke():
    rig = UNCOUPLED._replace(slope=0.0)
    simulation = Simulation(rig, State(-rig.front.alpha, 0.0, -rig.rear.alpha, 0.0))
    weight = rig.rear.mass * rig.gravity * rig.rear.length * math.sin(rig.rear.alpha)
    simulation.torques = weight, weight
    assert simulation.standing == [True, True]
    simulation.torques = weight, 1.1 * weight
    simulation.advance_to(5.0)
    assert simulation.standing == [True, False]
    assert simulation.steps[1] > 0


def test_a_refused_rig_leaves_the_old_one():
    simulation = Simulation(*START)
    with pytest.raises(ValueError, match='k must be ≥ 0'):
        simulation.rig = PAPER._replace(k=-1.0)
    assert simulation.rig == START.rig


# Standing wheels

STILL = UNCOUPLED._replace(slope=GENTLE.slope, S0=1.0, D0=1.0)
BOTH_AT_REST = State(-ALPHA, 0.0, -ALPHA, 0.0)


def pushing_force(rig, i):
    """The compression that just pushes a wheel at rest over its downhill (front) or uphill (rear) spoke."""
    wheel = (rig.front, rig.rear)[i]
    lean = wheel.alpha - rig.slope if i == 0 else wheel.alpha + rig.slope
    # Hubs at equal height: the coupler lies along the slope, its lever is ℓ cos α.
    return -wheel.mass * rig.gravity * math.sin(lean) / math.cos(wheel.alpha)


def test_wheels_at_rest_on_two_spokes_stand_without_a_strike():
    simulation = Simulation(STILL, State(ALPHA, 0.0, -ALPHA, 0.0))
    assert simulation.standing == [True, True]
    assert simulation.state == BOTH_AT_REST
    assert simulation.steps == [1, 0]  # told from its forward spoke
    assert simulation.advance_to(100.0).strikes == ()
    assert simulation.state == BOTH_AT_REST


def test_a_force_pushes_a_standing_wheel_over_when_it_is_large_enough():
    for part, stands in ((0.999999, True), (1.000001, False)):
        simulation = Simulation(STILL, BOTH_AT_REST)
        simulation.advance_to(1.0)
        simulation.external_force = part * pushing_force(simulation.rig, 0)
        motion = simulation.advance_to(11.0)
        assert simulation.standing == [stands, True]
        assert bool(motion.strikes) != stands
        assert all((strike.wheel, strike.direction) == (1, FORWARD) for strike in motion.strikes)


def test_a_larger_force_pushes_the_other_wheel_over_backwards():
    simulation = Simulation(STILL, BOTH_AT_REST)
    simulation.external_force = 1.01 * pushing_force(simulation.rig, 1)
    motion = simulation.advance_to(0.05)
    assert simulation.standing == [False, False]
    assert motion.omega1 > 0.0 > motion.omega2
    # Backwards over the spoke behind: the angle is told from that spoke, the rotation does not jump.
    assert simulation.steps[1] == -1
    assert motion.rotation2 == pytest.approx(-ALPHA, abs=0.01)
    assert motion.rotation2 < -ALPHA


def test_a_steeper_slope_lets_standing_wheels_go():
    simulation = Simulation(STILL, BOTH_AT_REST)
    simulation.advance_to(1.0)
    simulation.rig = STILL._replace(slope=ALPHA + 0.01)
    strikes = simulation.advance_to(5.0).strikes
    assert simulation.standing == [False, False]
    assert {strike.direction for strike in strikes} == {FORWARD}
    simulation.rig = STILL._replace(slope=0.0)
    simulation.advance_to(60.0)
    assert simulation.standing == [True, True]
    simulation.rig = STILL._replace(slope=-ALPHA - 0.01)
    assert {strike.direction for strike in simulation.advance_to(65.0).strikes} == {BACKWARD}


def test_a_standing_wheel_is_let_go_at_the_moment_at_which_it_begins_to_tip():
    # The rear wheel rolls up to the front one, which stands; the damper pushes until it tips.
    rig = STILL._replace(k=100.0, b=5.0)
    start = State(-ALPHA, 0.0, -0.25, 1.4)

    def tips(t, y):
        return paper_rates(rig, 1.0, np.array([-ALPHA, 0.0, *y]))[1]

    tips.terminal = True
    held = solve_ivp(
        lambda t, y: paper_rates(rig, 1.0, np.array([-ALPHA, 0.0, *y]))[2:],
        (0.0, 1.0),
        start[2:],
        'DOP853',
        events=tips,
        rtol=1e-13,
        atol=1e-15,
        max_step=0.01,
    )
    free = solve_ivp(
        lambda t, y: paper_rates(rig, 1.0, y),
        (held.t[-1], held.t[-1] + 0.1),
        (-ALPHA, 0.0, *held.y[:, -1]),
        'DOP853',
        rtol=1e-13,
        atol=1e-15,
    )
    assert 0.05 < held.t[-1] < 0.5
    simulation = Simulation(rig, start)
    while simulation.time < held.t[-1] - 1e-9:
        assert simulation.standing[0]
        simulation.step()
    assert simulation.time == pytest.approx(held.t[-1], abs=1e-10)
    simulation.advance_to(free.t[-1])
    assert not simulation.standing[0]
    assert list(simulation.state) == pytest.approx(free.y[:, -1], abs=1e-8)


def test_a_wheel_that_rocks_to_a_stand_is_where_it_was():
    simulation = Simulation(STILL, State(-ALPHA, 0.4, -ALPHA, 0.0))
    motion = simulation.advance_to(20.0)
    assert simulation.standing == [True, True]
    assert len(motion.strikes) < 120
    assert motion.rotation1 == pytest.approx(-ALPHA)
    assert (motion.omega1, motion.omega2, motion.rate) == (0.0, 0.0, 0.0)


def test_a_standing_wheel_does_no_work_on_the_other():
    alone = [s.t for s in strikes_of(UNCOUPLED, State(0.0, 0.0, 0.1, 1.0), 5.0) if s.wheel == 2]
    simulation = Simulation(UNCOUPLED, State(-ALPHA, 0.0, 0.1, 1.0))
    beside = [s.t for s in simulation.advance_to(5.0).strikes]
    assert simulation.standing == [True, False]
    assert beside == pytest.approx(alone, abs=1e-12)


# Refusals


@pytest.mark.parametrize('i', range(4))
@pytest.mark.parametrize('value', [math.nan, math.inf])
def test_a_start_that_is_no_number_is_refused_by_name(i, value):
    state = State(*(value if j == i else 0.0 for j in range(4)))
    with pytest.raises(ValueError, match=f'{State._fields[i]} of the start must be finite, got {value}'):
        Simulation(PAPER, state)


@pytest.mark.parametrize(
    ('state', 'name'), [(State(0.27, 0.0, 0.0, 0.0), 'theta1'), (State(0.0, 0.0, -0.27, 0.0), 'theta2')]
)
def test_a_leg_beyond_its_guard_is_refused_by_name(state, name):
    with pytest.raises(ValueError, match=f'{name} of the start must be within ±α = ±0.261799 rad'):
        Simulation(PAPER, state)


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'k': -1.0}, r'k must be ≥ 0.* N/m, got -1'),
        ({'b': math.nan}, r'b must be ≥ 0.* N·s/m, got nan'),
        ({'b': 1e6, 'front': WheelParams(mass=1.0)}, r'b must be ≤ 2\.9e\+05 with these wheels'),
        ({'k': 1e6, 'front': WheelParams(mass=1e-6)}, r'k must be ≤ 1\.02e\+05 with these wheels'),
        ({'slope': 1.0}, 'slope must be'),
        ({'gravity': 0.0}, 'gravity must be > 0'),
        ({'front': WheelParams(spokes=3.0)}, r'front\.spokes must be ≥ 4'),
        ({'rear': WheelParams(mass=0.0)}, r'rear\.mass must be > 0, ≤ 1000 kg'),
        ({'S0': math.inf}, 'S0 must be ≥ -100, ≤ 100 m'),
    ],
)
def test_an_impossible_rig_is_refused_by_name(change, message):
    with pytest.raises(ValueError, match=message):
        Simulation(START.rig._replace(**change), START.state)


def test_hubs_in_one_place_are_refused():
    with pytest.raises(HubsMetError, match=r'the hubs met.*D = 0 m at t = 0 s, S = 0 m.*feet further apart'):
        Simulation(PAPER._replace(S0=0.0), State(0.1, 1.0, 0.1, 1.0))


def test_hubs_in_one_place_are_refused_where_the_wheels_stand_too():
    with pytest.raises(HubsMetError, match='the hubs met'):
        Simulation(PAPER._replace(S0=0.0), BOTH_AT_REST)


@pytest.mark.parametrize('rig', [UNCOUPLED, PAPER._replace(k=5.0, b=0.0), PAPER._replace(b=1.0)])
def test_hubs_that_meet_end_the_motion_each_time_one_asks(rig):
    # On one foothold (S = 0), the rear wheel the faster: it catches up.
    simulation = Simulation(rig._replace(S0=0.0), State(0.0, 1.0, -0.1, 2.0))
    for _ in range(2):
        with pytest.raises(HubsMetError, match='the hubs met'):
            simulation.advance_to(1.0)
    assert 0.05 < simulation.time < 0.15
    assert simulation.state.theta1 == pytest.approx(simulation.state.theta2, abs=2e-6)


def test_hubs_that_pass_each_other_at_a_distance_do_not_meet():
    rig = UNCOUPLED._replace(S0=1e-3)
    assert Simulation(rig, State(0.0, 1.0, -0.1, 2.0)).advance_to(0.2).length > 0.01


@pytest.mark.parametrize(('force', 'speed'), [(1e30, 1.0), (1e300, 1.0), (0.0, 1e200)])
def test_a_motion_beyond_all_measure_is_refused_instead_of_followed_for_ever(force, speed):
    simulation = Simulation(PAPER, State(0.0, speed, 0.0, 1.0))
    simulation.external_force = force
    with pytest.raises(MotionError, match='too fast to follow'):
        simulation.advance_to(1.0)


def test_spokes_without_number_are_refused_instead_of_counted_for_ever():
    wheel = WheelParams(spokes=1e300)
    with pytest.raises(ValueError, match=r'front\.spokes must be ≥ 4'):
        Simulation(RigParams(wheel, wheel), State(0.0, 1.0, 0.0, 1.0)).advance_to(1.0)


def test_a_wheel_balanced_on_its_apex_stays_there():
    rig = RigParams(slope=0.0, S0=1.0, D0=1.0)
    assert Simulation(rig, State(0.0, 0.0, 0.0, 0.0)).advance_to(60.0).rotation1 == 0.0


@settings(max_examples=60, deadline=None)
@given(
    rigs,
    between(-0.6, 0.6),
    st.sampled_from([0.0, 5234.0]),
    st.sampled_from([4.0, 6.0, 12.0]),
    st.tuples(*[st.sampled_from([-1.0, 1.0, 0.0, 0.3])] * 2),
    st.tuples(*[st.sampled_from([0.0, -0.7, 0.7])] * 2),
    st.lists(st.sampled_from([0.0, 40.0, -40.0, 400.0, -400.0]), min_size=4, max_size=4),
)
def test_whatever_happens_legs_stay_within_their_guards_and_time_goes_on(rig, slope, b, spokes, parts, speeds, forces):
    rig = rig._replace(slope=slope, b=b, front=rig.front._replace(spokes=spokes))
    simulation = Simulation(rig, rolling(rig, parts[0], speeds[0], parts[1], speeds[1]))
    try:
        for j, force in enumerate(forces):
            simulation.external_force = force
            motion = simulation.advance_to(0.25 * (j + 1))
            assert all(map(math.isfinite, motion[:-1]))
            assert abs(simulation.state.theta1) <= rig.front.alpha * (1 + 1e-12)
            assert abs(simulation.state.theta2) <= rig.rear.alpha * (1 + 1e-12)
            assert len(motion.strikes) < 400
    except HubsMetError:
        pass


def test_on_its_limit_cycle_a_pair_without_coupler_strikes_evenly():
    strikes = strikes_of(*start(UNCOUPLED, 0.5), 20.0)
    for wheel, name in ((1, 'omega1'), (2, 'omega2')):
        mine = [strike for strike in strikes if strike.wheel == wheel]
        assert np.ptp(np.diff([strike.t for strike in mine])) < 1e-11
        before = limit_cycle_speed(UNCOUPLED.front, UNCOUPLED.slope, UNCOUPLED.gravity, ALPHA)
        assert [getattr(strike.state, name) for strike in mine] == pytest.approx([before] * len(mine), rel=1e-12)


def test_prepared_way_is_the_same_way():
    plain, prepared = (Simulation(*START) for _ in range(2))
    for k in range(1, 400):
        prepared.prepare(k / 100)
        assert prepared.advance_to(k / 100) == plain.advance_to(k / 100)

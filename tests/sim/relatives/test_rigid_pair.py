import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.model import wheel as wheel_alone
from dcdrw_sim.model.dynamics import coupler
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.relatives import rimless_wheel
from dcdrw_sim.relatives.rigid_pair import (
    NEAR_TOGETHER,
    RigidPair,
    energy_per_metre,
    fastest_phase,
    gentlest_slope_at_phase,
    slope_for_velocity,
)
from tests.sim.rigs import ALPHA, between

PAPER = RigParams().resolved()
SMALL = WheelParams(length=0.01)
LONG = RigParams(SMALL, SMALL, D0=100.0).resolved()
"""A bar ten thousand times as long as the spokes."""
FRONT = WheelParams(0.9, 8.0, 11.0)
UNEQUAL = RigParams(
    FRONT,
    WheelParams(1.1, 12.0, math.pi / math.asin(0.9 / 1.1 * math.sin(FRONT.alpha))),
    D0=1.3,
    slope=math.radians(3.0),
).resolved()
few = settings(max_examples=25, deadline=None)
phases = between(0.01, 0.99)
rigs = st.builds(
    lambda length, mass1, mass2, spokes, bar: RigParams(
        WheelParams(length, mass1, spokes), WheelParams(length, mass2, spokes), D0=bar * length, slope=math.radians(6.0)
    ).resolved(),
    between(0.5, 1.5),
    between(5.0, 20.0),
    between(5.0, 20.0),
    between(8.0, 16.0),
    between(0.9, 3.0),
)


# A second opinion in hub coordinates (x1, y1, x2, y2) along and normal to the slope: Newton's equations with the
# spokes and the bar as constraints, whose forces are solved for, by scipy.


def constraints(feet, hubs):
    """Jacobian of the half squared lengths of front spoke, rear spoke and bar, shape (3, 4)."""
    (x1, y1, x2, y2), (foot1, foot2) = hubs, feet
    return np.array([[x1 - foot1, y1, 0.0, 0.0], [0.0, 0.0, x2 - foot2, y2], [x1 - x2, y1 - y2, x2 - x1, y2 - y1]])


def masses(rig):
    return np.array([rig.front.mass, rig.front.mass, rig.rear.mass, rig.rear.mass])


def saddle(rig, feet, hubs, right):
    """Solve for acceleration or velocity and the forces or impulses of the constraints."""
    J = constraints(feet, hubs)
    matrix = np.block([[np.diag(masses(rig)), -J.T], [J, np.zeros((3, 3))]])
    return np.linalg.solve(matrix, right)


def rates(rig, feet, y):
    hubs, velocity = y[:4], y[4:]
    weight = rig.gravity * np.array([math.sin(rig.slope), -math.cos(rig.slope)] * 2)
    twist = constraints((0.0, 0.0), [velocity[0], velocity[1], velocity[2], velocity[3]]) @ velocity
    return np.concatenate([velocity, saddle(rig, feet, hubs, np.concatenate([masses(rig) * weight, -twist]))[:4]])


def energy(rig, y):
    height = y[[1, 3]] * math.cos(rig.slope) - y[[0, 2]] * math.sin(rig.slope)
    return 0.5 * masses(rig) @ y[4:] ** 2 + rig.gravity * masses(rig)[[0, 2]] @ height


def simulate(rig, start, S, strikes):
    """Wheel, time, rear or front angle of the other wheel, and kinetic energy left, of each strike."""
    lengths, alphas, feet = (rig.front.length, rig.rear.length), (rig.front.alpha, rig.rear.alpha), [S, 0.0]
    theta, omega = np.array(start[::2]), np.array(start[1::2])
    y = np.concatenate(
        [
            [
                S + lengths[0] * math.sin(theta[0]),
                lengths[0] * math.cos(theta[0]),
                lengths[1] * math.sin(theta[1]),
                lengths[1] * math.cos(theta[1]),
            ],
            [
                lengths[0] * omega[0] * math.cos(theta[0]),
                -lengths[0] * omega[0] * math.sin(theta[0]),
                lengths[1] * omega[1] * math.cos(theta[1]),
                -lengths[1] * omega[1] * math.sin(theta[1]),
            ],
        ]
    )
    t, found = 0.0, []
    for _ in range(strikes):

        def reaches(i):
            def guard(t, state):
                return math.atan2(state[2 * i] - feet[i], state[2 * i + 1]) - alphas[i]

            guard.terminal, guard.direction = True, 1
            return guard

        leg = solve_ivp(
            lambda t, y: rates(rig, feet, y),
            (t, t + 20.0),
            y,
            'DOP853',
            rtol=1e-11,
            atol=1e-13,
            events=[reaches(0), reaches(1)],
        )
        assert energy(rig, leg.y[:, -1]) == pytest.approx(energy(rig, y), abs=1e-8 * abs(energy(rig, y)))
        t, y = leg.t[-1], leg.y[:, -1]
        i = 0 if leg.t_events[0].size else 1
        feet[i] += 2.0 * lengths[i] * math.sin(alphas[i])
        y[4:] = saddle(rig, feet, y[:4], np.concatenate([masses(rig) * y[4:], np.zeros(3)]))[:4]
        other = math.atan2(y[2 - 2 * i] - feet[1 - i], y[3 - 2 * i])
        found.append((i + 1, t, other, 0.5 * masses(rig) @ y[4:] ** 2))
    return found


@pytest.mark.parametrize(
    ('rig', 'phase', 'push'), [(PAPER, 0.216, 1.0), (PAPER, 0.5, 1.4), (PAPER, 0.9, 0.8), (UNEQUAL, 0.3, 1.2)]
)
def test_an_integration_with_constraint_forces_agrees_and_the_phase_never_changes(rig, phase, push):
    pair = RigidPair(rig, phase)
    first = pair.stances[0]
    left = push * pair.gait().energy
    found = simulate(rig, pair.state(*first.start, first.S, left), first.S, 16)
    assert [wheel for wheel, *_ in found] == [2, 1] * 8
    for wheel, _, other, kinetic in found:
        if wheel == 1:
            left = pair.next_energy(left)
            assert 0.5 - other / (2.0 * rig.rear.alpha) == pytest.approx(phase, abs=1e-6)
            assert kinetic == pytest.approx(left, rel=1e-6)
        else:
            assert other == pytest.approx(first.end[0], abs=1e-6)
    if push == 1.0:
        fronts = [t for wheel, t, *_ in found if wheel == 1]
        assert fronts == pytest.approx(pair.gait().period * np.arange(1, 9), rel=1e-7)


def test_equal_wheels_have_the_same_phase_at_strikes_of_either():
    for phase in np.linspace(0.01, 0.99, 12):
        first, second = RigidPair(PAPER, phase).stances
        assert (first.end[0] + ALPHA) / (2.0 * ALPHA) == pytest.approx(phase)
        assert first.kept == pytest.approx(second.kept, rel=1e-12)


def test_the_coupled_pair_comes_ever_closer_with_a_stiffer_coupler():
    pair = RigidPair(PAPER, 0.3)
    first, gait = pair.stances[0], pair.gait()
    errors = []
    for b in (2e3, 4e3, 8e3):
        rig = pair.rig._replace(S0=first.S, k=100.0 * b, b=b)
        simulation = Simulation(rig, pair.state(*first.start, first.S, gait.energy))
        strikes = []
        while len(strikes) < 4:
            _, strike = simulation.step()
            strikes += [strike] if strike else []
        assert [strike.wheel for strike in strikes] == [2, 1, 2, 1]
        before = pair.state(*first.end, first.S, gait.energy + first.drop)
        errors.append(
            [
                strikes[0].state.theta1 - before.theta1,
                strikes[0].state.omega1 - before.omega1,
                strikes[0].state.omega2 - before.omega2,
            ]
        )
        assert strikes[3].t == pytest.approx(2.0 * gait.period, rel=0.3 / b)
    for softer, stiffer in pairwise(np.abs(errors)):
        assert softer / stiffer == pytest.approx(2.0, rel=0.1)  # as 1/b


# Strikes


@few
@given(rigs, phases)
def test_a_strike_takes_energy_and_leaves_what_the_new_contacts_allow(rig, phase):
    pair = RigidPair(rig, phase)
    for stance, energy_left in zip(pair.stances, (3.0, 5.0), strict=True):
        before = pair.state(*stance.end, stance.S, energy_left)
        after = pair.impact(before, stance.S, stance.struck)
        S = stance.S + rig.front.step_length * (stance.struck[0] - stance.struck[1])
        for state, distance in ((before, stance.S), (after.state, S)):
            rigid = coupler(pair.rig, state, distance)
            assert rigid.length == pytest.approx(rig.D0, rel=1e-12)
            assert rigid.rate == pytest.approx(0.0, abs=1e-12)
        assert 0.0 < after.kept < 1.0
        assert pair.kinetic_energy(after.state) == pytest.approx(after.kept * energy_left)
        assert after.state.omega1 > 0.0
        assert after.state.omega2 > 0.0


@few
@given(rigs, phases)
def test_a_strike_s_impulses_along_spokes_and_bar_change_the_hubs_momenta(rig, phase):
    pair = RigidPair(rig, phase)
    for stance in pair.stances:
        before = pair.state(*stance.end, stance.S, 2.0)
        impact = pair.impact(before, stance.S, stance.struck)
        after, S = impact.state, stance.S + rig.front.step_length * (stance.struck[0] - stance.struck[1])
        hubs = np.array(
            [
                [S + rig.front.length * math.sin(after.theta1), rig.front.length * math.cos(after.theta1)],
                [rig.rear.length * math.sin(after.theta2), rig.rear.length * math.cos(after.theta2)],
            ]
        )
        bar = (hubs[0] - hubs[1]) / rig.D0
        for state_before, state_after, wheel, impulse, pull in (
            (before[:2], after[:2], rig.front, impact.front_foot, -impact.bar),
            (before[2:], after[2:], rig.rear, impact.rear_foot, impact.bar),
        ):
            change = [
                wheel.mass
                * wheel.length
                * (state_after[1] * part(state_after[0]) - state_before[1] * part(state_before[0]))
                for part in (np.cos, lambda a: -np.sin(a))
            ]
            spoke = np.array([math.sin(state_after[0]), math.cos(state_after[0])])
            assert change == pytest.approx(impulse * spoke + pull * bar, abs=1e-10)


@few
@given(phases)
def test_with_a_long_bar_a_strike_keeps_what_the_closed_form_says(phase):
    square2, square = math.tan(ALPHA * (1.0 - 2.0 * phase)) ** 2, math.tan(ALPHA) ** 2
    expected = ((2.0 + square2 - square) / (2.0 + square2 + square)) ** 2
    assert [stance.kept for stance in RigidPair(LONG, phase).stances] == pytest.approx([expected] * 2, rel=1e-4)


def test_one_right_after_the_other_keeps_more_than_both_at_once():
    assert RigidPair(PAPER, 0.0).multiplier == pytest.approx(math.cos(2 * ALPHA) ** 2)
    for phase in (NEAR_TOGETHER, 1.0 - NEAR_TOGETHER):
        assert RigidPair(PAPER, phase).multiplier == pytest.approx(math.cos(ALPHA) ** 8, rel=1e-6)


def test_the_other_foot_is_pulled_at_one_strike_in_a_step_but_hardly_at_50_percent():
    for phase, pulled in ((0.2, 0), (0.8, 1)):
        impacts = RigidPair(LONG, phase).impacts()
        assert (impacts[0].front_foot < 0.0, impacts[1].rear_foot < 0.0) == (pulled == 0, pulled == 1)
    halfway = RigidPair(LONG, 0.5).impacts()
    assert abs(halfway[0].front_foot) < 1e-4 * halfway[0].rear_foot


# Steady gait


@few
@given(rigs, phases)
def test_steady_gait_returns_and_loses_what_the_slope_gives(rig, phase):
    pair = RigidPair(rig, phase)
    gait = pair.gait()
    assert pair.next_energy(gait.energy) == pytest.approx(gait.energy, rel=1e-12)
    assert (pair.next_energy(1.1 * gait.energy) - gait.energy) / (0.1 * gait.energy) == pytest.approx(pair.multiplier)
    lost = sum(pair.kinetic_energy(impact.state) * (1.0 / impact.kept - 1.0) for impact in pair.impacts())
    assert lost == pytest.approx(energy_per_metre(rig) * rig.front.step_length, rel=1e-9)


def test_striking_at_once_it_is_a_single_wheel():
    gait = RigidPair(PAPER, 0.0).gait()
    wheel = PAPER.front
    assert gait.velocity == pytest.approx(rimless_wheel.limit_cycle_velocity(wheel, PAPER.slope, 9.81), rel=1e-10)
    assert gentlest_slope_at_phase(PAPER, 0.0) == pytest.approx(wheel_alone.gentlest_slope(wheel), rel=1e-9)


@pytest.mark.parametrize('phase', [0.0, 0.25, 0.5, 0.9])
def test_above_the_gentlest_slope_it_rolls_below_it_does_not(phase):
    least = gentlest_slope_at_phase(PAPER, phase)
    above, below = (RigidPair(PAPER._replace(slope=least * part), phase) for part in (1.0001, 0.9999))
    assert above.gait().velocity > 0.0
    assert math.isnan(below.gait().velocity)
    steady = above.gait().energy
    assert math.isnan(below.next_energy(steady * 0.99))


def test_a_wheel_pair_that_is_too_slow_does_not_come_over_its_top():
    pair = RigidPair(PAPER, 0.3)
    climb = pair.stances[0].climb
    assert math.isnan(pair.next_energy(climb * 0.999))
    assert pair.next_energy(climb * 1.001 + pair.stances[1].climb) > 0.0


def test_fastest_phase_is_the_maximum_of_speed_and_tends_to_50_percent_with_the_bar_s_length():
    def speed(rig, phase):
        return RigidPair(rig, phase).gait().velocity

    offsets = []
    for bar in (1.0, 4.0, 16.0, 100.0):
        rig = PAPER._replace(D0=bar)
        best = fastest_phase(rig)
        offsets.append(best - 0.5)
        top = speed(rig, best)
        assert all(speed(rig, phase) < top for phase in np.linspace(0.0, 0.999, 50))
        assert speed(rig, best + 0.01) - top == pytest.approx(speed(rig, best - 0.01) - top, rel=0.03)
    assert offsets[-1] == pytest.approx(0.0, abs=1e-4)
    assert 0.0 < offsets[2] < offsets[1] < offsets[0] < 0.01
    assert offsets[1] / offsets[2] == pytest.approx(4.0, rel=0.1)  # as 1/D0
    assert fastest_phase(PAPER) == pytest.approx(0.5063, abs=1e-4)


@few
@given(phases)
def test_with_a_long_bar_the_speed_is_symmetric_about_50_percent(phase):
    there, back = (RigidPair(LONG, p).gait().velocity for p in (phase, 1.0 - phase))
    assert there == pytest.approx(back, rel=1e-5)


def test_on_a_steep_slope_50_percent_is_slowest():
    steep = LONG._replace(slope=math.radians(20.0))
    assert fastest_phase(steep) == pytest.approx(round(fastest_phase(steep)), abs=1e-3)  # either end
    speeds = [RigidPair(steep, phase).gait().velocity for phase in (0.1, 0.3, 0.5, 0.7, 0.9)]
    assert min(speeds) == speeds[2]


def test_energy_per_metre_at_one_speed_is_least_near_50_percent():
    velocity = RigidPair(PAPER, 0.5).gait().velocity
    cost = {}
    for phase in (0.0, 0.1, 0.3, 0.5, 0.7, 0.9):
        slope = slope_for_velocity(PAPER, phase, velocity)
        assert RigidPair(PAPER._replace(slope=slope), phase).gait().velocity == pytest.approx(velocity, rel=1e-7)
        cost[phase] = energy_per_metre(PAPER._replace(slope=slope))
    assert min(cost, key=cost.get) == 0.5
    assert cost[0.5] == pytest.approx(energy_per_metre(PAPER), rel=1e-7)
    assert cost[0.0] > 1.25 * cost[0.5]


# What has no gait


@pytest.mark.parametrize('phase', [-0.1, 1.0, math.nan])
def test_impossible_phase_is_refused(phase):
    with pytest.raises(ValueError, match='phase must be in'):
        RigidPair(PAPER, phase)


def test_wheels_of_unequal_step_length_are_refused():
    with pytest.raises(ValueError, match='equal step length'):
        RigidPair(PAPER._replace(rear=WheelParams(spokes=13.0)), 0.5)


@pytest.mark.parametrize('bar', [0.0, 0.02, 0.03])
def test_a_bar_too_short_is_told(bar):
    with pytest.raises(ValueError, match='too short'):
        RigidPair(PAPER._replace(D0=bar), 0.5)


def test_too_gentle_a_slope_is_told():
    gentle = PAPER._replace(slope=math.radians(0.1))
    assert all(math.isnan(value) for value in RigidPair(gentle, 0.5).gait())
    with pytest.raises(ValueError, match=r'steeper than 0\.2753°'):
        fastest_phase(gentle)
    with pytest.raises(ValueError, match='no slope up to 45°'):
        slope_for_velocity(PAPER, 0.5, 100.0)

import math

import numpy as np
import pytest
from hypothesis import given, settings

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.map.return_map import NoReturnError, ReturnMap, SectionState, spectrum
from dcdrw_sim.map.variation import jacobian
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.scaling import nondimensional
from dcdrw_sim.model.wheel import kept
from dcdrw_sim.motion.trajectory import run
from tests.sim.oracle import integrate, paper_rates
from tests.sim.rigs import ALPHA, GENTLE, REAL, UNCOUPLED, UNEQUAL, between, rigs, rolling, starts

SIN = math.sin(math.pi / 12)
TABLE = [  # contract §3: D0, k̂, b̂, θ2* [deg], moduli
    (1.0, 1e-4, 0.15, -0.615, (0.9477, 0.7826, 0.394)),
    (1.0, 1e-3, 0.3, -0.128, (0.9166, 0.8298, 0.1845)),
    (1.0 + SIN, 5e-3, 0.15, -0.863, (0.8911, 0.7829, 0.4188)),
    (1.0 + SIN, 1e-2, 0.2, -0.933, (0.8450, 0.7976, 0.3429)),
    (1.0 + SIN, 1e-3, 3.0, -0.971, (0.9481, 0.8078, 0.000)),
]
# Wheels unlike in all but the length of their steps.
MIXED = RigParams(
    WheelParams(0.95, 9.0, 12),
    WheelParams(0.95 * SIN / math.sin(math.pi / 13), 11.0, 13),
    k=20.0,
    b=30.0,
    slope=math.radians(2.5),
)
STIFF = RigParams(k=300.0, b=2000.0, slope=math.radians(4.0))
BEHIND = RigParams(S0=-1.2, D0=1.2, k=30.0)


def sweep_map(D0, k, b):
    return ReturnMap(preset('paper-sweep')._replace(S0=1.0, D0=D0, k=k, b=b))


def differences(return_map, state, h=1e-5):
    """The derivative of the map by central differences."""
    state = np.array(state)
    columns = [
        np.subtract(
            return_map.step(SectionState(*(state + h * axis).tolist())),
            return_map.step(SectionState(*(state - h * axis).tolist())),
        )
        / (2 * h)
        for axis in np.eye(3)
    ]
    return np.array(columns).T


# The contract


@pytest.mark.parametrize(('D0', 'k', 'b', 'theta2_deg', 'moduli'), TABLE)
def test_fixed_points_and_multipliers_are_those_of_the_contract(D0, k, b, theta2_deg, moduli):
    return_map = sweep_map(D0, k, b)
    fixed = return_map.fixed_point()
    assert math.degrees(fixed.state.theta2) == pytest.approx(theta2_deg, abs=0.01)
    assert abs(fixed.multipliers) == pytest.approx(moduli, abs=1e-3)
    assert list(return_map.step(fixed.state)) == pytest.approx(list(fixed.state), abs=1e-11)
    assert fixed.stable
    assert fixed.derivative == pytest.approx(differences(return_map, fixed.state), abs=1e-7)


# The step


@pytest.mark.parametrize('rig', [RigParams(), MIXED, BEHIND, REAL])
def test_a_step_is_that_of_an_independent_integration(rig):
    return_map = ReturnMap(rig)
    start = return_map.at_phase(0.3)
    after = State(-rig.front.alpha, start.omega1 * kept(rig.front), start.theta2, start.omega2)
    apart = return_map.rig._replace(S0=return_map.rig.S0 + rig.front.step_length)
    strikes, _ = integrate(apart, after, 1.0)
    strike = next(strike for strike in strikes if strike.wheel == 1)
    assert list(return_map.step(start)) == pytest.approx(strike.state[1:], abs=1e-9)


def test_steps_follow_one_run_from_strike_to_strike():
    return_map = ReturnMap(MIXED)
    start = return_map.at_phase(0.35)
    strikes = run(MIXED, State(MIXED.front.alpha, *start), strikes=21).strikes
    states = return_map.iterate(start, 10)
    assert states == pytest.approx(np.array([strike.state[1:] for strike in strikes if strike.wheel == 1]), abs=1e-12)


def test_phase_at_the_section_is_that_of_the_start():
    return_map = ReturnMap(MIXED)
    for phase in (0.0, 0.216, 0.5, 0.9):
        assert return_map.phase(return_map.at_phase(phase)) == pytest.approx(phase, abs=1e-15)


def test_the_fourth_raw_state_is_the_length_of_the_coupler():
    return_map = ReturnMap(MIXED)
    states = return_map.iterate(return_map.at_phase(0.3), 2)
    motion = run(MIXED, State(MIXED.front.alpha, *states[0]), strikes=5)
    before = [strike.t - 1e-9 for strike in motion.strikes if strike.wheel == 1][1:]
    assert return_map.raw(states)[1:, 3] == pytest.approx(motion.at(before).coupler_length, abs=1e-8)
    assert np.array_equal(return_map.raw(states)[:, :3], states)


# The derivative


@given(rigs, starts, between(-5.0, 5.0))
def test_jacobian_is_that_of_the_papers_equations(rig, start, force):
    rig, point, h = rig.resolved(), np.array([*rolling(rig, *start), force]), 1e-6

    def at(here):
        return paper_rates(rig, rig.S0, here[:4], here[4])

    columns = [(at(point + h * axis) - at(point - h * axis)) / (2 * h) for axis in np.eye(5)]
    exact = jacobian(rig, State(*point[:4]), rig.S0, force)
    assert exact[:4] == pytest.approx(np.array(columns).T, rel=1e-6, abs=1e-6)
    assert not exact[4].any()


def test_the_derivative_by_a_held_force_is_the_limit_of_differences():
    for force in (0.0, -3.0):
        state, h = ReturnMap(preset('paper')).at_phase(0.4), 1e-4
        exact = ReturnMap(preset('paper'), force).linearize(state).by_force
        ahead, behind = (np.array(ReturnMap(preset('paper'), force + step).step(state)) for step in (h, -h))
        assert exact == pytest.approx((ahead - behind) / (2.0 * h), rel=1e-6, abs=1e-9)


@settings(max_examples=15, deadline=None)
@given(rigs, starts)
def test_derivative_is_the_limit_of_differences_wherever_the_motion_returns(rig, start):
    return_map = ReturnMap(rig._replace(rear=rig.front))
    _, omega1, theta2, omega2 = rolling(rig._replace(rear=rig.front), *start)
    state = SectionState(omega1, theta2, omega2)
    try:
        result = return_map.linearize(state)
        approximate = differences(return_map, state)
    except NoReturnError:
        return
    assert result.state == return_map.step(state)
    size = abs(result.derivative).max()
    assert result.derivative == pytest.approx(approximate, abs=1e-5 * size**2)


@pytest.mark.parametrize('rig', [MIXED, STIFF, BEHIND, REAL])
@pytest.mark.parametrize('phase', [0.2, 0.5, 0.7])
def test_derivative_holds_for_unlike_wheels_a_stiff_coupler_and_the_rear_wheel_ahead(rig, phase):
    return_map = ReturnMap(rig)
    state = return_map.at_phase(phase)
    assert return_map.linearize(state).derivative == pytest.approx(differences(return_map, state), abs=2e-7)


@pytest.mark.parametrize('phase', [0.1, 0.5, 0.8])
def test_uncoupled_wheels_keep_their_phase_and_lose_their_errors_of_speed_by_cos_squared(phase):
    fixed = ReturnMap(UNCOUPLED).fixed_point(ReturnMap(UNCOUPLED).at_phase(phase))
    assert ReturnMap(UNCOUPLED).phase(fixed.state) == pytest.approx(phase, abs=1e-12)
    assert fixed.multipliers == pytest.approx([1.0, 0.75, 0.75], abs=1e-9)  # cos²(30°)
    assert not fixed.stable
    assert math.isinf(fixed.steps_per_decade)


def test_uncoupled_wheels_of_wrong_speed_come_to_a_fixed_point_nearby():
    return_map = ReturnMap(UNCOUPLED)
    start = return_map.at_phase(0.3)
    fixed = return_map.fixed_point(start._replace(omega1=start.omega1 * 1.05))
    assert fixed.multipliers == pytest.approx([1.0, 0.75, 0.75], abs=1e-8)


def test_units_do_not_matter():
    rig, scales = nondimensional(RigParams())
    one, other = ReturnMap(RigParams()).fixed_point(), ReturnMap(rig).fixed_point()
    assert one.multipliers == pytest.approx(other.multipliers, abs=1e-9)
    assert one.state.theta2 == pytest.approx(other.state.theta2, abs=1e-10)
    assert one.period == pytest.approx(other.period * scales.time, rel=1e-10)


def test_in_the_end_the_error_shrinks_by_the_largest_multiplier():
    return_map = sweep_map(*TABLE[3][:3])
    fixed = return_map.fixed_point()
    errors = return_map.iterate(return_map.at_phase(0.3), 121)[:, 1] - fixed.state.theta2
    assert errors[-1] / errors[-2] == pytest.approx(fixed.multipliers[0].real, abs=1e-4)
    assert errors[-1] / errors[-2] == pytest.approx(0.1 ** (1 / fixed.steps_per_decade), abs=1e-4)


def test_multipliers_are_sorted_by_modulus():
    turn = np.array([[0.3, -0.4, 0.0], [0.4, 0.3, 0.0], [0.0, 0.0, -0.9]])
    assert spectrum(turn) == pytest.approx([-0.9, 0.3 + 0.4j, 0.3 - 0.4j])


# The fixed point


@pytest.mark.parametrize('row', [1, 2, 4])
def test_every_start_leads_to_the_limit_cycle(row):
    return_map = sweep_map(*TABLE[row][:3])
    expected = return_map.fixed_point().state
    for phase in (0.06, 0.3, 0.94):
        assert list(return_map.fixed_point(return_map.at_phase(phase)).state) == pytest.approx(list(expected), abs=1e-9)


def test_near_the_fixed_point_newtons_method_is_quick():
    return_map = ReturnMap(RigParams())
    fixed = return_map.fixed_point()
    assert return_map.fixed_point(fixed.state).iterations == 0
    assert return_map.fixed_point(fixed.state._replace(theta2=0.0)).iterations <= 4


def test_where_the_damper_takes_more_than_the_slope_gives_there_is_no_fixed_point():
    with pytest.raises(ValueError, match=r'no fixed point was found in 40 iterations; .* or the pair has no limit'):
        sweep_map(1.0 + SIN, 5e-3, 1.0).fixed_point(limit=40)


# Motions that do not return


@pytest.mark.parametrize(
    ('state', 'message'),
    [
        (SectionState(1.1, 0.1, 6.0), r'the front wheel slipped a step \(n = -1 at the section\)'),
        (SectionState(3.5, -0.2, 1.0), r'the rear wheel slipped a step \(n = 1 at the section\)'),
        (SectionState(0.1, -0.2, 0.8), 'the front wheel did not pass its apex and rocked back'),
        (SectionState(1.1, -0.2, -0.5), 'the rear wheel did not pass its apex and rocked back'),
    ],
)
def test_a_step_that_does_not_return_says_why(state, message):
    with pytest.raises(NoReturnError, match=f'does not come back to the section: .*{message}'):
        ReturnMap(RigParams()).step(state)


def test_a_wheel_that_stands_and_hubs_that_meet_end_the_step():
    with pytest.raises(NoReturnError, match='the rear wheel did not pass its apex, rocked, and stands still'):
        ReturnMap(UNCOUPLED).step(SectionState(1.2, -ALPHA, 0.0))
    with pytest.raises(NoReturnError, match='the hubs met'):
        ReturnMap(UNCOUPLED._replace(S0=-UNCOUPLED.front.step_length)).step(SectionState(1.2, -0.25, 0.9))


@pytest.mark.parametrize(
    ('state', 'message'),
    [
        (SectionState(0.0, 0.1, 1.0), 'omega1 at the section must be > 0, got 0'),
        (SectionState(math.nan, 0.1, 1.0), 'omega1 at the section must be > 0, got nan'),
        (SectionState(1.0, 0.5, 1.0), 'theta2 of the start must be within'),
        (SectionState(1.0, 0.1, math.inf), 'omega2 of the start must be finite'),
    ],
)
def test_what_is_not_on_the_section_is_refused(state, message):
    for use in (ReturnMap(RigParams()).step, ReturnMap(RigParams()).fixed_point):
        with pytest.raises(ValueError, match=message):
            use(state)


def test_wheels_that_step_differently_far_have_no_map():
    with pytest.raises(ValueError, match='needs wheels of equal step length'):
        ReturnMap(UNEQUAL)


def test_on_too_gentle_a_slope_there_is_no_default_start():
    with pytest.raises(ValueError, match='too gentle for the front wheel'):
        ReturnMap(GENTLE).fixed_point()

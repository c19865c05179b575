"""Friction smoothed by tanh(v/v0), beside exact dry friction, which sticks and slips."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.dynamics import State, accelerations, coupler, grip
from dcdrw_sim.motion.ensemble import run_ensemble
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.motion.trajectory import run
from tests.sim.oracle import paper_rates

SHARP = (1e-2, 1e-3, 1e-4)
"""Ever smaller speeds over which friction turns round [m/s]."""
STICKY = RigParams(k=400.0, b=0.0, D0=0.95, S0=1.0, slope=0.0, coupler_friction=4.0).resolved()


def flow(state, force):
    """Rates of the state under a coupler force, its spring left out."""
    bare = STICKY._replace(k=0.0, coupler_friction=0.0)
    first, second = accelerations(bare, State(*map(float, state)), bare.S0, force)
    return np.array([state[1], first, state[3], second])


def rate(state):
    return coupler(STICKY, State(*map(float, state)), STICKY.S0).rate


def spring(state):
    return STICKY.k * (coupler(STICKY, State(*map(float, state)), STICKY.S0).length - STICKY.D0)


def stick_slip(state, seconds, steps):
    """The motion under exact dry friction, and for which part of the time the coupler stuck.

    In every short step friction gives what stops the coupler, or as much of that as it can (Moreau's time stepping).
    """
    y, dt, stuck, most = np.array(state), seconds / steps, 0, STICKY.coupler_friction
    for _ in range(steps):
        ahead, pushed = (y + dt * flow(y, spring(y) + force) for force in (0.0, 1.0))
        needed = -rate(ahead) / (rate(pushed) - rate(ahead))
        stuck += abs(needed) <= most
        y = ahead + (pushed - ahead) * min(max(needed, -most), most)
    return y, stuck / steps


@pytest.mark.parametrize(
    ('begin', 'sticks'), [(State(-0.1, 0.7, -0.05, 0.7), True), (State(-0.2, 1.2, -0.1, 0.95), False)]
)
def test_the_sharper_the_friction_the_nearer_to_exact_stick_slip(begin, sticks):
    exact, stuck = stick_slip(begin, 0.25, 8000)
    assert (stuck > 0.5) == sticks
    errors = []
    for v0 in SHARP:
        rig = STICKY._replace(friction_speed=v0)
        simulation = Simulation(rig, begin)
        assert not simulation.advance_to(0.25).strikes
        errors.append(np.abs(np.array(simulation.state) - exact).max())
    assert errors[0] < 0.01
    assert errors[1] < 1e-3
    assert errors[2] < 2e-4


@pytest.mark.parametrize('v0', SHARP)
def test_a_turn_of_the_coupler_is_never_stepped_over(v0):
    rig = RigParams(k=150.0, b=0.0, D0=0.9, S0=1.0, coupler_friction=3.0, friction_speed=v0)
    begin = State(-0.2, 1.2, -0.1, 1.0)
    alone, together = run(rig, begin, strikes=6), run_ensemble(rig, [begin], math.inf, 6)
    assert together.strikes['t'][0] == pytest.approx([strike.t for strike in alone.strikes], abs=1e-9)
    fine = solve_ivp(
        lambda t, y: paper_rates(rig, rig.S0, y), (0.0, 0.25), begin, 'LSODA', rtol=1e-11, atol=1e-12, max_step=1e-3
    )
    simulation = Simulation(rig, begin)
    simulation.advance_to(0.25)
    assert list(simulation.state) == pytest.approx(fine.y[:, -1], abs=1e-7)


@pytest.mark.parametrize('v0', SHARP)
def test_a_wheel_that_resistance_holds_on_a_spoke_creeps_as_slowly_as_v0_says(v0):
    rig = RigParams(k=0.0, b=0.0, slope=0.0, rolling_resistance=0.02, friction_speed=v0)
    lean = 0.01  # sin θ < c_r: exact friction holds it
    simulation = Simulation(rig, State(lean, 0.0, 0.1, 1.0))
    simulation.advance_to(0.2)
    creep = v0 / rig.front.length * math.atanh(math.sin(lean) / rig.rolling_resistance)
    assert simulation.state.theta1 - lean == pytest.approx(0.2 * creep, rel=0.3)


def test_friction_is_odd_and_whole_beyond_its_speed():
    rig = RigParams(friction_speed=0.01)
    assert grip(rig, 0.0) == 0.0
    assert grip(rig, -0.02) == -grip(rig, 0.02)
    assert grip(rig, 0.2) == pytest.approx(1.0)


def test_the_smoothest_friction_is_a_damper():
    rig = RigParams(b=20.0)
    rubbing = rig._replace(b=0.0, coupler_friction=20.0 * 10.0, friction_speed=10.0)
    begin = State(-0.1, 0.9, 0.05, 0.75)
    damped, rubbed = (Simulation(one, begin).advance_to(0.2) for one in (rig, rubbing))
    assert rubbed.rotation1 == pytest.approx(damped.rotation1, abs=1e-6)


def test_friction_that_turns_round_too_fast_is_refused_by_name():
    with pytest.raises(ValueError, match='coupler_friction / friction_speed must be ≤'):
        Simulation(RigParams(coupler_friction=1e3, friction_speed=1e-7), State(0.0, 1.0, 0.1, 1.0))
    with pytest.raises(ValueError, match='rolling_resistance / friction_speed must be ≤'):
        Simulation(RigParams(rolling_resistance=0.1, friction_speed=1e-7), State(0.0, 1.0, 0.1, 1.0))

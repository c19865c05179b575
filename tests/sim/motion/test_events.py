import json
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.model.dynamics import State, hub_distance, mechanical_energy, stance_distance
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.start import start
from dcdrw_sim.model.wheel import kept, kinetic_energy
from dcdrw_sim.motion.cases import read_cases
from dcdrw_sim.motion.ends import BACKWARD, FORWARD, End
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.motion.trajectory import run
from tests import ROOT
from tests.sim.oracle import paper_rates
from tests.sim.rigs import ALPHA, GENTLE, REAL, UNCOUPLED, UNEQUAL

REFERENCES = [ROOT / 'tests' / 'data' / name for name in ('strikes.json', 'strikes_rig.json')]
CASES = [case for path in REFERENCES for case in read_cases(path)[0]]
LISTED = [listed for path in REFERENCES for listed in json.loads(path.read_text())]


@pytest.mark.parametrize(
    ('case', 'listed'),
    list(zip(CASES, LISTED, strict=True)),
    ids=[case.name for case in CASES],
)
def test_every_strike_of_the_reference_to_1e_9(case, listed):
    result = run(case.rig, case.state, strikes=len(listed['strikes']))
    assert result.end is End.STRIKES
    assert [strike.wheel for strike in result.strikes] == [strike['wheel'] for strike in listed['strikes']]
    for strike, expected in zip(result.strikes, listed['strikes'], strict=True):
        assert strike.t == pytest.approx(expected['t'], abs=1e-9, rel=0)
        assert list(strike.state) == pytest.approx(expected['state'], abs=1e-9, rel=0)
        assert strike.direction == FORWARD


@pytest.mark.parametrize(
    ('rig', 'state'),
    [
        start(preset('paper'), 0.216),
        start(UNEQUAL, 0.7),
        start(REAL, 0.7),
        (GENTLE, State(-ALPHA, 0.3, 0.0, -0.2)),  # rocks
    ],
)
def test_a_strike_takes_the_energy_of_the_speed_that_it_does_not_keep_and_nothing_else(rig, state):
    simulation, struck = Simulation(rig, state), 0
    rig = simulation.rig
    while struck < 12:
        steps = tuple(simulation.steps)
        _, strike = simulation.step()
        if not strike:
            continue
        struck += 1
        before, after, i = strike.state, simulation.state, strike.wheel - 1
        wheel = (rig.front, rig.rear)[i]
        kinetic = kinetic_energy(wheel, before[2 * i + 1])
        loss = mechanical_energy(rig, before, *steps) - mechanical_energy(rig, after, *simulation.steps)
        assert loss == pytest.approx((1.0 - kept(wheel) ** 2) * kinetic, rel=1e-12, abs=1e-12)
        assert after[2 * i + 1] == before[2 * i + 1] * kept(wheel)
        assert (after[2 - 2 * i], after[3 - 2 * i]) == (before[2 - 2 * i], before[3 - 2 * i])
        assert hub_distance(rig, after, stance_distance(rig, *simulation.steps)) == pytest.approx(
            hub_distance(rig, before, stance_distance(rig, *steps)), abs=1e-14
        )
        assert simulation.steps[i] == steps[i] + strike.direction
        assert simulation.steps[1 - i] == steps[1 - i]


def test_the_struck_wheel_is_exactly_on_its_guard():
    for strike in run(*start(UNEQUAL, 0.3), strikes=10).strikes:
        alpha = (UNEQUAL.front, UNEQUAL.rear)[strike.wheel - 1].alpha
        assert strike.state[2 * strike.wheel - 2] == alpha


def test_a_wheel_that_does_not_pass_its_apex_rocks_ever_faster_until_it_stands():
    result = run(GENTLE._replace(k=0.0, b=0.0), State(-ALPHA, 0.6, 0.0, 2.0), seconds=60.0)
    assert (result.end, result.wheel) == (End.STANDING, 1)
    assert result.reason.startswith('the front wheel did not pass its apex')
    rocks = [strike for strike in result.strikes if strike.wheel == 1]
    assert [rock.direction for rock in rocks] == [(BACKWARD, FORWARD)[j % 2] for j in range(len(rocks))]
    assert np.all(np.diff([rock.t for rock in rocks], n=2) < 0.0)
    assert len(rocks) < 120


def test_wheels_alike_strike_at_one_instant_each_with_a_strike_of_its_own():
    result = run(UNCOUPLED, State(0.1, 1.0, 0.1, 1.0), strikes=10)
    for one, other in zip(result.strikes[::2], result.strikes[1::2], strict=True):
        assert {one.wheel, other.wheel} == {1, 2}
        assert other.t - one.t == pytest.approx(0.0, abs=1e-13)


def test_two_strikes_at_one_instant_leave_the_coupler_as_it_was():
    rig = RigParams(S0=1.0, D0=1.0)  # in step, the coupler never moves
    result = run(rig, State(0.1, 1.2, 0.1, 1.2), strikes=20)
    assert result.end is End.STRIKES
    assert np.abs(result.at(np.linspace(0.0, result.duration, 200)).coupler_length - 1.0).max() < 1e-9


@pytest.mark.parametrize('start', [State(ALPHA, 1.0, 0.0, 1.0), State(ALPHA * (1 + 9e-13), 1.0, 0.0, 1.0)])
def test_a_wheel_that_starts_on_its_guard_strikes_at_once(start):
    strike = run(UNCOUPLED, start, strikes=1).strikes[0]
    assert (strike.wheel, strike.t, strike.direction) == (1, 0.0, FORWARD)


def test_a_wheel_that_turns_at_its_apex_falls_back():
    energy = 2 * UNCOUPLED.gravity / UNCOUPLED.front.length
    to_apex = math.sqrt(energy * (1 - math.cos(UNCOUPLED.slope - ALPHA)))
    for part, direction in ((1 - 1e-9, BACKWARD), (1 + 1e-9, FORWARD)):
        result = run(UNCOUPLED, State(-ALPHA, to_apex * part, -ALPHA, 1.2), seconds=8.0)
        first = next(strike for strike in result.strikes if strike.wheel == 1)
        assert first.direction == direction
        assert first.t > 3.0


def grazes(speed):
    """What the front wheel does that rolls towards its guard while a force pulls it back."""
    simulation = Simulation(UNCOUPLED._replace(slope=0.0, S0=30.0), State(0.1, speed, 0.0, 0.0))
    simulation.external_force = 60.0
    return [strike for strike in simulation.advance_to(1.0).strikes if strike.wheel == 1]


def test_a_strike_that_only_just_happens_is_a_strike_without_speed():
    low, high = 0.3, 1.5
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (low, middle) if grazes(middle)[0].direction == FORWARD else (middle, high)
    missed, struck = grazes(low), grazes(high)
    assert (missed[0].direction, struck[0].direction) == (BACKWARD, FORWARD)
    assert struck[0].state.omega1 == pytest.approx(0.0, abs=1e-6)
    # The pull takes it back over the spoke that it has not yet left, as if there had been no strike.
    assert struck[1].direction == BACKWARD
    assert struck[1].t == pytest.approx(missed[0].t, abs=1e-5)


def test_a_leg_that_only_dips_into_its_guard_within_a_step_strikes():
    # A stiff spring shakes a light wheel: within 0.03 s it leaves its guard, comes back to it and leaves it again.
    rig = RigParams(
        WheelParams(0.96, 14.0, 5.0), WheelParams(1.58, 6.4, 40.0), k=1318.0, b=0.0, D0=1.484, S0=-0.59, slope=0.2686
    )
    simulation = Simulation(rig, State(-rig.front.alpha, 0.009, -0.011, 0.957))
    simulation.external_force = 140.0
    expected = solve_ivp(
        lambda t, y: paper_rates(rig, -0.59, y, 140.0),
        (0.0, 0.03),
        simulation.state,
        'DOP853',
        events=lambda t, y: y[0] + rig.front.alpha,
        rtol=1e-12,
        atol=1e-14,
        max_step=1e-4,
    )
    touches = [t for t in expected.t_events[0] if t > 1e-6]
    strike = simulation.advance_to(0.03).strikes[0]
    assert (strike.wheel, strike.direction) == (1, BACKWARD)
    assert strike.t == pytest.approx(touches[0], abs=1e-9)


def test_four_spokes_strike_once_and_stand():
    rig = RigParams(WheelParams(spokes=4.0), WheelParams(spokes=4.0), k=0.0, b=0.0)
    result = run(rig, State(0.0, 1.0, 0.1, 0.5), seconds=30.0)
    assert (result.end, len(result.strikes)) == (End.STANDING, 1)


def test_every_end_has_its_meaning():
    assert len({end.meaning for end in End}) == len(End)

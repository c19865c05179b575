import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.start import start, starts
from dcdrw_sim.model.wheel import gentlest_slope
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams
from tests import ROOT
from tests.sim.rigs import ALPHA, UNCOUPLED, UNEQUAL

REFERENCE = ROOT / 'tests' / 'data' / 'strikes.json'


def test_start_of_the_reference_s_paper_rig():
    case = json.loads(REFERENCE.read_text())[0]['case']
    assert case['name'] == 'paper_rig'
    assert list(start(preset('paper'), 0.216).state) == pytest.approx(case['x0'], abs=1e-12)


@given(st.floats(0.0, 1.0, exclude_max=True))
def test_the_start_has_the_phase_asked_for(initial_phase):
    theta1, _, theta2, _ = start(UNEQUAL, initial_phase).state
    assert theta1 == -UNEQUAL.front.alpha
    phase = (theta1 / (2 * UNEQUAL.front.alpha) - theta2 / (2 * UNEQUAL.rear.alpha)) % 1.0
    assert math.remainder(phase - initial_phase, 1.0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize('initial_phase', [0.0, 0.216, 0.5, 0.99])
def test_without_coupler_both_wheels_are_on_their_limit_cycles_from_the_start(initial_phase):
    strikes = Simulation(*start(UNCOUPLED, initial_phase)).advance_to(10.0).strikes
    for wheel, i in ((1, 1), (2, 3)):
        assert np.ptp([strike.state[i] for strike in strikes if strike.wheel == wheel]) < 1e-12


@pytest.mark.parametrize('initial_phase', [-0.1, 1.0, 21.6, math.nan])
def test_a_phase_out_of_range_is_refused(initial_phase):
    with pytest.raises(ValueError, match=rf'phase must be in \[0, 1\), got {initial_phase}'):
        start(UNEQUAL, initial_phase)


@pytest.mark.parametrize('initial_phase', [0.0, 0.1, 0.9])
def test_too_gentle_a_slope_is_refused_with_the_slope_and_the_mend(initial_phase):
    with pytest.raises(
        ValueError,
        match=r'slope 0\.0174533 rad \(1°\) is too gentle for the front wheel.*'
        r'steeper than 0\.0189039 rad \(1\.083°\), or give the angles and speeds',
    ):
        start(RigParams(slope=math.radians(1.0)), initial_phase)


def test_the_wheel_that_cannot_roll_is_named():
    few = WheelParams(spokes=8)
    with pytest.raises(ValueError, match='too gentle for the rear wheel'):
        start(RigParams(rear=few), 0.5)


def test_the_gentlest_slope_named_is_gentle_enough():
    start(RigParams(slope=gentlest_slope(WheelParams()) * (1 + 1e-12)), 0.5)


def test_an_impossible_rig_is_refused():
    with pytest.raises(ValueError, match=r'front\.length must be > 0, ≤ 10 m'):
        start(RigParams(WheelParams(length=0.0)), 0.5)


def test_phase_zero_is_the_rear_wheel_just_before_its_strike():
    assert start(preset('paper'), 0.0).state.theta2 == ALPHA


def first_step_within(start, seconds, band=0.06):
    """Strikes of the front wheel up to the one from which p stays within the band of one half, at every instant."""
    motion = run(*start, seconds=seconds)
    times = np.union1d(np.linspace(0.0, seconds, 100_000), [strike.t for strike in motion.strikes])
    path = motion.at(times)
    phase = path.rotation1 / (2 * start.rig.front.alpha) - path.rotation2 / (2 * start.rig.rear.alpha)
    last_outside = times[np.flatnonzero(abs(phase % 1.0 - 0.5) > band)[-1]]
    return 1 + sum(strike.t <= last_outside for strike in motion.strikes if strike.wheel == 1)


def test_the_paper_s_trial_takes_38_steps():
    assert first_step_within(start(preset('paper'), 0.216), 60.0) == 38  # contract §7


def test_the_start_is_the_simulator_s():
    begun = start(preset('paper'), 0.25)
    assert SimulatorParams(initial_phase_percent=25.0).start(preset('paper')) == begun
    simulated = SimulatedRig(preset('paper'), SimulatorParams(initial_phase_percent=25.0)).simulation
    assert (simulated.rig, simulated.state) == begun


@given(st.floats(0.001, 0.999))
def test_a_strike_of_the_front_wheel_leads_from_the_section_to_the_start(phase):
    rig = preset('paper').resolved()
    at_section = Simulation(rig, State(*starts(rig, phase)))
    motion, begun = at_section.advance_to(0.0), start(rig, phase)
    assert [strike.wheel for strike in motion.strikes][:1] == [1]
    assert at_section.state == pytest.approx(begun.state, rel=1e-12)
    assert at_section.stance_distance == pytest.approx(begun.rig.S0)

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.model.dynamics import gentlest_slope
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.start import start_state
from dcdrw_sim.motion.pair import Simulation
from tests import ROOT
from tests.sim.rigs import ALPHA, UNCOUPLED, UNEQUAL

REFERENCE = ROOT / 'tests' / 'data' / 'strikes.json'


def test_start_of_the_reference_s_paper_rig():
    case = json.loads(REFERENCE.read_text())[0]['case']
    assert case['name'] == 'paper_rig'
    assert list(start_state(preset('paper'), 0.216)) == pytest.approx(case['x0'], abs=1e-12)


@given(st.floats(0.0, 1.0, exclude_max=True))
def test_the_start_has_the_phase_asked_for(initial_phase):
    theta1, _, theta2, _ = start_state(UNEQUAL, initial_phase)
    assert theta1 == -UNEQUAL.front.alpha
    phase = (theta1 / (2 * UNEQUAL.front.alpha) - theta2 / (2 * UNEQUAL.rear.alpha)) % 1.0
    assert math.remainder(phase - initial_phase, 1.0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize('initial_phase', [0.0, 0.216, 0.5, 0.99])
def test_without_coupler_both_wheels_are_on_their_limit_cycles_from_the_start(initial_phase):
    strikes = Simulation(UNCOUPLED, start_state(UNCOUPLED, initial_phase)).advance_to(10.0).strikes
    for wheel, i in ((1, 1), (2, 3)):
        assert np.ptp([strike.state[i] for strike in strikes if strike.wheel == wheel]) < 1e-12


@pytest.mark.parametrize('initial_phase', [-0.1, 1.0, 21.6, math.nan])
def test_a_phase_out_of_range_is_refused(initial_phase):
    with pytest.raises(ValueError, match=rf'initial_phase must be in \[0, 1\), got {initial_phase}'):
        start_state(UNEQUAL, initial_phase)


@pytest.mark.parametrize('initial_phase', [0.0, 0.1, 0.9])
def test_too_gentle_a_slope_is_refused_with_the_slope_and_the_mend(initial_phase):
    with pytest.raises(
        ValueError,
        match=r'slope 0\.0174533 rad \(1°\) is too gentle for the front wheel.*'
        r'steeper than 0\.0189039 rad \(1\.083°\), or give the angles and speeds',
    ):
        start_state(RigParams(slope=math.radians(1.0)), initial_phase)


def test_the_wheel_that_cannot_roll_is_named():
    few = WheelParams(spokes=8)
    with pytest.raises(ValueError, match='too gentle for the rear wheel'):
        start_state(RigParams(rear=few), 0.5)


def test_the_gentlest_slope_named_is_gentle_enough():
    start_state(RigParams(slope=gentlest_slope(WheelParams()) * (1 + 1e-12)), 0.5)


def test_an_impossible_rig_is_refused():
    with pytest.raises(ValueError, match=r'front\.length must be > 0 m'):
        start_state(RigParams(WheelParams(length=0.0)), 0.5)


def test_phase_zero_is_the_rear_wheel_just_before_its_strike():
    assert start_state(preset('paper'), 0.0).theta2 == ALPHA

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_msgs_py.quantity import flatten
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.dynamics import accelerations, mechanical_energy
from dcdrw_sim.model.scaling import Scales, dimensional, nondimensional
from tests.sim.rigs import UNEQUAL, between, rigs, rolling, starts

scales_ = st.builds(Scales, between(0.01, 100.0), between(0.01, 100.0), between(0.01, 100.0))


def test_the_front_wheel_becomes_the_unit():
    rig, scales = nondimensional(UNEQUAL.resolved())
    assert (rig.front.length, rig.front.mass, rig.gravity) == (1.0, 1.0, 1.0)
    assert rig.rear.length == 1.05 / 0.95
    assert rig.rear.mass == 11.0 / 9.0
    assert (rig.slope, rig.front.spokes, rig.rear.spokes) == (UNEQUAL.slope, 12, 13)
    assert scales == Scales(0.95, 9.0, 9.81)


def test_errata_1_and_2_of_the_paper():
    paper = RigParams()
    rig, scales = nondimensional(paper)
    l, m, g = paper.front.length, paper.front.mass, paper.gravity
    assert rig.k == pytest.approx(5.25 * l / (m * g), rel=1e-15)
    assert rig.b == pytest.approx(100.0 / m * math.sqrt(l / g), rel=1e-15)
    assert scales.time == pytest.approx(math.sqrt(l / g))  # τ = t √(g/ℓ)


@given(rigs, scales_)
def test_there_and_back_is_the_same_rig_to_rounding(rig, scales):
    rig = dimensional(rig, scales)
    assert flatten(dimensional(*nondimensional(rig))) == pytest.approx(flatten(rig), rel=2e-15, abs=1e-300)


def test_what_is_derived_stays_derived():
    rig, _ = nondimensional(RigParams())
    assert math.isnan(rig.D0)
    assert math.isnan(rig.S0)
    assert flatten(rig.resolved()) == pytest.approx(flatten(nondimensional(RigParams().resolved())[0]), rel=1e-15)


@given(rigs, starts)
def test_energy_and_acceleration_scale(rig, start):
    state = rolling(rig, *start)
    reduced, scales = nondimensional(rig)
    assert mechanical_energy(reduced, scales.reduce(state), 1, 0) * scales.energy == pytest.approx(
        mechanical_energy(rig, state, 1, 0), rel=1e-12, abs=1e-12 * scales.energy
    )
    of_reduced = accelerations(reduced, scales.reduce(state), reduced.S0, 3.0 / scales.force)
    assert [a / scales.time**2 for a in of_reduced] == pytest.approx(
        accelerations(rig, state, rig.S0, 3.0), rel=1e-9, abs=1e-9
    )


@given(rigs, starts, scales_)
def test_states_come_back(rig, start, scales):
    state = rolling(rig, *start)
    assert list(scales.restore(scales.reduce(state))) == pytest.approx(list(state), rel=1e-15)

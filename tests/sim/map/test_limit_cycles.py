"""Limit cycles found side by side: those of the scalar return map, and where their energy goes."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.integrate import quad

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.map.limit_cycles import find_limit_cycles, losses, search_fixed_point
from dcdrw_sim.map.return_map import ReturnMap
from dcdrw_sim.model.dynamics import State, coupler, damper_power, stance_distance
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.rigs import rig_at
from dcdrw_sim.model.wheel import kinetic_energy, limit_cycle_speed
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.motion.trajectory import run
from tests.sim.rigs import UNCOUPLED, between

SWEEP = preset('paper-sweep').resolved()
SIN = math.sin(math.pi / 12)
TABLE = np.array(
    [  # contract §3: D0, k̂, b̂, θ2* [deg], moduli
        (1.0, 1e-4, 0.15, -0.615, 0.9477, 0.7826, 0.394),
        (1.0, 1e-3, 0.3, -0.128, 0.9166, 0.8298, 0.1845),
        (1.0 + SIN, 5e-3, 0.15, -0.863, 0.8911, 0.7829, 0.4188),
        (1.0 + SIN, 1e-2, 0.2, -0.933, 0.8450, 0.7976, 0.3429),
        (1.0 + SIN, 1e-3, 3.0, -0.971, 0.9481, 0.8078, 0.000),
    ]
)
MIXED = RigParams(
    WheelParams(0.95, 9.0, 12),
    WheelParams(0.95 * SIN / math.sin(math.pi / 13), 11.0, 13),
    k=20.0,
    b=30.0,
    slope=math.radians(2.5),
)


def cycles_of(rig, phase=0.5, **columns):
    count = max([1, *(np.size(column) for column in columns.values())])
    rigs = spread(rig, count, columns)
    return rigs, find_limit_cycles(rigs, np.tile(ReturnMap(rig).at_phase(phase), (count, 1)))


def damper_loss(rig, state):
    """What the damper takes in a step, by integration along the motion [J]."""
    motion, total = run(rig, State(rig.front.alpha, *state), strikes=3), 0.0
    for segment in motion.segments:

        def power(time, segment=segment):
            at = State(*map(float, segment.at(time)))
            return damper_power(rig, coupler(rig, at, stance_distance(rig, *segment.steps)).rate)

        total += quad(power, segment.start, segment.end, epsabs=1e-14, epsrel=1e-12)[0]
    return total


# Agreement with the scalar map


def test_the_contract_s_table():
    D0, k, b, theta2_deg = TABLE[:, :4].T
    _, cycles = cycles_of(SWEEP, D0=D0, k=k, b=b)
    assert cycles.stable.all()
    assert np.degrees(cycles.states[:, 1]) == pytest.approx(theta2_deg, abs=0.01)
    assert abs(cycles.multipliers) == pytest.approx(TABLE[:, 4:], abs=1e-3)


@pytest.mark.parametrize('rig', [RigParams(), MIXED])
def test_each_is_that_of_the_return_map(rig):
    rigs, cycles = cycles_of(rig, b=[10.0, 20.0, 30.0])
    for index in range(3):
        fixed = ReturnMap(rig_at(rigs, index)).fixed_point()
        assert cycles.states[index] == pytest.approx(np.array(fixed.state), abs=1e-10)
        assert cycles.periods[index] == pytest.approx(fixed.period, abs=1e-10)
        assert cycles.derivatives[index] == pytest.approx(fixed.derivative, abs=1e-8)
        assert cycles.multipliers[index] == pytest.approx(fixed.multipliers, abs=1e-7)


@settings(max_examples=20, deadline=None)
@given(between(0.0, 1e-2), between(0.02, 0.35), between(1.6, 3.0))
def test_a_fixed_point_returns_to_itself(k, b, slope_deg):
    rig = SWEEP._replace(k=k, b=b, slope=math.radians(slope_deg))
    rigs, cycles = cycles_of(rig)
    if cycles.found[0]:
        state = ReturnMap(rig).step(ReturnMap(rig).at_phase(0.5)._make(cycles.states[0].tolist()))
        assert np.array(state) == pytest.approx(cycles.states[0], abs=1e-10)
        balance = losses(rigs, cycles)
        assert balance.strikes[0] > 0.0
        assert balance.damper[0] > -1e-9


def test_a_pair_s_cycle_does_not_depend_on_the_others():
    b = np.linspace(0.05, 0.35, 9)
    _, together = cycles_of(SWEEP, b=b)
    for index in range(9):
        _, alone = cycles_of(SWEEP, b=b[index : index + 1])
        for whole, one in zip(together, alone, strict=True):
            assert whole[index : index + 1].tobytes() == one.tobytes()


def test_there_is_none_in_the_stall_nor_of_unequal_steps_nor_from_nowhere():
    _, stall = cycles_of(SWEEP, b=[1.0, 0.15])
    assert stall.found.tolist() == [False, True]
    assert np.isnan(stall.multipliers[0]).all()
    assert not stall.stable[0]
    rigs = spread(SWEEP, 2, {'rear.spokes': [12.0, 13.0]})
    start = np.tile(ReturnMap(SWEEP).at_phase(0.5), (2, 1))
    assert find_limit_cycles(rigs, start).found.tolist() == [True, False]
    start[0] = math.nan
    assert not find_limit_cycles(rigs, start).found.any()


def test_uncoupled_wheels_keep_every_phase():
    for phase in (0.2, 0.5, 0.8):
        _, cycles = cycles_of(UNCOUPLED, phase)
        assert cycles.states[0, 1] == pytest.approx(ReturnMap(UNCOUPLED).at_phase(phase).theta2, abs=1e-9)
        assert cycles.multipliers[0] == pytest.approx([1.0, 0.75, 0.75], abs=1e-6)
        assert not cycles.stable[0]


# Speed and energy


@pytest.mark.parametrize('rig', [RigParams(), MIXED, SWEEP, SWEEP._replace(b=3.0, k=1e-3)])
def test_strikes_and_damper_take_what_the_slope_gives(rig):
    rigs, cycles = cycles_of(rig)
    walking = losses(rigs, cycles)
    rig, sigma = rig.resolved(), rig.front.step_length
    taken = damper_loss(rig, ReturnMap(rig).at_phase(0.5)._make(cycles.states[0].tolist()))
    gain = (rig.front.mass + rig.rear.mass) * rig.gravity * math.sin(rig.slope) * sigma
    assert walking.strikes[0] * sigma + taken == pytest.approx(gain, rel=1e-9)
    assert walking.damper[0] * sigma == pytest.approx(taken, rel=1e-7)


def test_uncoupled_wheels_walk_as_mcgeer_s():
    rigs, cycles = cycles_of(UNCOUPLED)
    wheel, walking = UNCOUPLED.front, losses(rigs, cycles)
    period = quad(
        lambda theta: 1.0 / limit_cycle_speed(wheel, UNCOUPLED.slope, UNCOUPLED.gravity, theta),
        -wheel.alpha,
        wheel.alpha,
        epsabs=1e-13,
    )[0]
    assert walking.speed[0] == pytest.approx(wheel.step_length / period, rel=1e-10)
    after = limit_cycle_speed(wheel, UNCOUPLED.slope, UNCOUPLED.gravity)
    lost = kinetic_energy(wheel, after / math.cos(2 * wheel.alpha)) - kinetic_energy(wheel, after)
    assert walking.strikes[0] == pytest.approx(2 * lost / wheel.step_length, rel=1e-10)
    assert walking.damper[0] == pytest.approx(0.0, abs=1e-8)


def test_a_state_whose_derivative_is_unknown_is_no_limit_cycle():
    # At θ2 = α the central differences reach beyond what a section can be.
    rig = preset('paper-sweep')
    states = np.array([[0.5, rig.rear.alpha, 0.5]])
    assert not find_limit_cycles(spread(rig._replace(D0=1.0), 1, {}), states).found[0]


# The search

OCTAGON = WheelParams(1.0, 1.0, 8.0)
TWO_CYCLES = RigParams(OCTAGON, OCTAGON, k=0.001973, b=6.273, slope=math.radians(9.09), gravity=1.0)
"""A pair of a stable limit cycle near p = 0 and an unstable one near one half."""


def test_a_stable_limit_cycle_is_found_far_from_half_a_step():
    fixed = search_fixed_point(ReturnMap(TWO_CYCLES))
    assert math.degrees(fixed.state.theta2) == pytest.approx(21.53, abs=0.01)
    assert abs(fixed.multipliers[0]) == pytest.approx(0.98934, abs=2e-4)
    assert fixed.stable


def test_an_unstable_limit_cycle_is_told_where_there_is_no_other_near():
    fixed = search_fixed_point(ReturnMap(TWO_CYCLES), (0.5, 2 / 3, 0.7))
    assert math.degrees(fixed.state.theta2) == pytest.approx(-7.912, abs=0.001)
    assert abs(fixed.multipliers[0]) == pytest.approx(1.00067, abs=1e-5)
    assert not fixed.stable
    assert fixed.steps_per_decade == math.inf


def test_a_pair_without_a_limit_cycle_is_told():
    with pytest.raises(ValueError, match='no fixed point was found from 24 phases'):
        search_fixed_point(ReturnMap(SWEEP._replace(b=0.8)))


# The swing


def test_the_swing_is_that_of_the_motion_at_every_instant():
    for rig in (RigParams().resolved(), MIXED.resolved(), SWEEP):
        _, cycles = cycles_of(rig)
        assert cycles.found[0]
        motion = run(rig, State(rig.front.alpha, *cycles.states[0].tolist()), seconds=float(cycles.periods[0]))
        seen = motion.at(np.linspace(0.0, motion.duration, 200_001))
        phase = seen.rotation1 / (2 * rig.front.alpha) - seen.rotation2 / (2 * rig.rear.alpha)
        errors = 100.0 * (phase % 1.0) - 50.0
        assert cycles.swings[0] == pytest.approx([errors.min(), errors.max()], abs=1e-3)
        assert (cycles.swings[0] - [errors.min(), errors.max()])[0] <= 1e-9

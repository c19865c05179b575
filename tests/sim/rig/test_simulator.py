"""The simulated rig as a source, and its timeline."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams, Timeline


@given(st.lists(st.floats(0.0, 0.05), min_size=1, max_size=30))
def test_samples_fall_due_at_the_rate_however_late_the_ticks(delays):
    timeline, now, stamps = Timeline(1000.0, 1.0, 5.0), 5.0, []
    for delay in delays:
        now += delay
        while timeline.due <= timeline.reached(now):
            stamps.append(timeline.due)
            timeline.step(held=False)
    assert stamps == [pytest.approx(k / 1000.0) for k in range(len(stamps))]
    assert len(stamps) == pytest.approx((now - 5.0) * 1000.0 + 1, abs=1)


def test_held_rig_does_not_age_while_stamps_go_on():
    timeline = Timeline(100.0, 1.0, 0.0)
    for _ in range(10):
        timeline.step(held=True)
    assert timeline.due == pytest.approx(0.1)
    assert timeline.rig_time == pytest.approx(0.0, abs=1e-12)
    for _ in range(10):
        timeline.step(held=False)
    assert timeline.rig_time == pytest.approx(0.1)


def test_rate_and_pace_change_without_a_jump():
    timeline = Timeline(100.0, 1.0, 0.0)
    for _ in range(10):
        timeline.step(held=False)
    timeline.configure(200.0, 2.0, 0.1)
    assert timeline.due == pytest.approx(0.1)
    timeline.step(held=False)
    assert timeline.due == pytest.approx(0.105)
    assert timeline.reached(0.2) == pytest.approx(0.3)
    timeline.configure(200.0, 0.0, 0.2)
    assert timeline.reached(0.2) == math.inf


def test_start_from_the_phase_is_just_after_a_strike_with_the_spring_at_rest_at_the_goal():
    rig, state = SimulatorParams(initial_phase_percent=50.0).start(RigParams())
    assert state.theta1 == -rig.front.alpha
    assert state.theta2 == pytest.approx(0.0)
    assert rig.S0 == pytest.approx(RigParams().resolved().S0 + rig.front.step_length)
    # Half a step on, just before the next strike of the front wheel, n = 0 again and the spring is at rest.
    assert rig.D0 == pytest.approx(RigParams().front.length * (1 + math.sin(rig.front.alpha)))


def test_given_angles_and_speeds_stand_as_they_are():
    params = SimulatorParams(theta1=0.1, omega1=0.5, theta2=-0.1, omega2=0.6)
    rig, state = params.start(RigParams(slope=0.0))
    assert state == (0.1, 0.5, -0.1, 0.6)
    assert rig.S0 == RigParams().front.length


def test_readings_are_the_run():
    rig = SimulatedRig(RigParams(), SimulatorParams())
    truth = run(*SimulatorParams().start(RigParams()), seconds=2.0).at([k / 100 for k in range(200)])
    for k in range(200):
        sample = rig.read(k / 100, k)
        assert sample.front.angle == pytest.approx(truth.rotation1[k], abs=1e-11)
        assert sample.coupler.force == pytest.approx(truth.coupler_force[k], abs=1e-8)


def test_change_of_the_coupler_holds_from_the_present_on():
    rig = SimulatedRig(RigParams(), SimulatorParams())
    before = rig.read(1.0, 0)
    rig.configure(RigParams(k=0.0, b=0.0))
    after = rig.read(1.0, 1)
    assert after.front == before.front
    assert after.coupler.length == before.coupler.length
    assert after.coupler.force == 0.0
    rig.reset()
    assert rig.read(0.0, 2).coupler.force == 0.0  # the change outlives a reset


def test_same_seed_makes_the_same_noise():
    one, other = (SimulatedRig(RigParams(), SimulatorParams(noise_deg=1.0, seed=seed)) for seed in (3, 3))
    assert [one.read(k / 10, k) for k in range(20)] == [other.read(k / 10, k) for k in range(20)]


@given(st.sampled_from([1000.0, 997.0, 60.0]), st.lists(st.tuples(st.integers(1, 3000), st.booleans()), max_size=6))
def test_the_time_of_a_rig_that_is_held_stands_and_never_goes_back(rate, spans):
    timeline = Timeline(rate, 1.0, 0.0)
    last = timeline.rig_time
    for samples, held in spans:
        for _ in range(samples):
            timeline.step(held)
            assert timeline.rig_time >= last
            last = timeline.rig_time

import math

import pytest
from hypothesis import given

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.wheel import gentlest_slope, inertia, kept, kinetic_energy, limit_cycle_speed, pull
from dcdrw_sim.motion.trajectory import run
from tests.sim.rigs import between

real_wheels = pytest.mark.parametrize(
    ('gyration', 'restitution', 'resistance'),
    [(0.0, 0.0, 0.0), (0.6, 0.0, 0.0), (0.3, 0.2, 0.0), (0.0, 0.3, 0.005), (0.5, 0.1, 0.004)],
)


@given(between(0.0, 1.5), between(0.0, 0.9))
def test_a_rigid_strike_keeps_the_angular_momentum_about_the_new_foot(gyration, restitution):
    wheel = WheelParams(gyration=gyration, restitution=restitution)
    m, l = wheel.mass, wheel.length
    # About the new foot the hub moves off at cos 2α of its speed, and the wheel turns about the hub as before.
    momentum = m * l**2 * math.cos(2 * wheel.alpha) + m * (gyration * l) ** 2
    rigid = momentum / inertia(wheel)
    assert kept(wheel._replace(restitution=0.0)) == pytest.approx(rigid)
    assert 1.0 - kept(wheel) == pytest.approx((1.0 - restitution) * (1.0 - rigid))


def test_a_wheel_with_all_its_mass_at_the_rim_keeps_more_and_falls_more_slowly():
    hoop, point = WheelParams(gyration=1.0), WheelParams()
    assert inertia(hoop) == 2.0 * inertia(point)
    assert pull(hoop, 9.81) == pytest.approx(0.5 * 9.81 / hoop.length)
    assert kinetic_energy(hoop, 2.0) == 2.0 * kinetic_energy(point, 2.0)
    assert kept(hoop) == pytest.approx(0.5 * (1.0 + math.cos(2 * hoop.alpha)))


@real_wheels
def test_an_uncoupled_wheel_comes_to_the_limit_cycle_of_the_closed_form(gyration, restitution, resistance):
    wheel = WheelParams(gyration=gyration, restitution=restitution)
    rig = RigParams(wheel, wheel, k=0.0, b=0.0, slope=math.radians(4.0), rolling_resistance=resistance)
    motion = run(rig, State(0.0, 1.6, 0.0, 2.0), strikes=240)
    before = limit_cycle_speed(wheel, rig.slope, rig.gravity, wheel.alpha, resistance)
    after = limit_cycle_speed(wheel, rig.slope, rig.gravity, None, resistance)
    assert motion.strikes[-1].state[2 * motion.strikes[-1].wheel - 1] == pytest.approx(before, rel=1e-10)
    assert after == pytest.approx(kept(wheel) * before, rel=1e-12)


@real_wheels
def test_a_little_above_the_gentlest_slope_a_wheel_rolls_and_a_little_below_it_stops(gyration, restitution, resistance):
    wheel = WheelParams(gyration=gyration, restitution=restitution)
    least = gentlest_slope(wheel, resistance)
    for factor, rolls in ((1.01, True), (0.99, False)):
        rig = RigParams(wheel, wheel, k=0.0, b=0.0, slope=factor * least, rolling_resistance=resistance)
        motion = run(rig, State(0.0, 2.0, 0.1, 2.0), seconds=120.0)
        assert all(strike.direction > 0 for strike in motion.strikes) == rolls

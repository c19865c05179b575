"""Which pairs of parts work, and what they bear."""

import math

import numpy as np
import pytest

from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.ends import End
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.study.design import Task, bear, stall_slopes
from dcdrw_sim.study.loads import UNKNOWN, order
from dcdrw_sim.study.parts import Part, rank

RIG = preset('paper').resolved()
TASK = Task(RIG, 12.0, phases=(0.1, 0.5, 0.9))


def dense(k, b):
    """Loads of a coupler by the simulation's own dense output."""
    rig = RIG._replace(k=k, b=b)
    most = np.zeros(5)
    for phase in TASK.phases:
        motion = run(*start(rig, phase), TASK.seconds)
        strikes = np.array([strike.t for strike in motion.strikes])
        times = np.concatenate([np.linspace(0.0, motion.duration, 4000), strikes, np.maximum(strikes - 1e-9, 0.0)])
        seen = motion.at(times)
        spring = k * (seen.coupler_length - rig.D0)
        rows = seen.coupler_force, spring, seen.coupler_force - spring, seen.coupler_length, seen.coupler_rate
        most = np.maximum(most, [np.abs(row).max() for row in rows])
    return most


@pytest.mark.parametrize(('k', 'b'), [(5.25, 100.0), (16.0, 10.0), (102.0, 49.0)])
def test_loads_are_those_of_the_motions(k, b):
    [found] = bear(TASK, np.array([k]), np.array([b]))
    force, spring, damper, longest, speed = dense(k, b)
    assert (found.force, found.spring_force, found.damper_force) == pytest.approx((force, spring, damper), rel=2e-3)
    assert (found.longest, found.speed) == pytest.approx((longest, speed), rel=2e-3)
    assert 0.0 < found.stroke < RIG.front.step_length + 0.1


def test_heat_is_what_the_slope_gives_and_strikes_leave():
    [found] = bear(TASK, np.array([5.25]), np.array([100.0]))
    assert found.heat == pytest.approx(60.0 * 1.1599 * 0.8841, rel=1e-3)  # J/m and m/s of the limit cycle


def test_a_spring_at_rest_at_half_a_step_has_no_preload_and_a_shorter_one_pulls():
    assert order(RIG, 5.25, UNKNOWN).preload == pytest.approx(0.0, abs=1e-12)
    assert order(RIG._replace(D0=RIG.D0 - 0.1), 5.25, UNKNOWN).preload == pytest.approx(0.525)


def test_a_spring_is_neither_squeezed_to_half_its_free_length_nor_drawn_to_twice_it():
    loads = UNKNOWN._replace(shortest=RIG.D0 - 0.2, longest=RIG.D0 + 0.3)
    ordered = order(RIG, 5.25, loads)
    assert (ordered.shortened, ordered.lengthened) == pytest.approx((0.2, 0.3))
    assert (ordered.free_length, ordered.rods) == pytest.approx((0.4, RIG.D0 - 0.4))
    assert order(RIG, 5.25, loads._replace(longest=RIG.D0 + 0.5)).free_length == pytest.approx(0.5)
    own = order(RIG, 5.25, loads, 0.3)
    assert (own.free_length, own.least_free_length, own.rods) == pytest.approx((0.3, 0.4, RIG.D0 - 0.3))


def test_the_papers_coupler_stalls_where_its_limit_cycle_ends():
    assert 1.4485 < math.degrees(stall_slopes(TASK, np.array([5.25]), np.array([100.0]))[0]) < 1.4495


def test_unequal_wheels_stall_where_simulation_lets_some_start_stand():
    rig = RIG._replace(rear=RIG.rear._replace(length=0.95, mass=12.0), k=5.25, b=100.0)
    task = Task(rig, 60.0, phases=(0.1, 0.9))
    [slope] = stall_slopes(task, np.array([5.25]), np.array([100.0]))
    gentler, steeper = (
        [run(*start(rig._replace(slope=factor * slope), phase), 240.0).end for phase in task.phases]
        for factor in (0.995, 1.003)
    )
    assert End.STANDING in gentler
    assert steeper == [End.TIME, End.TIME]


def test_rated_limits_rule_out_what_asks_for_more():
    springs = [Part('spring', 16.0, 'firm'), Part('spring', 16.0, 'weak', max_force=0.5)]
    dashpots = [Part('dashpot', 10.0, 'thin'), Part('dashpot', 10.0, 'short', max_stroke=0.05)]
    pairs = rank(TASK, [*dashpots, *springs], 0.0)
    assert [(pair.spring.name, pair.dashpot.name) for pair in pairs if pair.works] == [('firm', 'thin')]
    assert pairs[0].works
    assert {limit for pair in pairs for limit in pair.exceeded} == {'spring max_force', 'dashpot max_stroke'}


def test_what_does_not_come_into_step_is_ranked_behind_what_does():
    parts = [Part('spring', 41.1), Part('spring', 16.0), Part('dashpot', 14.7), Part('dashpot', 10.0)]
    works = [pair.works for pair in rank(TASK, parts, 0.0)]
    assert any(works)
    assert not all(works)
    assert works == sorted(works, reverse=True)

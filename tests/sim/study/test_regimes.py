"""Edges of regimes: inside them pairs walk, outside they stall, whoever integrates."""

import math

import numpy as np
import pytest

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.map.return_map import ReturnMap
from dcdrw_sim.model.dynamics import State, damper_power, mechanical_energy
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.scaling import Scales, dimensional, nondimensional
from dcdrw_sim.model.start import starts
from dcdrw_sim.model.wheel import gentlest_slope
from dcdrw_sim.motion.ends import BACKWARD
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.relatives.even_gait import even_pair, even_stall_band, gentlest_even_gait
from dcdrw_sim.relatives.rigid_pair import gentlest_slope_at_phase
from dcdrw_sim.relatives.rimless_wheel import speed_to_pass
from dcdrw_sim.study.regimes import (
    basin,
    bisect,
    folds,
    gentlest_slopes,
    judge_from,
    judge_starts,
    least_speeds,
    stall_bands,
    stall_edges,
    steepest_stall,
)
from dcdrw_sim.study.verdict import Verdict
from tests.sim.oracle import integrate

RIG = preset('paper-sweep')
PHASES = (0.2, 0.5, 0.8)
KS = (1e-4, 1e-3, 1e-2)


@pytest.fixture(scope='module')
def band():
    low, high = stall_bands(spread(RIG, 3, {'k': KS}))
    return low, high


# Folds


def test_stall_band_of_the_papers_sweep(band):
    low, high = band
    assert low.values == pytest.approx([0.449388, 0.44883, 0.442565], abs=1e-4)
    assert high.values == pytest.approx([1.751631, 1.7522, 1.75842], abs=1e-4)


@pytest.mark.parametrize(('gyration', 'restitution'), [(0.6, 0.0), (0.3, 0.2)])
def test_gentlest_slope_of_real_wheels_is_near_its_closed_form(gyration, restitution):
    wheel = RIG.front._replace(gyration=gyration, restitution=restitution)
    rig = RIG._replace(front=wheel, rear=wheel)
    pair = even_pair(rig)
    found = gentlest_slopes(spread(rig, 1, {}))
    assert found.values[0] == pytest.approx(gentlest_even_gait(pair.alpha, pair.k, pair.b, pair.kept).slope, rel=0.05)
    for factor, walks in ((1.02, True), (0.98, False)):
        steeper = rig._replace(slope=factor * float(found.values[0]))
        start = [wheel.alpha, *found.states[0]]
        assert (
            judge_starts(spread(steeper, 1, {}), np.array([start]), 2000.0).verdict[0] <= Verdict.ELSEWHERE
        ) == walks


def test_at_a_fold_a_multiplier_is_one(band):
    for gaits in band:
        assert gaits.multipliers == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize('i', [0, 2])
@pytest.mark.parametrize('end', [0, 1])
def test_just_inside_the_edge_the_exact_map_has_a_stable_fixed_point(band, i, end):
    gaits, sign = band[end], (-1.0, 1.0)[end]
    far, near = (
        ReturnMap(RIG._replace(k=KS[i], b=float(gaits.values[i]) * (1.0 + sign * part))).fixed_point()
        for part in (1e-2, 2.5e-3)
    )
    assert far.stable
    assert near.stable
    # 1 − μ shrinks as the root of what is left.
    assert (1.0 - abs(far.multipliers[0])) / (1.0 - abs(near.multipliers[0])) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize(('end', 'factor'), [(0, 1.03), (1, 0.97)])
def test_just_outside_the_edge_pairs_stall_and_inside_they_walk(band, end, factor):
    b = float(band[end].values[1])
    for part, walks in ((factor, False), (1.0 / factor, True)):
        rigs = spread(RIG._replace(k=1e-3, b=b * part), len(PHASES), {})
        verdicts = judge_starts(rigs, starts(RIG, PHASES), 600.0).verdict
        assert (verdicts < Verdict.STALLS).tolist() == [walks] * len(PHASES)


def test_scipy_finds_the_same_on_either_side(band):
    """The paper's equations with β, by SciPy: strikes go on inside, and cease outside."""
    b = float(band[1].values[2])
    start = starts(RIG, 0.5)
    strikes, _ = integrate(RIG._replace(k=1e-2, b=1.05 * b), start, 55.0)
    assert len(strikes) > 40
    assert strikes[-1].t > 53.0
    strikes, end = integrate(RIG._replace(k=1e-2, b=0.7 * b), start, 55.0)
    assert strikes[-1].t < 53.0
    assert min(end[1], end[3]) < 0.0  # a wheel rocks back


def test_gentlest_slope_of_loose_and_of_stiff_couplers():
    slopes = gentlest_slopes(spread(RIG, 4, {'b': (1e-3, 0.1, 1.0, 300.0)})).values
    assert slopes[0] == pytest.approx(gentlest_slope(RIG.front), rel=0.02)
    assert slopes[3] == pytest.approx(gentlest_slope_at_phase(RIG.resolved(), 0.5), abs=math.radians(0.04))
    assert slopes[0] < slopes[1] < slopes[2]
    closed = [gentlest_even_gait(RIG.front.alpha, RIG.k, b).slope for b in (1e-3, 0.1, 1.0, 300.0)]
    assert slopes == pytest.approx(closed, rel=0.05)


def test_along_slope_and_along_damping_the_edge_is_the_same(band):
    rigs = spread(RIG, 2, {'k': 1e-3, 'b': (band[0].values[1], band[1].values[1])})
    assert gentlest_slopes(rigs).values == pytest.approx(RIG.slope, abs=1e-9)


def test_above_the_steepest_stall_there_is_no_band():
    b, slope = steepest_stall(RIG)
    assert math.degrees(slope) == pytest.approx(1.8656, abs=1e-3)
    assert b == pytest.approx(0.96, abs=0.02)
    for part, known in ((0.995, True), (1.005, False)):
        low, high = stall_bands(spread(RIG._replace(slope=part * slope), 1, {}))
        assert np.isfinite([low.values[0], high.values[0]]).tolist() == [known, known]
        if known:
            assert low.values[0] < b < high.values[0]


def test_a_preloaded_spring_hardly_moves_the_upper_edge():
    _, high = stall_bands(spread(RIG._replace(D0=1.0), 1, {'k': 1e-3}))
    assert high.values == pytest.approx(1.7518, abs=1e-3)


def test_edges_scale_with_the_rig():
    paper = RigParams(slope=math.radians(1.75))
    plain, scales = nondimensional(paper)
    low, high = (end.values[0] for end in stall_bands(spread(paper, 1, {})))
    plain_low, plain_high = (end.values[0] for end in stall_bands(spread(plain, 1, {})))
    assert (low, high) == pytest.approx((scales.damping * plain_low, scales.damping * plain_high), rel=1e-7)
    assert dimensional(plain, scales).k == pytest.approx(paper.k)


def test_closed_form_brackets_the_band(band):
    low, high = even_stall_band(RIG.front.alpha, 1e-3, RIG.slope)
    assert low == pytest.approx(band[0].values[1], rel=0.12)
    assert high == pytest.approx(band[1].values[1], rel=0.09)


def test_a_pair_without_a_limit_cycle_has_no_fold():
    assert np.isnan(folds(spread(RIG, 2, {'b': 1.0}), 'k', (1e-3, 1e-2)).values).all()


# Verdicts


def test_what_given_starts_come_to_agrees_with_the_fold(band):
    rigs = spread(RIG, 3, {'k': KS})
    states = np.repeat(starts(RIG, PHASES)[None], 3, axis=0)
    found = stall_edges(rigs, 'b', np.full(3, 0.3), np.full(3, 1.0), states, 600.0, halvings=12)
    assert found == pytest.approx(band[0].values, rel=0.01)
    assert (found > band[0].values).all()  # just beyond, what is left of the limit cycle holds a pair up for a while
    beyond = stall_edges(rigs, 'b', np.full(3, 3.0), np.full(3, 2.5), states, 100.0, halvings=1)
    assert np.isnan(beyond).all()


def test_bisection_finds_every_edge_and_says_where_there_is_none():
    edges = np.array([0.3, 0.7, 2.0])
    found = bisect(lambda values: values < edges, np.zeros(3), np.ones(3), 40)
    assert found[:2] == pytest.approx(edges[:2], abs=1e-11)
    assert math.isnan(found[2])


def test_starts_are_those_of_the_return_map():
    for phase in PHASES:
        theta1, *rest = starts(RIG, phase).tolist()
        assert theta1 == RIG.front.alpha
        assert rest == pytest.approx(ReturnMap(RIG).at_phase(phase))
    assert starts(RIG, PHASES, 0.5)[:, [1, 3]] == pytest.approx(0.5 * starts(RIG, PHASES)[:, [1, 3]])


# Energy


def test_in_the_band_strikes_and_damper_take_more_than_the_slope_gives():
    rig = RIG._replace(b=0.8).resolved()
    motion = run(rig, State(*starts(rig, 0.5).tolist()), 60.0)
    stalled = next(strike.t for strike in motion.strikes if strike.direction == BACKWARD)
    damper = strikes = 0.0
    for segment in (segment for segment in motion.segments if segment.start < stalled):
        nodes, weights = np.polynomial.legendre.leggauss(12)
        half = 0.5 * (segment.end - segment.start)
        times = np.minimum(segment.start + half * (nodes + 1.0), motion.duration)
        damper += half * float(weights @ damper_power(rig, motion.at(times).coupler_rate))
    for strike in (strike for strike in motion.strikes if strike.t < stalled):
        omega = strike.state[2 * strike.wheel - 1]
        strikes += 0.5 * omega**2 * math.sin(2.0 * rig.front.alpha) ** 2
    first, last = motion.segments[0], [segment for segment in motion.segments if segment.end <= stalled][-1]
    begin = mechanical_energy(rig, first.at(0.0), *first.steps)
    end = mechanical_energy(rig, last.at(last.end), *last.steps)
    assert begin - end == pytest.approx(damper + strikes, rel=1e-9)
    ground = (sum(last.steps) - sum(first.steps)) * rig.front.step_length * math.sin(rig.slope)
    assert damper + strikes > ground > 0.0
    assert strikes < ground  # by themselves they would not stop it


# Basins of attraction


SOME_PHASES, SOME_SPEEDS = np.array([0.1, 0.4, 0.5, 0.8]), np.array([0.4, 0.8, 1.0, 1.6])
BASIN_TIME = 300.0


def test_grid_is_that_of_the_single_motions():
    found = basin(RIG, SOME_PHASES, SOME_SPEEDS, BASIN_TIME)
    assert found.verdicts.shape == found.steps.shape == (4, 4)
    assert found.phases.tolist() == SOME_PHASES.tolist()
    assert found.speeds.tolist() == SOME_SPEEDS.tolist()
    alone = judge_from(RIG, [0.4], [1.6], BASIN_TIME)
    assert (found.verdicts[1, 3], found.strike_steps[1, 3]) == (alone.verdict[0], alone.strike_steps[0])


def test_every_phase_leads_to_the_limit_cycle_but_not_every_speed():
    found = basin(RIG, SOME_PHASES, SOME_SPEEDS, BASIN_TIME)
    assert (found.verdicts[:, 1:] == Verdict.SWINGS).all()
    assert (found.verdicts[:, 0] >= Verdict.STALLS).all()
    assert np.isfinite(found.strike_steps[:, 1:]).all()
    assert np.isnan(found.strike_steps[:, 0]).all()
    assert np.isnan(found.steps).all()  # its limit cycle swings by ±7 %
    damped = basin(RIG._replace(b=3.0), SOME_PHASES, [1.0], BASIN_TIME)
    assert np.isfinite(damped.steps).all()


def test_least_speed_parts_what_walks_from_what_rocks_back():
    edge = least_speeds(RIG, SOME_PHASES, BASIN_TIME)
    assert ((edge > 0.6) & (edge < 0.8)).all()
    for part, walks in ((1.001, True), (0.999, False)):
        motion = run(RIG, State(*starts(RIG, SOME_PHASES[1], edge[1] * part).tolist()), 60.0)
        assert all(strike.direction != BACKWARD for strike in motion.strikes) == walks


def test_both_wheels_together_are_one_wheel():
    """At p = 0 nothing moves the coupler but what is left of its preload: the single wheel's closed form."""
    rig = RIG._replace(D0=RIG.resolved().S0)
    needed = speed_to_pass(rig.front, rig.slope, rig.gravity, -rig.front.alpha)
    after_strike = starts(rig, 0.0)[1] * math.cos(2.0 * rig.front.alpha)
    assert least_speeds(rig, [0.0], BASIN_TIME) == pytest.approx(needed / after_strike, rel=1e-5)


def test_a_basin_has_no_units():
    scales = Scales(length=0.9, mass=7.0, gravity=9.81)
    rig = dimensional(RIG, scales)
    found = least_speeds(rig, SOME_PHASES[:2], BASIN_TIME * scales.time)
    assert found == pytest.approx(least_speeds(RIG, SOME_PHASES[:2], BASIN_TIME), abs=2e-6)


def test_in_the_stall_band_no_speed_helps():
    assert np.isnan(least_speeds(RIG._replace(b=0.9), SOME_PHASES[:2], BASIN_TIME)).all()

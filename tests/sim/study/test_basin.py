"""Basins of attraction: what the grid and the bisection say agrees, and with the exact motion."""

import math

import numpy as np
import pytest

from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.scaling import Scales, dimensional
from dcdrw_sim.model.start import starts
from dcdrw_sim.motion.ends import BACKWARD
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.relatives.rimless_wheel import speed_to_pass
from dcdrw_sim.study.basin import basin, judge_from, least_speeds
from dcdrw_sim.study.verdict import Verdict

RIG = preset('paper-sweep')
PHASES = np.array([0.1, 0.4, 0.5, 0.8])
SPEEDS = np.array([0.4, 0.8, 1.0, 1.6])
SECONDS = 300.0


def test_grid_is_that_of_the_single_motions():
    found = basin(RIG, PHASES, SPEEDS, SECONDS)
    assert found.verdicts.shape == found.steps.shape == (4, 4)
    assert found.phases.tolist() == PHASES.tolist()
    assert found.speeds.tolist() == SPEEDS.tolist()
    alone = judge_from(RIG, [0.4], [1.6], SECONDS)
    assert (found.verdicts[1, 3], found.steps[1, 3]) == (alone.verdict[0], alone.steps[0])


def test_every_phase_leads_into_step_but_not_every_speed():
    found = basin(RIG, PHASES, SPEEDS, SECONDS)
    assert (found.verdicts[:, 1:] == Verdict.SETTLES).all()
    assert (found.verdicts[:, 0] >= Verdict.STALLS).all()
    assert np.isfinite(found.steps[:, 1:]).all()
    assert np.isnan(found.steps[:, 0]).all()


def test_least_speed_parts_what_walks_from_what_rocks_back():
    edge = least_speeds(RIG, PHASES, SECONDS)
    assert ((edge > 0.6) & (edge < 0.8)).all()
    for part, walks in ((1.001, True), (0.999, False)):
        motion = run(RIG, State(*starts(RIG, PHASES[1], edge[1] * part).tolist()), 60.0)
        assert all(strike.direction != BACKWARD for strike in motion.strikes) == walks


def test_both_wheels_together_are_one_wheel():
    """At p = 0 nothing moves the coupler but what is left of its preload: the single wheel's closed form."""
    rig = RIG._replace(D0=RIG.resolved().S0)
    needed = speed_to_pass(rig.front, rig.slope, rig.gravity, -rig.front.alpha)
    after_strike = starts(rig, 0.0)[1] * math.cos(2.0 * rig.front.alpha)
    assert least_speeds(rig, [0.0], SECONDS) == pytest.approx(needed / after_strike, rel=1e-5)


def test_a_basin_has_no_units():
    scales = Scales(length=0.9, mass=7.0, gravity=9.81)
    rig = dimensional(RIG, scales)
    found = least_speeds(rig, PHASES[:2], SECONDS * scales.time)
    assert found == pytest.approx(least_speeds(RIG, PHASES[:2], SECONDS), abs=2e-6)


def test_in_the_stall_band_no_speed_helps():
    assert np.isnan(least_speeds(RIG._replace(b=0.9), PHASES[:2], SECONDS)).all()

"""In step means the same to the monitor, which sees samples, and to design and sweep, which see exact extremes."""

import math

import numpy as np
import pytest

from dcdrw.trials.monitored import monitored
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.rigs import Rigs, rig_at
from dcdrw_sim.model.start import starts
from dcdrw_sim.motion.ensemble import run_pairs, spread
from dcdrw_sim.study.verdict import Verdict, judge

SECONDS = 9.0
DRAWN, PARTS = 240, 8


def drawn(count: int) -> tuple[Rigs, np.ndarray]:
    """Couplers, wheels, slopes and starts at random."""
    random = np.random.default_rng(7)
    mass, slope = random.uniform(4.0, 16.0, count), np.radians(random.uniform(1.6, 4.0, count))
    columns = {
        'k': 10.0 ** random.uniform(0.3, 2.0, count),
        'b': 10.0 ** random.uniform(0.3, 2.2, count),
        'slope': slope,
        'front.mass': mass,
        'rear.mass': mass * random.choice([1.0, 0.8, 1.25], count),
    }
    rigs = spread(RigParams(), count, columns)
    phases, speeds = random.uniform(0.0, 1.0, count), random.uniform(0.9, 1.2, count)
    return rigs, np.array([starts(rig_at(rigs, i), phases[i], speeds[i]) for i in range(count)])


RIGS, STATES = drawn(DRAWN)
JUDGED = judge(run_pairs(RIGS, STATES, SECONDS, 400, extremes=True), RIGS, 1)[0]
WALKING = JUDGED.verdict <= Verdict.ELSEWHERE


def test_what_is_drawn_comes_into_step_early_late_and_not_at_all():
    assert WALKING.sum() >= 200
    steps = JUDGED.steps[WALKING]
    assert np.isnan(steps).sum() >= 40
    assert len(np.unique(steps[np.isfinite(steps)])) >= 8
    assert (JUDGED.steps != JUDGED.strike_steps)[np.isfinite(JUDGED.strike_steps)].sum() >= 60


@pytest.mark.parametrize('part', range(PARTS))
def test_sweep_and_design_count_the_monitor_s_steps(part):
    for i in range(part, DRAWN, PARTS):
        if WALKING[i]:
            rig = rig_at(RIGS, i)
            status = monitored(rig, State(*STATES[i].tolist()), SECONDS)
            known = math.nan if status.steps_to_synchronization is None else status.steps_to_synchronization
            assert known == pytest.approx(JUDGED.steps[i], nan_ok=True), f'pair {i}: {rig}, start {STATES[i]}'

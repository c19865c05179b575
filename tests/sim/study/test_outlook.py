"""Couplers on a rig that is known with errors."""

import math

import numpy as np

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.identification.unknowns import Uncertainty, knowledge, unknowns_of
from dcdrw_sim.study.design import Task
from dcdrw_sim.study.outlook import outlook, surest

TASK = Task(RigParams(), 30.0, phases=(0.2, 0.7))


def drawn(count, **errors):
    stated = Uncertainty(errors, np.eye(len(errors)))
    others = [unknown.name for unknown in unknowns_of(TASK.rig) if unknown.name not in errors]
    return knowledge(TASK.rig, others, stated).draw(count, seed=1)


def test_a_rig_that_is_known_exactly_has_one_outcome():
    found = outlook(TASK, 16.0, 10.0, drawn(4, mass=1e-6))
    assert found.in_step == 1.0
    assert found.median_steps == found.late_steps
    assert math.isnan(outlook(TASK, 41.1, 14.7, drawn(4, mass=1e-6)).median_steps)  # swings beyond the band


def test_the_surest_comes_into_step_on_most_rigs():
    rigs = drawn(6, slope=math.radians(0.2))
    k, b = np.array([41.1, 16.0]), np.array([14.7, 10.0])
    assert surest(TASK, k, b, rigs) == (16.0, 10.0)
    assert outlook(TASK, 16.0, 10.0, rigs).in_step > outlook(TASK, 41.1, 14.7, rigs).in_step

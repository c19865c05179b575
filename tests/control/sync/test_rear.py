"""The law `rear` on a person and a robot: rotations in, torque on the rear hub out."""

import math

import numpy as np
import pytest

from benchmarks.person import walk
from dcdrw.suite.hub_gains import hub_gains
from dcdrw_control.sync.rear import HubGains, RearLaw
from dcdrw_control.sync.safety import State
from dcdrw_control.sync.synchronizer import Synchronizer, SynchronizerParams
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import PhaseSample, Turn
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.rig.person import natural_cadence

RIG = RigParams(k=16.0, b=10.0)
ALPHA = RIG.rear.alpha
PERIOD = 0.002


def sample(t: float, turned: float, rear: Turn, cadence: float = natural_cadence(RIG)) -> PhaseSample:
    """A person who has turned by so much at an even pace, and a rear wheel."""
    front = Turn((turned + ALPHA) % (2.0 * ALPHA) - ALPHA, 2.0 * ALPHA * cadence)
    return PhaseSample(round(t * 1e9), front, rear, Turn(), 0)


@pytest.mark.parametrize(('delay', 'rms', 'in_band', 'peak'), [(0.0, 3.0, 100.0, 10.0), (0.05, 4.0, 95.0, 20.0)])
def test_the_robot_keeps_in_step_with_an_uneven_person_and_hardly_pulls(delay, rms, in_band, peak):
    row = walk(RIG, 'rear', delay, seconds=25.0, spread=0.1, seed=3)
    assert row.rms <= rms
    assert row.in_band >= in_band
    assert row.peak <= peak
    if in_band == 100.0:
        assert row.steps <= 3


def test_a_gait_that_is_right_costs_no_torque():
    """A free wheel half a step of time behind an even person asks for next to nothing."""
    law, rig = RearLaw(hub_gains(RIG), ALPHA, ALPHA), RIG._replace(k=0.0, b=0.0)
    pair, turned, torques = Simulation(*start(rig, 0.5)), [], []
    times = np.arange(0.0, 4.0, PERIOD)
    rears = []
    for t in times:
        motion = pair.advance_to(t)
        theta = (motion.rotation2 + ALPHA) % (2.0 * ALPHA) - ALPHA
        rears.append(Turn(theta, motion.omega2))
        turned.append(motion.rotation2)
    lead = np.mean(np.array(turned) - 2.0 * ALPHA * natural_cadence(RIG) * times)  # over nearly seven steps
    for t, rear in zip(times, rears, strict=True):
        law.update(sample(t, lead + 2.0 * ALPHA * (natural_cadence(RIG) * t + 0.5), rear))
        torques.append(law.wanted(t))
    assert np.abs(torques).max() < 0.03 * hub_gains(RIG).stiffness * 2.0 * ALPHA


def test_the_predictor_foretells_the_wheel_through_strikes_and_torques_under_way():
    delay, pair = 0.05, Simulation(*start(RIG._replace(k=0.0, b=0.0), 0.3))
    law = RearLaw(hub_gains(RIG, delay), ALPHA, ALPHA)
    torques = [10.0 * math.sin(7.0 * j * PERIOD) for j in range(1000)]
    late, foretold, seen = round(delay / PERIOD), [], []
    for j, torque in enumerate(torques):
        t = j * PERIOD
        pair.torques = 0.0, torques[j - late] if j >= late else 0.0
        motion = pair.advance_to(t)
        rear = Turn((motion.rotation2 + ALPHA) % (2.0 * ALPHA) - ALPHA, motion.omega2)
        seen.append(rear.angle)
        foretold.append(law._ahead(sample(t, 0.0, rear), t)[0])
        law.act(t, torque)
    away = np.array(foretold[late:-late]) - np.array(seen[2 * late :])
    away = (away + ALPHA) % (2.0 * ALPHA) - ALPHA
    assert np.abs(away).max() < 0.01 * 2.0 * ALPHA


def test_no_torque_is_commanded_unless_enabled_nor_beyond_its_limit():
    core = Synchronizer(SynchronizerParams(law='rear', hub=hub_gains(RIG)))
    states = set()
    for j in range(1000):
        t = j * PERIOD
        core.update(sample(t, 0.7 * ALPHA + 1.1 * t, Turn((1.0 * t) % ALPHA, 1.0)), t)
        core.enable(t, 200 <= j < 600)
        command = core.command(t)
        states.add(command.state)
        assert command.force == 0.0
        assert abs(command.torque) <= core.params.limits.max_torque
        if not 200 <= j < 650:
            assert command.torque == 0.0
    assert State.ACTIVE in states


def test_gains_that_nobody_computed_are_refused():
    with pytest.raises(ValueError, match=r'hub\.free_speeds must be'):
        SynchronizerParams(law='rear').check_law()
    with pytest.raises(ValueError, match=r'hub\.free_speeds must be'):
        SynchronizerParams(law='rear', hub=HubGains(free_speeds=(1.0, 0.0, 1.0), inertia=1.0)).check_law()


def test_a_synchronizer_that_is_off_bears_strikes():
    core = Synchronizer(SynchronizerParams())
    for j in range(1000):
        core.update(sample(j * PERIOD, 1.1 * j * PERIOD, Turn(0.0, 1.0)), j * PERIOD)
        assert core.command(j * PERIOD).force == 0.0

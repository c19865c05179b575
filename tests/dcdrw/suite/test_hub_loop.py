"""The loop of the law `rear`: what is computed of it is what simulated people and robots do."""

import numpy as np
import pytest

from dcdrw.suite.hub_gains import hub_gains
from dcdrw.suite.hub_loop import HubLoop
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.rig.person import PersonParams, natural_cadence
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams

RIG = RigParams(k=16.0, b=10.0)
STRIKE = 1.0 / natural_cadence(RIG)


def rear_at_strikes(theta: float, omega: float) -> np.ndarray:
    """θ2 and θ2′ at the start and a step later, without a law, behind a person who walks evenly."""
    person = PersonParams(walks=True, variability_percent=0.0)
    params = SimulatorParams(
        person=person, theta1=-RIG.front.alpha, omega1=2.0 * RIG.front.alpha / STRIKE, theta2=theta, omega2=omega
    )
    rig = SimulatedRig(RIG.resolved()._replace(S0=RIG.resolved().S0 + RIG.front.step_length), params)
    sample = rig.read(STRIKE, 1)
    assert sample
    return np.array([sample.rear.angle, sample.rear.rate])


def test_without_the_law_the_multipliers_are_those_of_the_simulated_pair():
    loop, apart = HubLoop(RIG, hub_gains(RIG)), 1e-4
    begun = loop._settled[:2]
    columns = [
        (rear_at_strikes(*(begun + apart * axis)) - rear_at_strikes(*(begun - apart * axis))) / (2.0 * apart)
        for axis in np.eye(2)
    ]
    seen = np.linalg.eigvals(np.stack(columns, axis=-1))
    assert np.sort(np.abs(loop.multipliers(0.0))) == pytest.approx(np.sort(np.abs(seen)), rel=0.03)


@pytest.mark.parametrize('delay', [0.0, 0.05])
def test_the_loop_is_stable_and_its_edge_of_delay_lies_beyond_what_the_law_allows_for(delay):
    loop = HubLoop(RIG, hub_gains(RIG, delay))
    assert max(abs(loop.multipliers())) < 0.1 < max(abs(loop.multipliers(0.0))) < 1.0
    edge = loop.unstable_delay()
    assert edge > delay + 0.05
    assert loop._growth(1.0, 0.9 * edge) < 0.0 < loop._growth(1.0, 1.1 * edge)

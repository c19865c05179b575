"""The held force: what the plant says is what the pair does."""

import numpy as np
import pytest

from dcdrw_sim.map.holding import METHODS, eased, law, margins, plant, plants_near
from dcdrw_sim.map.return_map import ReturnMap, SectionState
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.presets import preset
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.motion.trajectory import run

PAPER = preset('paper').resolved()


def step(state: np.ndarray, before: float, force: float, delay: float) -> np.ndarray:
    """The next section where the force changes so long after the strike."""
    pair = Simulation(PAPER, State(PAPER.front.alpha, *state))
    pair.external_force = before
    pair.step()  # the strike at the section itself
    pair.advance_to(delay)
    pair.external_force = force
    while True:
        _, strike = pair.step()
        if strike and strike.wheel == 1:
            return np.array(strike.state[1:])


@pytest.mark.parametrize('delay', [0.0, 0.05, 0.3])
def test_a_plant_with_delay_answers_as_the_pair_does(delay):
    found, h = plant(PAPER, delay=delay), 1e-4
    aim = np.array(found.point.state)
    new = (step(aim, 0.0, h, delay) - step(aim, 0.0, -h, delay)) / (2 * h)
    assert found.by_new == pytest.approx(new, rel=1e-5, abs=1e-8)
    if delay:
        old = (step(aim, h, 0.0, delay) - step(aim, -h, 0.0, delay)) / (2 * h)
        assert found.by_old == pytest.approx(old, rel=1e-5, abs=1e-8)


def test_deadbeat_brings_theta2_home_in_one_step():
    found = plant(PAPER)
    chosen = law(found)
    aim = np.array(found.point.state)
    error = np.array([1e-4, -2e-4, 1e-4])
    after = ReturnMap(PAPER, float(-chosen.gain @ error)).step(SectionState(*(aim + error)))
    assert abs(after.theta2 - aim[1]) < 1e-3 * abs(error[1])


@pytest.mark.parametrize('method', METHODS)
def test_the_loop_is_stable_up_to_its_margins_and_not_beyond(method):
    found = plant(PAPER)
    chosen = law(found, method)
    edge = margins(found, chosen)
    assert abs(found.closed(chosen)[0]) < 1.0
    assert edge.gain > 1.5
    assert abs(found.closed(chosen, 0.99 * edge.gain)[0]) < 1.0 < abs(found.closed(chosen, 1.01 * edge.gain)[0])


@pytest.mark.parametrize('delay', [0.0, 0.05])
def test_an_eased_law_damps_the_worst_of_its_rigs_better(delay):
    about = plant(PAPER, delay=delay)
    chosen, rigs = law(about), plants_near(PAPER, 0.3, delay)
    assert len(rigs) == 8
    milder = eased(chosen, about, 0.3)
    worst, before = (max(abs(rig.closed(one)[1]) for rig in rigs) for one in (milder, chosen))
    assert worst < 0.37 < 0.5 < before
    assert np.array(milder.gain) / chosen.gain == pytest.approx([milder.gain[1] / chosen.gain[1]] * 3)
    assert eased(chosen, about, 0.0) == chosen


def test_the_middle_of_the_papers_swing_is_that_of_its_extremes():
    assert 100.0 * plant(PAPER).middle + 50.0 == pytest.approx(0.5 * (47.19 + 52.70), abs=0.01)


def test_targets_are_met_by_their_steady_force():
    angle = plant(PAPER, 'angle')
    assert angle.point.state.theta2 == pytest.approx(0.0, abs=1e-8)
    time = plant(PAPER, 'time')
    motion = run(PAPER, State(PAPER.front.alpha, *time.point.state), strikes=3, external_force=time.force)
    rear = next(strike.t for strike in motion.strikes if strike.wheel == 2)
    assert rear / time.point.period == pytest.approx(0.5, abs=1e-8)
    assert plant(PAPER, 'cycle').force == 0.0

"""An earlier trial beneath the live one."""

import math

import pytest

from dcdrw.page.live_state import LiveState
from dcdrw.suite.parameter_file import TrialParams
from dcdrw.trials.analysis import analyze
from dcdrw.trials.overlay import overlay
from dcdrw_msgs_py.samples import Turn
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams
from tests.tracker.walking import PITCH, walk
from tests.trials import batch

WALK = walk(6.0)
SAMPLES = WALK.samples()
HELD = [
    sample._replace(
        stamp_ns=sample.stamp_ns - 10**9,
        front=Turn(SAMPLES[0].front.angle, 0.0),
        rear=Turn(SAMPLES[0].rear.angle, 0.0),
    )
    for sample in SAMPLES[:199]
]


def test_its_curve_begins_where_the_wheels_were_let_go():
    over = overlay(analyze([batch([*HELD, *SAMPLES])], TrialParams()), 'first')
    seconds, phis = zip(*over['phis'], strict=True)
    assert seconds[0] == 0.0
    assert seconds[-1] == pytest.approx(6.0, abs=0.05)
    truth = dict(zip((WALK.time + 0.01).round(3).tolist(), WALK.phase().tolist(), strict=True))
    near = [(phi, truth[t]) for t, phi in zip(seconds, phis, strict=True) if t in truth]
    assert len(near) > 100
    assert all(phi == pytest.approx(math.degrees(phase * PITCH), abs=0.02) for phi, phase in near)


def test_wheels_that_were_held_throughout_leave_nothing_to_lay_beneath():
    with pytest.raises(ValueError, match='first cannot be laid beneath the live trial: the wheels were held'):
        overlay(analyze([batch(HELD)], TrialParams()), 'first')


@pytest.mark.parametrize(('skipped', 'known'), [(0, True), (500, False)])
def test_the_page_knows_the_start_that_it_has_seen(skipped, known):
    state, estimator = LiveState(TrialParams()), PhaseEstimator(PhaseParams())
    for k, joints in enumerate([*HELD, *SAMPLES]):
        update = estimator.update(joints)
        if update and k >= skipped:
            state.take_phase(update.phase, k / 200)
    start = state.frame(7.0)['start']
    assert start == (pytest.approx(0.99, abs=0.01) if known else None)

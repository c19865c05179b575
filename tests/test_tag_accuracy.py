"""The goals of `benchmarks/tags.py`, but for speed, on short films."""

import pytest

pytest.importorskip('cv2')

from tags import CASES, HALF_A_FRAME, track, tracker

LOSSY = '40 px, 30 s, 20 % lost, one hidden 0.5 s'


def test_there_are_goals_for_what_was_promised():
    goals = {case.name: case.goal for case in CASES}
    assert (goals['120 px'], goals['40 px'], goals['120 px, 30° oblique, 2 px blur']) == (0.1, 0.3, 0.5)


@pytest.mark.parametrize('name', ['120 px', '40 px', '40 px, 30° oblique, 2 px blur', LOSSY])
def test_a_filmed_trial_is_tracked_as_well_as_promised(name):
    (case,) = (case for case in CASES if case.name == name)
    if name == LOSSY:
        case = case._replace(seconds=3.5, look=case.look._replace(occlude_from=1.5))
    truth, scores = track(case, {'mine': tracker()}, 1.5)
    score = scores['mine']
    assert score.phi <= case.goal
    assert score.strikes(truth) <= HALF_A_FRAME
    assert score.wrong_n == 0
    assert score.lost < (0.35 if name == LOSSY else 0.05)

"""What would explain the paper's trial."""

import numpy as np
import pytest

from dcdrw_sim.study.riddle import SPANS, Cause, causes, course, course_of, rows
from tests import ROOT


@pytest.fixture(scope='module')
def courses():
    return {cause.name: course_of(cause) for cause in causes()}


def test_the_model_as_the_paper_states_it_takes_38_steps(courses):
    found = courses['as the paper says']
    assert (found.steps, found.strike_steps) == (38, 22)


def test_a_preload_comes_in_time_and_leaves_after_what_the_paper_shows(courses):
    found = courses['D0 longer by σ: a preload']
    independent = [27.6, 31.9, 36.0, 39.8, 43.4, 46.8, 49.9, 52.8, 55.5]  # by another integrator
    assert 50.0 + found.strikes[:9] == pytest.approx(independent, abs=0.06)
    assert [found.stays(span) for span in SPANS] == [True, False, False]


def test_a_softer_dashpot_comes_in_time_and_stays(courses):
    found = courses['a dashpot of 22 N·s/m']
    assert found.strike_steps in (6, 7)
    assert 16 <= found.steps <= 23
    assert all(found.stays(span) for span in SPANS)


def test_neither_mass_nor_what_the_paper_leaves_out_of_a_wheel_explains_seven_steps(courses):
    slow = [
        found for name, found in courses.items() if name.startswith(('wheels', 'heavy', 'rubber', 'coupler', 'roll'))
    ]
    assert len(slow) == 6
    for found in slow:
        assert not found.stays(SPANS[0])
        assert (np.abs(found.strikes[:10]) > 6.0).all()


def test_a_one_way_damper_drives_the_pair_through_50_percent_or_away_from_it(courses):
    resists = {way: courses[f'a damper that only resists {way}'].strikes for way in ('lengthening', 'shortening')}
    assert (resists['lengthening'][:10] < -30.0).all()
    assert (resists['shortening'][3:10] > 40.0).all()


@pytest.mark.parametrize('way', [1, -1])
def test_a_one_way_damper_that_does_nothing_leaves_the_motion_of_the_pair(way):
    rig = next(causes()).rig._replace(k=40.0, b=0.0)
    one_way, plain = course_of(Cause('', rig, '', way)), course(rig)
    assert one_way.strike_times == pytest.approx(plain.strike_times, abs=1e-4)
    assert one_way.error == pytest.approx(plain.error, abs=0.01)


def test_from_the_other_side_a_preload_drives_the_pair_away():
    rigs = {cause.name: cause.rig for cause in causes()}
    away, towards = (course(rigs[name], 0.784) for name in ('D0 longer by σ: a preload', 'a dashpot of 22 N·s/m'))
    assert np.abs(away.strikes[:10]).min() > 20.0
    assert (np.abs(towards.strikes[15:]) < 6.0).all()


def test_the_table_in_the_docs_is_what_the_model_says():
    text = (ROOT / 'docs' / 'paper.md').read_text(encoding='utf-8')
    for row in rows():
        assert f'| {" | ".join(row)} |' in text

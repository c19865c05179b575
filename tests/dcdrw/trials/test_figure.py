"""The picture of a trial shows what was measured, and nothing where nothing was."""

from contextlib import nullcontext
from itertools import combinations, pairwise

import numpy as np
import pytest

from dcdrw.suite.parameter_file import TrialParams
from dcdrw.trials.analysis import analyze
from dcdrw.trials.figure import ACTS_LABEL, MOST_DRAWN, MOST_STANCES, SCREEN, draw_trial, trial_figure
from dcdrw_sim.figures.style import COLUMN, for_print
from dcdrw_sim.rig.person import PersonParams
from dcdrw_sim.rig.simulator import SimulatorParams
from tests.drawn import assert_readable
from tests.tracker.walking import walk
from tests.trials import batch

WALK = walk(12.0).samples()
GAP = 3.0, 3.6


def figure(samples, force=1.0, title=''):
    return trial_figure(analyze([batch(samples, force)], TrialParams()), title)


def without(begin, end):
    return [sample for sample in WALK if not begin < (sample.stamp_ns - WALK[0].stamp_ns) / 1e9 < end]


def test_no_curve_crosses_a_gap():
    for axes in figure(without(*GAP)).axes[:4]:
        for line in axes.lines:
            times = np.asarray(line.get_xdata(), float)
            if line.get_linestyle() == 'None' or len(times) < 3:
                continue
            joined = np.isfinite(times[:-1]) & np.isfinite(times[1:])
            assert np.abs(np.diff(times))[joined].max() < 0.1
            assert not ((times > GAP[0] + 1e-9) & (times < GAP[1] - 1e-9)).any()


def test_stances_and_footfalls_within_a_gap_are_left_out():
    gait = figure(without(*GAP)).axes[2]
    for bars in gait.collections[:-1]:
        for path in bars.get_paths():
            begin, end = path.vertices[:, 0].min(), path.vertices[:, 0].max()
            assert end <= GAP[0] + 1e-6 or begin >= GAP[1] - 1e-6
    marks = np.concatenate([line.get_xdata() for line in gait.lines])
    assert len(marks) > 30
    assert not ((marks > GAP[0]) & (marks < GAP[1])).any()


def test_a_long_trial_is_drawn_with_no_more_than_its_dots_show():
    long = trial_figure(analyze([batch(walk(300.0, 50.0).samples(), 1.0)], TrialParams()), '')
    angles, _, gait = long.axes[:3]
    assert all(np.isfinite(line.get_xdata()).sum() <= MOST_DRAWN for line in angles.lines)
    assert sum(len(bars.get_paths()) for bars in gait.collections) <= 2 * MOST_STANCES
    begin, end = (
        f(path.vertices[:, 0].tolist())
        for f, path in ((min, gait.collections[0].get_paths()[0]), (max, gait.collections[0].get_paths()[-1]))
    )
    assert (begin, end) == pytest.approx((0.0, 300.0), abs=0.1)


def test_gaps_are_named_and_where_there_are_none_so_is_nothing():
    for samples, named in ((without(*GAP), True), (WALK, False)):
        names = [text.get_text() for text in figure(samples).axes[0].get_legend().get_texts()]
        assert ('no samples' in names) is named


PERSON = TrialParams()._replace(simulator=SimulatorParams(person=PersonParams(walks=True)))


def test_a_persons_trial_shows_four_feet_in_the_order_1_4_2_3_and_the_force_on_the_person():
    drawn = trial_figure(analyze([batch(WALK, -3.0)], PERSON), '')
    gait, force = drawn.axes[2], drawn.axes[3]
    assert [label.get_text() for label in gait.get_yticklabels()] == ['1 left', '2 right', '3 left', '4 right']
    begins = sorted(
        (path.vertices[:, 0].min(), foot)
        for foot, bars in enumerate(gait.collections, start=1)
        for path in bars.get_paths()
    )
    feet = [foot for _, foot in begins]
    assert len(feet) > 30
    assert all((one, other) in ((1, 4), (4, 2), (2, 3), (3, 1)) for one, other in pairwise(feet))
    assert force.get_ylabel() == 'on the person [N]'
    assert np.nanmax(force.lines[1].get_ydata()) == 3.0, 'compression pushes the person forward'
    assert force.get_legend().get_texts()[0].get_text().startswith('at most 3.0 N, 3.0 N rms')


def test_the_synchronizers_states_are_drawn_from_when_they_were_told_to_the_next():
    start_ns = WALK[0].stamp_ns
    acts = ((start_ns - 10**9, 'disabled'), (start_ns + 2 * 10**9, 'active'), (start_ns + 5 * 10**9, 'fault'))
    drawn = trial_figure(analyze([batch(WALK)], TrialParams())._replace(acts=acts), '').axes
    panel = next(axes for axes in drawn if axes.get_ylabel() == ACTS_LABEL)
    assert [text.get_text() for text in panel.get_legend().get_texts()] == ['disabled', 'active', 'fault']
    begins = sorted(path.vertices[:, 0].min() for bars in panel.collections for path in bars.get_paths())
    assert begins[:3] == pytest.approx([0.0, 2.0, 5.0], abs=0.1)
    assert ACTS_LABEL not in [axes.get_ylabel() for axes in figure(WALK).axes]


def test_a_source_without_force_has_no_empty_panel():
    assert [axes.get_ylabel() for axes in figure(WALK).axes][-1] == 'coupler force [N]'
    panels = figure(WALK, force=np.nan).axes
    assert len(panels) == 3
    assert all(axes.lines for axes in panels)


STALLED = [*WALK[:1600], *(WALK[1600]._replace(stamp_ns=sample.stamp_ns) for sample in WALK[1600:])]
SAMPLES = {'3 s': WALK[:600], '12 s': WALK, '300 s': walk(300.0, 50.0).samples(), 'stalled': STALLED}


@pytest.mark.parametrize('samples', [*SAMPLES.values(), without(0.5, 11.0)], ids=[*SAMPLES, 'mostly gap'])
@pytest.mark.parametrize('force', [1.0, np.nan], ids=['force', 'no force'])
@pytest.mark.parametrize('width', [SCREEN, COLUMN], ids=['screen', 'column'])
@pytest.mark.parametrize('params', [TrialParams(), PERSON], ids=['wheels', 'person'])
def test_no_text_covers_another(samples, force, width, params):
    title = 'From 21.6 % to within ±6 % of 50 % of a step (25 % of a stride) in 9 steps. ' * 4
    if width == SCREEN:  # where a page says it
        title = ''
    with for_print() if width == COLUMN else nullcontext():
        drawn = trial_figure(analyze([batch(samples, force)], params), title, width)
        assert_readable(drawn)
    boxes = [axes.get_window_extent() for axes in drawn.axes]
    boxes += [axes.get_legend().get_window_extent() for axes in drawn.axes if axes.get_legend()]
    for one, other in combinations(boxes, 2):
        assert not one.shrunk(0.98, 0.98).overlaps(other.shrunk(0.98, 0.98))


def test_it_is_drawn_into_a_file_of_each_kind(tmp_path):
    trial = analyze([batch(WALK)], TrialParams())
    for ending, begin in (('png', b'\x89PNG'), ('pdf', b'%PDF'), ('svg', b'<?xml')):
        draw_trial(trial, 'title', tmp_path / f'trial.{ending}')
        assert (tmp_path / f'trial.{ending}').read_bytes().startswith(begin)

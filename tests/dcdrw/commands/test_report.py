"""`dcdrw report`: recordings in, one page and its tables out."""

import csv
import json
import re
from html.parser import HTMLParser
from io import StringIO
from unittest.mock import patch

import numpy as np
import pytest

from dcdrw.cli import main
from dcdrw.trials import report_page
from dcdrw.trials.day import table
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.rig.simulator import SimulatorParams
from tests.bags import joint_state, write_bag
from tests.chromium import Chromium
from tests.drawn import assert_readable

pytestmark = pytest.mark.processes

RATE = 100
SECONDS = 12.0


def measured_bag(folder, phase, names=('front_wheel', 'rear_wheel'), gap=(0.0, 0.0)):
    """A bag as a rig's own tracker fills it: no coupler, no parameters."""
    rig, state = SimulatorParams(initial_phase_percent=100.0 * phase).start(RigParams())
    motion = run(rig, state, SECONDS, 1000)
    times = np.arange(0.0, SECONDS, 1.0 / RATE)
    times = times[~((times > gap[0]) & (times < gap[1]))]
    trajectory = motion.at(times)
    stamps = 10**18 + (times * 1e9).astype(int)
    return write_bag(
        folder,
        [
            (int(stamp), joint_state(int(stamp), names, (psi1, psi2), (omega1, omega2)))
            for stamp, psi1, psi2, omega1, omega2 in zip(
                stamps, trajectory.rotation1, trajectory.rotation2, trajectory.omega1, trajectory.omega2, strict=True
            )
        ],
    )


class Page(HTMLParser):
    """What a page refers to, and its words."""

    def __init__(self, text):
        super().__init__()
        self.links, self.words = [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.links += [value for name, value in attributes if name in ('href', 'src', 'xlink:href')]

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope='module')
def report(tmp_path_factory, live_trial):
    folder = tmp_path_factory.mktemp('report')
    bag = measured_bag(folder / 'bag', 0.3)
    path = folder / 'today.html'

    svg = report_page._svg

    def readable(figure):
        assert_readable(figure)
        return svg(figure)

    with patch.object(report_page, '_svg', readable):
        assert main(['report', str(live_trial), str(bag), '--title', 'A <day>', '--out', str(path)]) == 0
    return path


def rows(report, name):
    return list(csv.DictReader((report.with_suffix('.csv') / name).read_text().splitlines()))


def test_page_is_self_contained_and_tells_each_trial(report):
    text = report.read_text()
    page = Page(text)
    assert all(link.startswith(('#', 'data:')) for link in page.links)
    assert not re.search(r'url\((?!#)|@import', text)
    words = ' '.join(page.words)
    assert 'A <day>' in words
    assert 'first: "with" new springs' in words  # the operator's note
    assert text.count('<svg') == 6  # the overlays by steps and by time, and two for each trial
    assert {'first', 'bag'} <= set(page.words)


def test_contraction_is_one_number_in_every_place(report, live_trial):
    live = next(trial for trial in rows(report, 'trials.csv') if trial['source'] == 'simulated')
    summary = json.loads((live_trial / 'summary.json').read_text())
    assert float(live['contraction_per_step']) == pytest.approx(summary['contraction_per_step'], rel=1e-5)
    assert f'{100 * summary["contraction_per_step"]:.1f}' in report.read_text()


def test_tables_hold_every_number(report):
    trials = rows(report, 'trials.csv')
    assert [(trial['source'], float(trial['initial_phase_percent'])) for trial in trials] == [
        ('simulated', pytest.approx(35.0)),
        ('measured', pytest.approx(30.0)),
    ]
    live, bag = trials
    assert live['synchronized'] == 'True'
    assert float(live['k']) == 60.0
    assert live['note'].startswith('first')
    assert (bag['k'], bag['b'], bag['slope_deg']) == ('', '', ''), 'nobody has told them'
    # The paper's rig, whose error a step multiplies by 0.9411 (the largest multiplier).
    assert float(bag['contraction_per_step']) == pytest.approx(0.94, abs=0.02)
    steps = [step for step in rows(report, 'steps.csv') if step['trial'] == 'bag' and step['wheel'] == 'front']
    assert len(steps) == int(bag['front_steps'])
    assert all(step['error_percent'] for step in steps)
    samples = rows(report, 'samples.csv')
    assert sum(sample['trial'] == 'bag' for sample in samples) == pytest.approx(SECONDS * RATE, abs=2)


@pytest.fixture(scope='module')
def chromium(tmp_path_factory):
    browser = Chromium(tmp_path_factory.mktemp('chromium'))
    yield browser
    browser.close()


def test_verdicts_are_whole_at_1280_pixels_and_trials_are_laid_over_one_another_at_will(report, chromium):
    tab = chromium.tab(f'file://{report}', 1280, 900)
    assert tab.value('document.documentElement.scrollWidth') <= 1280
    assert tab.value("document.querySelector('.wide').scrollWidth <= document.querySelector('.wide').clientWidth")
    assert tab.value("[...document.querySelectorAll('th')].slice(0, 2).map(cell => cell.innerText.trim()).join()") == (
        'trial,verdict'
    )
    shown = "['steps0', 'time0', 'steps1', 'time1'].map(id => +(document.getElementById(id).style.display !== 'none'))"
    assert tab.value(f'{shown}.join()') == '1,1,1,1'
    tab.value("document.querySelector('#choice [value=none]').click()")
    assert tab.value(f'{shown}.join()') == '0,0,0,0'
    tab.value('document.querySelector(\'#choice input[value="1"]\').click()')
    assert tab.value(f'{shown}.join()') == '0,0,1,1'
    assert tab.complaints == []


def test_what_was_not_run_is_listed_as_such_and_not_drawn(tmp_path, capsys):
    stamps = [10**18 + i * 10**7 for i in range(300)]
    names = ('front_wheel', 'rear_wheel')
    held = write_bag(
        tmp_path / 'held', [(stamp, joint_state(stamp, names, (-0.26, 0.1), (0.0, 0.0))) for stamp in stamps]
    )
    path = tmp_path / 'r.html'
    assert main(['report', str(held), '--out', str(path)]) == 1
    assert 'Not run: the wheels were held' in capsys.readouterr().out
    text = path.read_text()
    assert 'not run: held' in text
    assert '<svg' not in text
    (trial,) = rows(path, 'trials.csv')
    assert (trial['state'], trial['synchronized'], trial['complete']) == ('held', '', 'False')
    assert main(['report', str(held), str(measured_bag(tmp_path / 'bag', 0.3)), '--out', str(tmp_path / 's.html')]) == 1
    assert (tmp_path / 's.html').read_text().count('<svg') == 4


def test_a_trial_without_a_strike_is_no_failure_and_no_success(tmp_path, capsys):
    names = ('front_wheel', 'rear_wheel')
    bag = write_bag(
        tmp_path / 'bag',
        [(10**18 + i * 10**7, joint_state(10**18 + i * 10**7, names, (0.01 * i, 0.1 + 0.01 * i))) for i in range(9)],
    )
    path = tmp_path / 'r.html'
    assert main(['report', str(bag), '--out', str(path)]) == 1
    assert 'Too little to judge: 0 steps of the 3 that a verdict takes' in capsys.readouterr().out
    assert '<span class="none">too little to judge</span>' in path.read_text()
    (trial,) = rows(path, 'trials.csv')
    assert (trial['state'], trial['synchronized'], trial['complete']) == ('converging', '', 'False')


def test_each_trial_tells_its_gaps(tmp_path):
    bag = measured_bag(tmp_path / 'bag', 0.3, gap=(4.0, 4.5))
    path = tmp_path / 'r.html'
    assert main(['report', str(bag), '--out', str(path)]) == 0
    (trial,) = rows(path, 'trials.csv')
    assert int(trial['samples_lost']) == 49
    words = ' '.join(Page(path.read_text()).words)
    assert 'By the stamps, 49 of 1200 samples are missing' in words
    assert 'Gaps, the longest first: 0.5 s at 4.0 s.' in words


def test_nothing_is_overwritten(report, live_trial, capsys):
    before = report.read_text()
    assert main(['report', str(live_trial), '--out', str(report)]) == 2
    assert 'exists already' in capsys.readouterr().err
    assert report.read_text() == before


def test_what_cannot_be_read_is_left_out_and_said(tmp_path, capsys):
    bag = measured_bag(tmp_path / 'bag', 0.3)
    (tmp_path / 'empty').mkdir()
    assert main(['report', str(tmp_path / 'empty'), str(bag), '--out', str(tmp_path / 'r.html')]) == 1
    assert 'left out' in capsys.readouterr().err
    assert (tmp_path / 'r.html').exists()
    assert main(['report', str(tmp_path / 'empty'), '--out', str(tmp_path / 'none.html')]) == 2
    assert not (tmp_path / 'none.html').exists()


def test_a_page_ends_in_html(tmp_path, capsys):
    assert main(['report', str(tmp_path), '--out', 'today.txt']) == 2
    assert capsys.readouterr().err == 'dcdrw report: --out must end in .html, got today.txt\n'


def test_trials_of_one_name_are_told_apart(tmp_path):
    bags = [measured_bag(tmp_path / day / 'bag', 0.3) for day in ('monday', 'tuesday')]
    assert main(['report', *map(str, bags), '--out', str(tmp_path / 'r.html')]) == 0
    assert [trial['trial'] for trial in rows(tmp_path / 'r.html', 'trials.csv')] == ['bag', 'bag (2)']


def test_notes_are_no_formulas_to_a_spreadsheet():
    notes = ['=1+1', '+1', '-1', '@SUM(A1)', '\t=1', 'plain = fine', -1.5, '']
    rows = list(csv.reader(StringIO(table(('note',), ([note] for note in notes)))))
    assert [row[0] for row in rows[1:]] == ["'=1+1", "'+1", "'-1", "'@SUM(A1)", "'\t=1", 'plain = fine', '-1.5', '']

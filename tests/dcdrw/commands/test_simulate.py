"""`dcdrw simulate`: strikes and motion of case files."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from dcdrw.cli import main
from tests import ROOT

REFERENCE = ROOT / 'tests' / 'data' / 'strikes.json'


def reference() -> list[dict]:
    return json.loads(REFERENCE.read_text())


def test_reference_file_comes_out_as_it_went_in(tmp_path):
    out = tmp_path / 'out.json'
    assert main(['simulate', str(REFERENCE), '--strikes', str(out)]) == 0
    for got, expected in zip(json.loads(out.read_text()), reference(), strict=True):
        assert got['case'] == expected['case']
        assert [s['wheel'] for s in got['strikes']] == [s['wheel'] for s in expected['strikes']]
        for ours, theirs in zip(got['strikes'], expected['strikes'], strict=True):
            assert ours['t'] == pytest.approx(theirs['t'], abs=1e-9)
            assert ours['state'] == pytest.approx(theirs['state'], abs=1e-9)


@pytest.mark.parametrize(('arguments', 'count'), [([], 20), (['--count', '3'], 3)])
def test_single_case_without_strikes_gets_twenty_or_as_many_as_asked(tmp_path, capsys, arguments, count):
    case = tmp_path / 'case.json'
    case.write_text(json.dumps(reference()[0]['case']))
    assert main(['simulate', str(case), *arguments]) == 0
    result = json.loads(capsys.readouterr().out)
    assert len(result['strikes']) == count
    assert result['end']['reason'] == 'strikes'


def test_run_that_ends_by_itself_says_why(tmp_path, capsys):
    case = reference()[0]['case'] | {'slope': 0.0, 'k': 0.0, 'b': 0.0}
    (tmp_path / 'flat.json').write_text(json.dumps(case))
    assert main(['simulate', str(tmp_path / 'flat.json'), '--count', '500']) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)['end']['reason'] == 'standing'
    assert 'stands still on two spokes' in captured.err


def test_trajectory_passes_through_the_strikes(tmp_path):
    out = tmp_path / 'motion.csv'
    assert main(['simulate', str(REFERENCE), '--trajectory', str(out), '--rate', '1000', '--count', '4']) == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert {row['case'] for row in rows} == {entry['case']['name'] for entry in reference()}
    first = [row for row in rows if row['case'] == 'paper_rig']
    times = np.array([float(row['time']) for row in first])
    strike = reference()[0]['strikes'][1]  # of the front wheel
    assert np.interp(strike['t'], times, [float(row['theta2']) for row in first]) == pytest.approx(
        strike['state'][2], abs=1e-5
    )
    assert first[0]['rotation1'] == first[0]['theta1']


def test_npz_holds_a_column_for_each_quantity(tmp_path):
    case = tmp_path / 'case.json'
    case.write_text(json.dumps(reference()[1]))
    out = tmp_path / 'motion.npz'
    assert main(['simulate', str(case), '--trajectory', str(out), '--rate', '50']) == 0
    with np.load(out) as columns:
        assert {'time', 'theta1', 'coupler_force', 'steps2'} <= set(columns.files)
        assert np.diff(columns['time']) == pytest.approx(0.02)


def test_cases_of_one_name_are_told_apart(tmp_path):
    case = {key: value for key, value in reference()[0]['case'].items() if key != 'name'}
    (tmp_path / 'two.json').write_text(json.dumps([case, case | {'k': 50.0}]))
    out = tmp_path / 'motion.npz'
    assert main(['simulate', str(tmp_path / 'two.json'), '--trajectory', str(out), '--count', '2']) == 0
    with np.load(out) as columns:
        assert {'case_0/theta1', 'case_1/theta1'} <= set(columns.files)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['case.json', '--trajectory', 'motion.csv', '--rate', '1e12'], 'samples; 2e+07 are the limit'),
        (['nowhere.json'], 'nowhere.json'),
        (['broken.json'], 'broken.json is not JSON'),
        (['empty.json'], 'empty.json'),
        (['keyless.json'], 'k is missing'),
        (['case.json', '--trajectory', 'motion.txt'], '--trajectory must end in .csv or .npz, got motion.txt'),
        (['case.json', '--strikes', 'no/such/folder.json'], 'no/such/folder.json'),
    ],
)
def test_wrong_input_is_told_in_one_line(tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    case = reference()[0]['case']
    Path('case.json').write_text(json.dumps(case))
    Path('broken.json').write_text('{')
    Path('empty.json').write_text('[]')
    Path('keyless.json').write_text(json.dumps({key: value for key, value in case.items() if key != 'k'}))
    assert main(['simulate', *arguments]) == 2
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last.startswith('dcdrw simulate: ')
    assert message in last


def test_help_reads_well(capsys):
    commands = (
        'trial live record replay analyze report film tags track calibrate design sweep figures regimes map '
        'models simulate urdf'
    )
    for command in ('', *commands.split()):
        with pytest.raises(SystemExit) as ended:
            main([*filter(None, [command]), '--help'])
        assert ended.value.code == 0
        assert max(map(len, capsys.readouterr().out.splitlines())) <= 120

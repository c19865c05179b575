"""`dcdrw map`: what a person and a program are told of the return map."""

import json
import math
from pathlib import Path

import pytest

from dcdrw.cli import main

QUICK = ['--steps', '25']
FAR_FROM_HALF = f'k: 0.001973\n    b: 6.273\n    slope: {math.radians(9.09)}'
FORM = '/**:\n  ros__parameters:\n    {}\n'


def test_report_sets_all_measures_side_by_side(capsys):
    assert main(['map', '--preset', 'paper-sweep', *QUICK]) == 0
    lines = {line[:13].strip(): line[13:].split() for line in capsys.readouterr().out.splitlines()}
    assert lines['fixed point'][:2] == ['θ2*', '=']
    assert lines['fixed point'][2] == '-0.863°,'
    assert lines['phase'] == ['52.9', '%', 'of', 'a', 'step,', '26.4', '%', 'of', 'a', 'stride']
    assert lines['multipliers'] == ['0.8911', '0.7829', '0.4188', 'stable']
    assert lines['raw'][0] == '1.0000'
    assert 0.85 < float(lines['affine'][0]) < 0.95
    assert lines['convergence'][:4] == ['20.0', 'steps', 'per', 'decade']
    assert lines['to the cycle'][:9] == ['25', '21', '17', '11', '0', '10', '16', '21', '24']
    assert lines['steps'][:9] == ['-'] * 9
    assert lines['swing'][:4] == ['43.03', 'to', '57.01', '%']


def test_json_holds_everything(tmp_path, capsys):
    out = tmp_path / 'map.json'
    assert main(['map', *QUICK, '--json', str(out)]) == 0
    result = json.loads(out.read_text(encoding='utf-8'))
    point = result['fixed_point']
    assert point['theta2'] == pytest.approx(math.radians(point['theta2_deg']))
    assert point['phase_percent'] == pytest.approx(2 * point['phase_percent_of_stride'])
    assert result['moduli'] == sorted(result['moduli'], reverse=True)
    assert result['moduli'][0] == pytest.approx(abs(complex(*result['multipliers'][0])))
    assert len(result['regressions']['raw']['matrix']) == 4
    assert result['regressions']['affine']['rank'] == 3
    assert [trial['phase_percent'] for trial in result['trials']] == pytest.approx(list(range(10, 100, 10)))
    assert result['fixed_point']['swing_percent'] == pytest.approx([47.19, 52.70], abs=0.005)
    assert [trial['strike_steps'] for trial in result['trials']][2:6] == [15, 3, 0, 18]
    assert result['parameters']['k'] == 5.25


def test_the_stable_limit_cycle_is_found_beside_an_unstable_one_and_told_though_trials_fail(tmp_path, capsys):
    wheels = '\n    '.join(
        f'{side}.{name}: {value}'
        for side in ('front', 'rear')
        for name, value in (('length', 1.0), ('mass', 1.0), ('spokes', 8.0))
    )
    (tmp_path / 'rig.yaml').write_text(FORM.format(f'{wheels}\n    gravity: 1.0\n    {FAR_FROM_HALF}'))
    out = tmp_path / 'map.json'
    assert main(['map', *QUICK, '--rig', str(tmp_path / 'rig.yaml'), '--json', str(out)]) == 0
    found = json.loads(out.read_text(encoding='utf-8'))
    assert found['fixed_point']['theta2_deg'] == pytest.approx(21.53, abs=0.01)
    assert found['moduli'][0] == pytest.approx(0.98934, abs=2e-4)
    assert found['fixed_point']['stable']


def test_rig_file_changes_the_preset(tmp_path, capsys):
    (tmp_path / 'rig.yaml').write_text(FORM.format('k: 40'))
    out = tmp_path / 'map.json'
    assert main(['map', *QUICK, '--rig', str(tmp_path / 'rig.yaml'), '--json', str(out)]) == 0
    assert json.loads(out.read_text(encoding='utf-8'))['parameters']['k'] == 40.0


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        ('rear.spokes: 13', 'a return map needs wheels of equal step length'),
        ('slope: 0.01', 'too gentle for the front wheel'),
        ('b: -1', 'b must be'),
        ('b: 32\n    slope: 0.0305', 'no fixed point'),
    ],
)
def test_a_rig_without_map_is_told_in_one_line(tmp_path, monkeypatch, capsys, content, message):
    monkeypatch.chdir(tmp_path)
    Path('rig.yaml').write_text(FORM.format(content))
    assert main(['map', '--rig', 'rig.yaml']) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith('dcdrw map: ')
    assert message in captured.err
    assert captured.err.count('\n') == 1
    assert not captured.out


def test_help_reads_well(capsys):
    with pytest.raises(SystemExit) as ended:
        main(['map', '--help'])
    assert ended.value.code == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 120

"""`dcdrw models`: the table, the numbers and the pictures."""

import json
import math
import sys
from pathlib import Path

import pytest

from dcdrw.cli import main
from tests.drawn import readable_figures

FORM = '/**:\n  ros__parameters:\n    {}\n'


def written(tmp_path, content):
    path = tmp_path / 'rig.yaml'
    path.write_text(FORM.format(content))
    return str(path)


def test_table_sets_the_models_side_by_side(capsys):
    assert main(['models']) == 0
    text = capsys.readouterr().out
    lines = [line.strip() for line in text.splitlines()]
    assert lines[0] == 'single wheel'
    assert 'limit cycle   0.8437 m/s, a step in 0.5922 s; 1.0496 rad/s after a strike, 1.2120 before' in lines
    assert any(line.startswith('multiplier    0.7500') for line in lines)
    assert any('above 1.083° it rolls' in line for line in lines)
    rows = {line[:9].strip(): line[9:].split() for line in lines if line[:1].isdigit()}
    assert rows['0 at once'] == ['0.8437', '0.5922', '0.7500', '1.083', '2.574', '8.812', '0.0']
    assert rows['50'][:5] == ['1.0275', '0.4863', '0.7502', '0.275', '2.000']
    assert 'fastest at 50.63 %: 1.0275 m/s' in lines
    assert 'settles at 52.7 %, 0.8841 m/s' in lines
    assert any('1-4-2-3' in line and '25.0 % of a stride' in line for line in lines)
    assert max(map(len, text.splitlines())) <= 120


def test_folder_gets_numbers_and_pictures(tmp_path, capsys):
    pytest.importorskip('matplotlib')
    out = tmp_path / 'new' / 'models'
    with readable_figures():
        assert main(['models', '--out', str(out)]) == 0
    assert {path.name for path in out.iterdir()} == {'models.json', 'wheel.png', 'pair.png', 'footfalls.png'}
    assert all(path.read_bytes().startswith(b'\x89PNG') for path in out.glob('*.png'))
    found = json.loads((out / 'models.json').read_text(encoding='utf-8'))
    wheel = found['wheels']['front']
    assert wheel['omega_after_strike'] == pytest.approx(wheel['omega_before_strike'] * math.cos(math.pi / 6))
    assert found['wheels']['rear'] == wheel
    assert found['rigid_pair']['fastest']['velocity'] > found['rigid_pair']['phases'][0]['velocity']
    assert found['parameters']['k'] == 5.25
    assert str(out) in capsys.readouterr().out


def test_unequal_wheels_are_told_one_by_one_and_have_no_pair(tmp_path, capsys):
    pytest.importorskip('matplotlib')
    out = tmp_path / 'out'
    with readable_figures():
        assert main(['models', '--rig', written(tmp_path, 'rear.spokes: 13'), '--out', str(out)]) == 0
    text = capsys.readouterr().out
    assert 'front wheel by itself' in text
    assert 'rear wheel by itself' in text
    assert 'none: a rigid pair needs wheels of equal step length' in text
    assert not (out / 'pair.png').exists()
    assert (out / 'wheel.png').exists()


def test_where_nothing_rolls_the_table_says_so(tmp_path, capsys):
    assert main(['models', '--rig', written(tmp_path, 'slope: 0.002')]) == 0
    text = capsys.readouterr().out
    assert 'none on 0.1146°' in text
    assert 'fastest' not in text
    assert 'nan' not in text.lower()


def test_on_a_slope_steeper_than_its_spokes_a_wheel_is_not_said_to_stand(tmp_path, capsys):
    assert main(['models', '--rig', written(tmp_path, 'slope: 0.3')]) == 0
    assert 'comes to stand' not in capsys.readouterr().out


def test_without_matplotlib_it_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, 'matplotlib.figure', None)
    monkeypatch.chdir(tmp_path)
    assert main(['models', '--out', 'out']) == 2
    captured = capsys.readouterr()
    assert captured.err == 'dcdrw models: a picture needs matplotlib: pip install matplotlib\n'
    assert not captured.out
    assert not Path('out').exists()


def test_help_reads_well(capsys):
    with pytest.raises(SystemExit) as ended:
        main(['models', '--help'])
    assert ended.value.code == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 120

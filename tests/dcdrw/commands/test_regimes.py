"""`dcdrw regimes`: what it takes to walk in step, and whether a rig has it."""

import json
import math

import pytest

from dcdrw.cli import main

FORM = '/**:\n  ros__parameters:\n    {}\n'


def written(tmp_path, content):
    path = tmp_path / 'rig.yaml'
    path.write_text(FORM.format(content))
    return str(path)


def lines(capsys):
    return [' '.join(line.split()) for line in capsys.readouterr().out.splitlines()]


def test_a_pair_that_walks_about_the_goal_but_swings_beyond_the_band(tmp_path, capsys):
    path = tmp_path / 'regimes.json'
    assert main(['regimes', '--preset', 'paper-sweep', '--json', str(path)]) == 0
    text = lines(capsys)
    assert 'stall band 0.446 to 1.755 N·s/m (closed form 0.3975 to 1.896)' in text
    assert any(line.startswith('no damper stalls above 1.866°') for line in text)
    assert any('moduli 0.8911 0.7829 0.4188' in line for line in text)
    assert 'within a step the phase swings from 43.03 to 57.01 %' in text
    assert [line.split()[0] for line in text[-5:-1]] == ['yes', 'yes', 'NO', 'yes']
    assert text[-1] == 'so the pair does not walk in step'
    found = json.loads(path.read_text(encoding='utf-8'))
    assert found['limit_cycle']['rear_strike'] == pytest.approx(0.5, abs=1e-3)
    assert math.degrees(found['gentlest_slope']) == pytest.approx(1.479, abs=1e-3)
    assert found['basin'] == {'starts': 25, 'lead_there': 25, 'least_speed': pytest.approx(0.754, abs=0.005)}
    assert found['parameters']['slope'] == pytest.approx(math.radians(1.75))


def test_a_pair_that_walks_in_step(capsys):
    assert main(['regimes']) == 0
    text = lines(capsys)
    assert 'within a step the phase swings from 47.19 to 52.70 %' in text
    assert any('this coupler needs more than 1.449°' in line for line in text)
    assert sum(line.startswith('yes') for line in text) == 4
    assert text[-1] == 'so the pair walks in step'


def test_in_the_stall_band_it_does_not(tmp_path, capsys):
    assert main(['regimes', '--preset', 'paper-sweep', '--rig', written(tmp_path, 'b: 0.8')]) == 0
    text = lines(capsys)
    assert 'limit cycle none: a wheel fails to pass its apex' in text
    assert sum(line.startswith('NO') for line in text) == 4
    assert text[-1] == 'so the pair does not walk in step'


def test_a_pair_that_walks_beside_the_goal(tmp_path, capsys):
    assert main(['regimes', '--preset', 'paper-sweep', '--rig', written(tmp_path, 'b: 0.4')]) == 0
    text = lines(capsys)
    assert [line.split()[0] for line in text[-5:-1]] == ['yes', 'yes', 'NO', 'yes']


def test_where_no_wheel_rolls_by_itself_there_is_no_start(tmp_path, capsys):
    rig = written(tmp_path, 'slope: 0.0157\n    b: 10.0')  # 0.9°
    assert main(['regimes', '--preset', 'paper-sweep', '--rig', rig]) == 0
    text = lines(capsys)
    assert any(line.startswith('this coupler needs') or 'needs more than 0.841°' in line for line in text)


def test_unequal_wheels_are_refused(tmp_path, capsys):
    assert main(['regimes', '--rig', written(tmp_path, 'rear.mass: 8.0')]) == 2
    assert capsys.readouterr().err == ('dcdrw regimes: regimes are those of equal wheels: make front and rear alike\n')


def test_help_reads_well(capsys):
    with pytest.raises(SystemExit) as ended:
        main(['regimes', '--help'])
    assert ended.value.code == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 120

"""`dcdrw design` as a user runs it."""

import csv
import json
import math

import pytest

from dcdrw.cli import main

PARTS = """\
kind,value,name
spring,5.25,soft
spring,12,firm
dashpot,8,thin
dashpot,100,thick
rope,3,long
"""


@pytest.fixture
def parts(tmp_path):
    path = tmp_path / 'parts.csv'
    path.write_text(PARTS)
    return path


def test_best_pair_of_parts_with_card_and_numbers(tmp_path, parts, capsys):
    given = ['--k', '5.25', '--b', '100', '--seconds', '30']
    assert main(['design', '--available', str(parts), *given, '--out', str(tmp_path / 'out')]) == 0
    output = capsys.readouterr().out
    assert 'fastest          k = 12 N/m, b = 8 N·s/m' in output
    assert 'firm, thin' in output
    assert '45 from the worst start' in output  # the paper's own coupler
    found = json.loads((tmp_path / 'out' / 'design.json').read_text())
    assert found['couplers']['fastest']['spring'] == 'firm'
    assert found['couplers']['given']['worst_steps'] == 45
    assert found['couplers']['given']['multiplier'] == pytest.approx(0.9411, abs=1e-4)
    assert found['task']['band_percent'] == pytest.approx(6.0)
    assert found['couplers']['given']['loads']['force'] == pytest.approx(23.9, abs=0.1)
    given = found['couplers']['given']
    assert given['hub_distance_at_rest'] == pytest.approx(1.2150, abs=1e-4)
    assert given['spring_free_length'] + given['spring_rods'] == pytest.approx(1.2150, abs=1e-4)
    assert f'free length {1e3 * given["spring_free_length"]:.0f} mm or more' in output
    assert f'{1e3 * given["spring_rods"]:.0f} mm of rods and eyes; without force' in output
    with (tmp_path / 'out' / 'pairs.csv').open(encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    assert [row['spring'] for row in rows] == [pair['spring'] for pair in found['pairs']]
    assert (rows[0]['spring'], rows[0]['dashpot']) == ('firm', 'thin')
    assert float(rows[0]['stall_slope']) == pytest.approx(found['couplers']['fastest']['stall_slope'])
    assert "skipped, line 6: kind must be spring, dashpot or damper, got 'rope'" in output
    assert found['skipped']
    assert (tmp_path / 'out' / 'card.pdf').read_bytes().startswith(b'%PDF')
    assert (tmp_path / 'out' / 'card.png').read_bytes().startswith(b'\x89PNG')


def test_parts_for_an_uncertain_rig_need_no_folder_for_a_card(tmp_path, parts, capsys):
    rig = tmp_path / 'rig.yaml'
    rig.write_text('/**: {ros__parameters: {k: 5.25}}\nuncertainty: {ros__parameters: {standard_errors: {b: 5.0}}}\n')
    assert main(['design', '--available', str(parts), '--rig', str(rig), '--seconds', '8']) == 0
    output = capsys.readouterr().out
    assert 'surest' in output
    assert 'in step from every start on' in output


def test_what_swings_beyond_the_band_is_not_recommended_and_what_is_the_monitor_has_seen(tmp_path, capsys):
    path = tmp_path / 'parts.csv'
    path.write_text('kind,value\nspring,16\ndashpot,10\n')
    given = ['--k', '41.1', '--b', '14.7', '--seconds', '12']
    assert main(['design', '--available', str(path), *given, '--out', str(tmp_path / 'out')]) == 0
    output = capsys.readouterr().out
    assert 'fastest          k = 16 N/m, b = 10 N·s/m' in output
    assert 'swings from 44.13 to 55.83 %' in output
    assert 'NOT RECOMMENDED' in output.partition('given')[2]
    assert 'swings from 43.37 to 56.58 %' in output.partition('given')[2]
    couplers = json.loads((tmp_path / 'out' / 'design.json').read_text())['couplers']
    fastest, other = couplers['fastest'], couplers['given']
    assert fastest['recommended']
    assert fastest['monitor_steps'] == fastest['steps']
    assert (max(fastest['steps']), max(fastest['strike_steps'])) == (6, 3)
    assert not other['recommended']
    assert (other['worst_steps'], max(other['strike_steps'])) == (None, 2)


KNOWN = """\
/**:
  ros__parameters: {slope: 0.0349065850}
uncertainty:
  ros__parameters:
    standard_errors: {slope: 0.008, mass: 1.0, k: 0.0}
"""


def test_a_rig_that_is_known_with_errors_gets_the_coupler_that_is_surest_on_what_it_may_be(tmp_path, parts, capsys):
    (tmp_path / 'rig.yaml').write_text(KNOWN)
    arguments = ['--rig', tmp_path / 'rig.yaml', '--available', parts, '--seconds', 12, '--out', tmp_path / 'out']
    assert main(['design', *map(str, arguments), '--format', 'png']) == 0
    output = capsys.readouterr().out
    couplers = json.loads((tmp_path / 'out' / 'design.json').read_text())['couplers']
    outlooks = {name: coupler['outlook'] for name, coupler in couplers.items()}
    assert set(outlooks) == {'fastest', 'most_forgiving', 'surest'}
    best = outlooks['surest']
    assert best['rigs'] == 64
    assert max(one['in_step'] for one in outlooks.values()) == best['in_step'] < 1.0  # on some slopes none rolls
    assert best['median_steps'] <= (best['late_steps'] or math.inf)
    told = output.partition('On 64 rigs as likely as this one is known:')[2]
    assert f'surest         in step from every start on {100.0 * best["in_step"]:.0f} %' in told
    assert f'half of them within {best["median_steps"]:.0f} steps' in told
    assert (tmp_path / 'out' / 'card.png').exists()


def test_where_the_mounting_lets_no_coupler_come_into_step_it_is_told(tmp_path, parts, capsys):
    (tmp_path / 'rig.yaml').write_text('/**:\n  ros__parameters: {D0: 1.439}\n')
    arguments = ['--rig', tmp_path / 'rig.yaml', '--available', parts, '--seconds', 15]
    assert main(['design', *map(str, arguments)]) == 0
    output = capsys.readouterr().out
    assert 'at 50 %, where they are 1.215 m apart' in output
    assert 'With 224 mm less of rods it is so at 50 %: try it, as D0: 1.215 in the rig file.' in output


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['--k', '5'], '--k and --b together'),
        (['--slope-deg', '1'], 'too gentle'),
        (['--spokes', '3'], 'spokes'),
        (['--tolerance', '100'], 'below 100 %'),
        (['--band', '50'], 'below 50 %'),
        (['--k-min', '5', '--k-max', '4'], '--k-min 5 is above --k-max 4'),
        (['--available', 'nowhere.csv'], 'nowhere.csv'),
    ],
)
def test_wrong_input_is_told_in_one_line(capsys, arguments, message):
    assert main(['design', *arguments]) == 2
    errors = capsys.readouterr().err
    assert message in errors
    assert errors.count('\n') == 1

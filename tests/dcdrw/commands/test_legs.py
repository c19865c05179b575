"""`dcdrw legs` on CSV files; recordings are tested with their readings."""

import json

from dcdrw.cli import main
from tests import ROOT

DATA = ROOT / 'tests' / 'data' / 'gait'


def test_a_recorded_person_is_told_and_written(tmp_path, capsys):
    out = tmp_path / 'out'
    assert main(['legs', str(DATA / 'imu_sample.csv'), '--rate', '204.8', '--out', str(out)]) == 0
    told = capsys.readouterr().out.splitlines()
    assert [line.split(':')[0] for line in told[:2]] == ['front_left (imu)', 'front_right (imu)']
    legs = json.loads((out / 'summary.json').read_text())['legs']
    head, *strikes = (out / 'heel_strikes.csv').read_text().splitlines()
    assert head == 'leg,stamp_ns,known_ns'
    assert len(strikes) == legs['front_left']['strikes'] + legs['front_right']['strikes']
    assert all(int(strike.split(',')[1]) <= int(strike.split(',')[2]) for strike in strikes)


def test_the_stride_on_the_treadmill_is_what_the_force_plate_tells(capsys):
    assert main(['legs', str(DATA / 'example_vertical_grf.csv')]) == 0
    assert capsys.readouterr().out == 'front_left (wrench): 46 heel strikes, stride 1.201 ± 0.021 s\n'


def test_a_leg_that_cannot_be_told_is_no_success(tmp_path, capsys):
    axes = [f'left_{kind}_{axis}' for kind in ('acc', 'gyr') for axis in 'xyz']
    rows = [f'{k / 100},0,0,9.81,0,0,0' for k in range(300)]
    (tmp_path / 'still.csv').write_text('\n'.join([','.join(['time', *axes]), *rows]))
    assert main(['legs', str(tmp_path / 'still.csv')]) == 1
    assert 'its mounting is not known' in capsys.readouterr().out
    rows = [f'{k / 100},,,,1,2,3' if k % 2 else f'{k / 100},0,0,9.81,,,' for k in range(300)]
    (tmp_path / 'halves.csv').write_text('\n'.join([','.join(['time', *axes]), *rows]))
    assert main(['legs', str(tmp_path / 'halves.csv')]) == 1
    assert 'no sensor on a leg tells anything' in capsys.readouterr().out


def test_wrong_input_says_what_to_do(tmp_path, capsys):
    assert main(['legs', str(DATA / 'imu_sample.csv')]) == 2
    assert '--rate' in capsys.readouterr().err
    assert main(['legs', str(tmp_path / 'nothing.csv')]) == 2
    assert 'nothing.csv' in capsys.readouterr().err
    assert main(['legs', str(DATA / 'example_vertical_grf.csv'), '--out', str(DATA)]) == 2
    assert 'not overwriting' in capsys.readouterr().err

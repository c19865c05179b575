import math

import pytest

from dcdrw.cli import main
from dcdrw.recordings.leg_recording import leg_readings, leg_topics
from dcdrw.recordings.recording import Recording
from dcdrw.trials.results import read_trial
from dcdrw_control.legs.params import HIPS
from dcdrw_control.legs.samples import LEGS, ContactReading, ImuReading, WrenchReading
from tests.dcdrw.recordings.legs import PERIOD, RATE, write_walk


@pytest.mark.parametrize(
    ('kind', 'first'),
    [
        ('wrench', WrenchReading(700.0)),
        ('contact', ContactReading(True)),
        ('imu', ImuReading((0.1, 0.2, 0.3), (0.0, 0.0, 9.8))),
    ],
)
def test_readings_come_back_with_their_stamps(tmp_path, kind, first):
    with Recording(write_walk(tmp_path / 'walk', LEGS[:1], 0.5, '/xrl', kind)) as recording:
        assert leg_topics(recording) == [f'/xrl/front/left_{kind}']
        readings = list(leg_readings(recording, HIPS))
    assert [reading.stamp_ns for reading in readings] == [10**9 + k * 10**9 // RATE for k in range(RATE // 2)]
    assert readings[0] == (10**9, LEGS[0], first)


def test_a_recorded_walk_is_analyzed_as_a_trial(tmp_path):
    """The rear legs a quarter of a stride ahead: the wheels half a step apart, in step."""
    trial, _ = read_trial(write_walk(tmp_path / 'walk', namespace='/xrl'))
    assert trial.status.synchronized
    assert trial.status.phase == pytest.approx(0.5, abs=0.05)
    steps = 20.0 / PERIOD * 2.0
    assert len(trial.footfalls) == pytest.approx(2.0 * steps, abs=8.0)


def test_one_half_is_no_trial_and_the_message_says_so(tmp_path):
    walk = write_walk(tmp_path / 'walk', LEGS[:2])
    with pytest.raises(ValueError, match=r'both legs of both halves .* /front/left_wrench, /front/right_wrench'):
        read_trial(walk)


def test_the_command_tells_of_each_leg_of_a_recording(tmp_path, capsys):
    walk = write_walk(tmp_path / 'walk', LEGS[:2])
    assert main(['legs', str(walk), '--out', str(tmp_path / 'out')]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith('front_left (wrench): 18 heel strikes, stride 1.100')
    assert lines[1].startswith('front_right (wrench): 18 heel strikes')
    head, *rows = (tmp_path / 'out' / 'phases.csv').read_text().splitlines()
    assert head == 'stamp_ns,front_left,front_right,front_wheel,rear_wheel'
    _, left, right, wheel, rear = rows[-1].split(',')
    assert rear == ''
    assert float(wheel) > math.pi
    assert float(left) != float(right)
    assert main(['legs', str(walk), '--out', str(tmp_path / 'out')]) == 2
    assert 'exists already' in capsys.readouterr().err

import math

import numpy as np
import pytest
from legs import person

from dcdrw.cli import main
from dcdrw.recordings.leg_recording import leg_readings, leg_topics, wheel_batches
from dcdrw.recordings.recording import Recording
from dcdrw.suite.parameter_file import TrialParams
from dcdrw.trials.analysis import analyze
from dcdrw.trials.results import read_trial
from dcdrw_control.legs.params import HIPS
from dcdrw_control.legs.samples import LEGS, ContactReading, ImuReading, Leg, WrenchReading
from dcdrw_control.legs.walk import follow
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
        assert [topic.name for topic in leg_topics(recording)] == [f'/xrl/front/left_{kind}']
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


def test_a_walk_is_found_by_its_namespace(tmp_path, capsys):
    walk = write_walk(tmp_path / 'walk', namespace='/xrl', seconds=8.0)
    assert main(['analyze', str(walk), '--namespace', 'xrl']) == 0
    capsys.readouterr()
    for command in ('analyze', 'legs', 'replay'):
        assert main([command, str(walk), '--namespace', '/lab']) == 2
        assert 'in /lab' in capsys.readouterr().err


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


def test_the_command_says_what_is_to_be_known_of_the_recording(tmp_path, capsys):
    walk = write_walk(tmp_path / 'walk', LEGS[:2])
    (walk / 'metadata.yaml').unlink()
    assert main(['legs', str(walk)]) == 0
    assert (
        capsys.readouterr().err
        == f'dcdrw legs: {walk} has no metadata.yaml, so whether files are missing is not known\n'
    )


def test_a_recorded_person_before_a_robot_is_followed_by_estimator_and_monitor_through_the_turn():
    """The robot walks as the person does, a quarter of a stride ahead of it."""
    ahead_ns = 270_000_000
    front = [reading._replace(stamp_ns=reading.stamp_ns + 10**9) for reading in person()]
    rear = [r._replace(stamp_ns=r.stamp_ns - ahead_ns, leg=Leg('rear', r.leg.side)) for r in front]
    readings = sorted(front + rear, key=lambda reading: reading.stamp_ns)
    trial = analyze(wheel_batches(follow(readings).updates), TrialParams())
    assert trial.estimator.restarts == 0
    assert trial.estimator.refused['outlier'] == 0
    assert trial.contradictions == ()  # legs are not braked as wheels are
    assert abs(trial.estimator.front_steps - trial.estimator.rear_steps) <= 1
    walking = (trial.motion.stamp_ns > 4 * 10**9) & (trial.motion.stamp_ns < 33 * 10**9)
    error = trial.motion.error_percent[walking]
    assert np.sqrt(np.mean(error**2)) < 6.0
    assert np.mean(np.abs(error) < 6.0) > 0.9

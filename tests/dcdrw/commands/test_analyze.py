"""`dcdrw analyze`: what the live nodes said, to the last bit, from the recording alone."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionMode

from dcdrw.cli import main
from dcdrw.recordings.bag_file import Stream
from dcdrw.recordings.recording import Recording
from dcdrw.trials.expectation import UNEXPECTED
from dcdrw.trials.results import read_trial
from dcdrw_msgs_py.diagnosis import STEPS_TO_SYNCHRONIZATION
from dcdrw_msgs_py.messages import stamp_ns
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.topics import FOOTFALLS
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.rig.simulator import SimulatorParams
from tests import ROOT
from tests.bags import JOINT_STATE, TYPES, joint_state, write_bag
from tests.trials import STIFF

pytestmark = pytest.mark.processes

NAMES = ('front_wheel', 'rear_wheel', 'coupler')


@pytest.fixture(scope='module')
def motion():
    """30 strikes of a pair that comes into step."""
    rig, start = SimulatorParams(initial_phase_percent=35.0).start(RigParams(k=60.0))
    model = run(rig, start, strikes=30)
    return model, model.at(np.arange(int(model.duration * 200)) / 200)


def messages(motion, names=NAMES, speeds=True):
    """Joint states at 200 Hz, with log times."""
    places = np.column_stack([motion.rotation1, motion.rotation2, motion.coupler_length])
    rates = np.column_stack([motion.omega1, motion.omega2, motion.coupler_rate])
    efforts = np.column_stack([np.full_like(motion.time, np.nan)] * 2 + [motion.coupler_force])
    for k, row in enumerate(places):
        stamp = 10**18 + k * 5_000_000
        yield stamp + 1000, joint_state(stamp, names, row, *([rates[k], efforts[k]] if speeds else []))


def test_live_and_offline_agree_to_the_last_bit(live_trial):
    live = json.loads((live_trial / 'summary.json').read_text())
    trial, agreements = read_trial(live_trial)
    assert agreements.keys() == {'phase_state', 'sync_error', 'sync_error_percent'}
    for recorded, equal in agreements.values():
        assert recorded == equal > 900
    assert trial.status.synchronized
    assert live['synchronized']
    told = live['diagnostics']['sync_monitor']['values'][STEPS_TO_SYNCHRONIZATION]
    assert int(told) == trial.status.steps_to_synchronization
    for wheel in ('front', 'rear'):
        with Recording(live_trial) as recording:
            recorded = [
                stamp_ns(fall.header.stamp)
                for _, _, fall in recording.decoded([Stream(f'/{wheel}_footfalls', FOOTFALLS[wheel].type)])
            ]
        computed = [fall.stamp_ns for fall in trial.footfalls if fall.wheel == wheel]
        assert len(recorded) > 5
        # One of the first can be told before the recorder has found the topic, one of the last after the end.
        assert recorded == [stamp for stamp in computed if recorded[0] <= stamp <= recorded[-1]]


def test_results_are_those_of_the_live_trial(live_trial, tmp_path, capsys):
    assert main(['analyze', str(live_trial), '--out', str(tmp_path / 'again')]) == 0
    output = capsys.readouterr().out
    assert 'to within ±6 % of 50 % of a step' in output
    assert re.search(r'^phase_state: (\d+) of \1 recorded are the same here to the last bit$', output, re.MULTILINE)
    for name in ('samples.csv', 'footfalls.csv', 'trial.png'):
        assert (tmp_path / 'again' / name).read_bytes() == (live_trial / name).read_bytes()
    live, again = (json.loads((folder / 'summary.json').read_text()) for folder in (live_trial, tmp_path / 'again'))
    apart = {'end', 'diagnostics', 'recording', 'parameters'}
    assert {k: v for k, v in again.items() if k not in apart} == {k: v for k, v in live.items() if k not in apart}
    assert again['parameters']['phase'] == live['parameters']['phase']
    assert again['parameters']['rig'] == live['parameters']['rig']


def test_altered_recording_is_found_out(live_trial, tmp_path):
    """One bit in one recorded sample, and all but this one agree."""
    with Recording(live_trial) as recording:
        joints = list(recording.messages([Stream('/joint_states', JOINT_STATE)]))
        phases = [data for _, _, data in recording.messages([Stream('/phase_state', JOINT_STATE)])]
    message = TYPES.deserialize_cdr(phases[500], JOINT_STATE)
    speeds = message.velocity.copy()
    speeds[0] = np.nextafter(speeds[0], np.inf)  # the front wheel's, by its last bit
    changed = TYPES.serialize_cdr(replace(message, velocity=speeds), JOINT_STATE)
    with Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = [
            writer.add_connection(name, JOINT_STATE, typestore=TYPES) for name in ('/joint_states', '/phase_state')
        ]
        for k, (_, log_ns, data) in enumerate(joints):
            writer.write(topics[0], log_ns, data)
            if k < len(phases):
                writer.write(topics[1], log_ns, bytes(changed) if k == 500 else phases[k])
    _, agreements = read_trial(tmp_path / 'bag')
    assert agreements['phase_state'].recorded - agreements['phase_state'].equal == 1


@pytest.mark.parametrize(
    ('storage', 'compression'),
    [(StoragePlugin.MCAP, CompressionMode.STORAGE), (StoragePlugin.SQLITE3, CompressionMode.MESSAGE)],
)
def test_analysis_of_a_simulated_motion_is_its_truth(motion, tmp_path, storage, compression):
    model, samples = motion
    bag = write_bag(tmp_path / 'bag', messages(samples), '/joint_states', storage, compression)
    trial, agreements = read_trial(bag)
    assert not agreements  # the recording holds nothing to compare with
    assert trial.motion.theta1 == pytest.approx(samples.theta1, abs=1e-9)
    assert (trial.motion.coupler_force == samples.coupler_force).all()
    assert [fall.wheel for fall in trial.footfalls] == [('front', 'rear')[s.wheel - 1] for s in model.strikes][
        : len(trial.footfalls)
    ]
    assert len(trial.footfalls) >= 29


def test_joints_of_other_names_are_mapped_by_a_rig_file(motion, tmp_path, capsys):
    bag = write_bag(tmp_path / 'bag', messages(motion[1], ('hub_a', 'hub_b', 'slider')), '/lab/encoders')
    same = write_bag(tmp_path / 'same', messages(motion[1]))
    (tmp_path / 'rig.yaml').write_text(
        'phase_estimator:\n  ros__parameters:\n    front_joint: hub_a\n'
        '    rear_joint: hub_b\n    coupler_joint: slider\n'
    )
    trial, _ = read_trial(bag, rig=tmp_path / 'rig.yaml', topic='encoders')
    expected, _ = read_trial(same)
    assert all(one.tobytes() == other.tobytes() for one, other in zip(trial.motion, expected.motion, strict=True))
    assert main(['analyze', str(bag)]) == 2
    assert 'no topic joint_states' in capsys.readouterr().err
    assert main(['analyze', str(bag), '--topic', 'encoders']) == 2
    errors = capsys.readouterr().err
    assert 'joint front_wheel is missing; the message names hub_a, hub_b, slider (front_joint and rear_joint' in errors
    assert errors.count('\n') == 1


def test_speeds_are_derived_where_none_are_recorded(motion, tmp_path):
    trial, _ = read_trial(write_bag(tmp_path / 'bag', messages(motion[1], speeds=False)))
    assert np.isnan(trial.motion.coupler_force).all()
    assert trial.motion.theta1 == pytest.approx(motion[1].theta1, abs=1e-9)
    assert np.nanmedian(np.abs(trial.motion.omega1 - motion[1].omega1)) < 0.03


def is_alive(pid: int) -> bool:
    """Whether a process still holds what it had open."""
    try:
        return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0] not in 'ZX'
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_killed_trial_is_analyzed_up_to_its_last_second(tmp_path):
    (tmp_path / 'rig.yaml').write_text(STIFF)
    process = subprocess.Popen(
        [sys.executable, '-m', 'dcdrw.cli', 'trial', '--rig', 'rig.yaml', '--seconds', '600', '--out', 'out'],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        for line in process.stdout:
            if '  2.' in line or '  3.' in line:
                break
        children = Path(f'/proc/{process.pid}/task/{process.pid}/children').read_text().split()
        killed_ns = time.time_ns()
        killed = [process.pid, *map(int, children)]
        for pid in killed:
            os.kill(pid, signal.SIGKILL)
        process.wait()
        while any(map(is_alive, killed)):  # the lock on the file goes with the recorder
            time.sleep(0.01)
    trial, agreements = read_trial(tmp_path / 'out')
    assert killed_ns - trial.motion.stamp_ns[-1] < 1e9
    assert trial.motion.seconds[-1] > 1.0
    assert trial.params.rig.k == 60.0  # as recorded
    recorded, equal = agreements['phase_state']
    assert recorded == equal > 20


def test_several_recordings_get_a_folder_each(motion, tmp_path, capsys):
    one, two = (write_bag(tmp_path / name, messages(motion[1])) for name in ('one', 'two'))
    assert main(['analyze', str(one), str(two), '--out', str(tmp_path / 'out')]) == 0
    assert f'{two}: From 35.0 % to within' in capsys.readouterr().out
    assert {path.name for path in (tmp_path / 'out' / 'two').iterdir()} == {
        'summary.json',
        'samples.csv',
        'footfalls.csv',
        'trial.png',
    }
    assert main(['analyze', str(one), str(two), '--out', str(tmp_path / 'out')]) == 2
    assert 'exists already, not overwriting' in capsys.readouterr().err
    shutil.copytree(one, tmp_path / 'other' / 'one')
    assert main(['analyze', str(one), str(tmp_path / 'other' / 'one'), '--out', str(tmp_path / 'more')]) == 2
    assert 'several recordings are called one' in capsys.readouterr().err


def test_analysis_needs_no_ros(motion, tmp_path):
    write_bag(tmp_path / 'bag', messages(motion[1]))
    code = (
        'import sys; sys.modules["rclpy"] = sys.modules["builtin_interfaces"] = None; '
        'from dcdrw.cli import main; sys.exit(main(["analyze", "bag"]))'
    )
    done = subprocess.run(
        [sys.executable, '-c', code],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith('From 35.0 %')


def test_the_verdict_for_a_program_and_as_a_status(tmp_path, capsys, motion):
    write_bag(tmp_path / 'bag', messages(motion[1]))
    assert main(['analyze', '--json=-', '--expect', 'synchronized', str(tmp_path / 'bag')]) == 0
    assert json.loads(capsys.readouterr().out)['state'] == 'synchronized'
    assert main(['analyze', '--expect', 'stalled', str(tmp_path / 'bag')]) == UNEXPECTED
    assert main(['analyze', '--json', str(tmp_path / 'both.json'), *[str(tmp_path / 'bag')] * 2]) == 0
    assert [one['state'] for one in json.loads((tmp_path / 'both.json').read_text())] == ['synchronized'] * 2


@pytest.mark.parametrize(
    ('count', 'words'), [(1, 'Not run: a single joint state'), (2, 'Too little to judge: 0 steps')]
)
def test_a_recording_of_too_few_samples_is_not_judged(count, words, tmp_path, capsys, motion):
    write_bag(tmp_path / 'bag', list(messages(motion[1]))[:count])
    assert main(['analyze', '--expect', 'converging', str(tmp_path / 'bag')]) == 1
    assert capsys.readouterr().out.startswith(words)

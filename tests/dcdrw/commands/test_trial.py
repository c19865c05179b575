"""`dcdrw trial` as a user runs it: real processes, real DDS."""

import csv
import json
import math
import os
import resource
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from dcdrw.cli import main
from dcdrw.commands.trial import simulated_joints
from dcdrw.recordings.recording import Recording
from dcdrw.trials.figure import ACTS_LABEL, trial_figure
from dcdrw.trials.results import read_trial
from dcdrw_msgs_py.diagnosis import STATE, STEPS_TO_SYNCHRONIZATION, PairState
from dcdrw_msgs_py.topics import COUPLER_WRENCH, ENABLE, PERSON_FORCE, REAR_TORQUE_COMMAND, SYNCHRONIZER_STATE
from dcdrw_tracker.gait.phase import PhaseParams
from tests import ROOT
from tests.children import nodes, runs
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

STIFF = """\
/**:
  ros__parameters:
    k: 60
    rate: 200
"""


MUTE = """\
from dcdrw_msgs_py import messages

def mute(node, diagnosis, now_ns, write=messages.diagnostics_message):
    return write(node, diagnosis._replace(message='?'), now_ns)

messages.diagnostics_message = mute
"""
"""Read by each Python process before all else: every message on /diagnostics says the same."""


def start(tmp_path: Path, *arguments: str, rig: str = STIFF, path: Path = ROOT) -> subprocess.Popen[str]:
    (tmp_path / 'rig.yaml').write_text(rig)
    return subprocess.Popen(
        [sys.executable, '-m', 'dcdrw.cli', 'trial', '--rig', 'rig.yaml', '--out', 'out', *arguments],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': f'{path}:{ROOT}'},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for_motion(process: subprocess.Popen[str]) -> None:
    """Wait until the trial shows that the wheels roll."""
    for line in process.stdout:
        if 'strikes' in line and 'strikes 0 + 0' not in line:
            return
    raise AssertionError(process.communicate()[1])


def summary(tmp_path: Path) -> dict:
    return json.loads((tmp_path / 'out' / 'summary.json').read_text())


def test_trial_ends_with_summary_picture_and_sentence(tmp_path):
    process = start(tmp_path, '--initial-phase', '30', '--seconds', '6')
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    result = summary(tmp_path)
    assert result['end'] == 'complete'
    assert result['synchronized']
    assert result['initial_phase_percent'] == pytest.approx(30.0, abs=0.01)
    # More where the machine is busy at the end; the recorder may not have heard the very last samples.
    assert result['duration_s'] > 5.9
    assert 0 < result['steps_to_synchronization'] < 8
    # The monitor of the trial and the one that judges its record are one.
    said = result['diagnostics']['sync_monitor']['values']
    assert said[STATE] == result['state'] == PairState.SYNCHRONIZED
    assert int(said[STEPS_TO_SYNCHRONIZATION]) == result['steps_to_synchronization']
    assert result['parameters']['rig']['k'] == 60.0
    low, high = result['final_band_percent']
    assert -7.0 < low < high < 7.0
    assert f'in {result["steps_to_synchronization"]} steps' in output
    assert (tmp_path / 'out' / 'trial.png').read_bytes().startswith(b'\x89PNG')
    rows = list(csv.DictReader((tmp_path / 'out' / 'samples.csv').read_text().splitlines()))
    assert len(rows) == result['samples']['phase_state'] > 0.9 * 1200
    assert all(abs(float(row['theta1'])) <= math.pi / 12 + 1e-9 for row in rows)
    for name in ('simulator', 'phase_estimator', 'sync_monitor', 'recorder'):
        assert 'Traceback' not in (tmp_path / 'out' / f'{name}.log').read_text()


def test_a_person_s_trial_is_run_closed_loop_and_tells_the_force_on_the_person(tmp_path):
    rig = '/**:\n  ros__parameters:\n    k: 16\n    b: 10\n    rate: 200\n'
    process = start(tmp_path, '--person', '--seconds', '5', rig=rig)
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    force = summary(tmp_path)['person_force']
    assert 0.0 < force['rms'] < force['peak'] < 20.0
    assert f'On the person: {force["peak"]:.1f} N at most' in output
    assert 'active' in (tmp_path / 'out' / 'synchronizer.log').read_text()
    with Recording(tmp_path / 'out') as recording:
        recorded = [SYNCHRONIZER_STATE, REAR_TORQUE_COMMAND, COUPLER_WRENCH, PERSON_FORCE, ENABLE]
        assert all(recording.count(recording.find(topic.name, topic.type)) for topic in recorded)
        told = recording.count(recording.find(SYNCHRONIZER_STATE.name, SYNCHRONIZER_STATE.type))
    trial, _ = read_trial(tmp_path / 'out')
    assert force['peak'] == np.abs(trial.motion.coupler_force).max(), 'as the picture says'
    assert told > len(trial.acts), 'what it does is told again and again, lest a lost message hide a fault'
    assert all(act != other for (_, act), (_, other) in pairwise(trial.acts))
    (begins, _), *_ = [act for act in trial.acts if act[1] == 'active']
    assert -1.0 < (begins - trial.start_ns) / 1e9 < 5.0  # it is enabled when the wheels have been let go
    panels = [axes.get_ylabel() for axes in trial_figure(trial, '').axes]
    assert ACTS_LABEL in panels


def test_no_sentence_is_protocol(tmp_path):
    """Whatever the nodes say to people, a trial starts, ends and is judged by the values beside it."""
    (tmp_path / 'sitecustomize.py').write_text(MUTE)
    process = start(tmp_path, '--initial-phase', '30', '--seconds', '6', path=tmp_path)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    result = summary(tmp_path)
    assert {said['message'] for said in result['diagnostics'].values()} == {'?'}
    assert result['state'] == PairState.SYNCHRONIZED
    assert result['end'] == 'complete'


def test_interrupt_keeps_what_there_is(tmp_path):
    process = start(tmp_path, '--seconds', '600')
    wait_for_motion(process)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert 'Traceback' not in errors
    assert summary(tmp_path)['end'] == 'interrupted'
    assert (tmp_path / 'out' / 'trial.png').exists()
    assert (tmp_path / 'out' / 'recording' / 'metadata.yaml').exists()


def test_dead_node_ends_the_trial_with_the_reason(tmp_path):
    process = start(tmp_path, '--seconds', '600')
    wait_for_motion(process)
    (node,) = nodes(process.pid, 'phase_estimator')
    os.kill(node, signal.SIGKILL)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert 'phase_estimator was killed by SIGKILL' in errors
    assert summary(tmp_path)['end'].startswith('phase_estimator was killed')
    assert (tmp_path / 'out' / 'samples.csv').stat().st_size > 2000


def test_full_disk_ends_the_trial_and_keeps_what_is_there(tmp_path):
    process = start(tmp_path, '--seconds', '600')
    wait_for_motion(process)
    (node,) = nodes(process.pid, 'recorder')
    size = (tmp_path / 'out' / 'recording' / 'recording_0.mcap').stat().st_size
    resource.prlimit(node, resource.RLIMIT_FSIZE, (size + 100, size + 100))
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert 'dcdrw trial: the recording ended: File too large: out/recording; what came before is kept' in errors
    assert summary(tmp_path)['end'].startswith('the recording ended: File too large')
    assert summary(tmp_path)['samples']['joint_states'] > 0


def test_silence_ends_the_trial_with_the_reason(tmp_path):
    process = start(tmp_path, '--seconds', '600')
    wait_for_motion(process)
    (node,) = nodes(process.pid, 'simulator')
    os.kill(node, signal.SIGSTOP)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert 'no data for 3 s' in errors
    assert summary(tmp_path)['duration_s'] > 0


def test_nodes_end_with_a_trial_that_is_killed(tmp_path):
    process = start(tmp_path, '--seconds', '600')
    wait_for_motion(process)
    started = nodes(process.pid)
    assert len(started) == 4
    process.kill()
    process.communicate()
    end = time.monotonic() + PATIENCE
    while any(map(runs, started)):
        assert time.monotonic() < end, 'orphans live on'
        time.sleep(0.05)


def test_stalled_rig_is_said_to_stall(tmp_path):
    (tmp_path / 'out').mkdir()  # empty: may be used
    process = start(tmp_path, '--seconds', '7', rig=f'{STIFF}    omega1: 0.2\n    omega2: 0.2\n')
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    assert summary(tmp_path)['stalled'] == ['front', 'rear']
    assert 'stalled after' in output


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['--rig', 'nowhere.yaml'], 'nowhere.yaml'),
        (['--rig', 'broken.yaml'], 'broken.yaml is not YAML'),
        (['--rig', 'list.yaml'], 'list.yaml is not a parameter file'),
        (['--rig', 'typo.yaml'], 'sloop is not a parameter (typo.yaml); did you mean slope?'),
        (['--rig', 'gentle.yaml'], 'is too gentle'),
        (['--rig', 'stranger.yaml'], 'stranger.yaml has parameters for simulater, which no trial has'),
        (['--rig', 'clock.yaml'], 'a trial runs in real time: publish_clock must be false'),
        (['--initial-phase', '120'], 'initial_phase_percent must be'),
        (['--out', 'full'], 'full exists already, not overwriting'),
    ],
)
def test_wrong_input_is_told_in_one_line(tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    Path('broken.yaml').write_text('a: [')
    Path('list.yaml').write_text('- 1')
    Path('typo.yaml').write_text('/**:\n  ros__parameters:\n    sloop: 0.03\n')
    Path('gentle.yaml').write_text('/**:\n  ros__parameters:\n    slope: 0.001\n')
    Path('stranger.yaml').write_text('simulater:\n  ros__parameters:\n    k: 3\n')
    Path('clock.yaml').write_text('/**:\n  ros__parameters:\n    publish_clock: true\n')
    Path('full').mkdir()
    Path('full/summary.json').write_text('{}')
    assert main(['trial', *arguments]) == 2
    errors = capsys.readouterr().err
    assert message in errors
    assert errors.count('\n') == 1
    assert not Path('trials').exists()


def test_a_rig_file_tells_the_estimator_nothing_of_encoders_that_a_simulator_does_not_have():
    mine = PhaseParams(unit='deg', front_sign=-1, rear_zero=0.3, front_joint='hub', hysteresis_deg=2.0)
    assert simulated_joints(mine) == PhaseParams(hysteresis_deg=2.0)

"""`dcdrw trial --camera`: the whole chain over real DDS, its joint states seen in pictures."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from dcdrw.cli import main

pytest.importorskip('cv2')
from tests import ROOT
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

RIG = """\
/**:
  ros__parameters: {k: 60.0, rate: 200.0, size: 0.3}
virtual_camera:
  ros__parameters: {image_width: 480, image_height: 270, frame_rate: 30.0}
"""


def test_a_filmed_trial_is_the_simulated_one(tmp_path):
    (tmp_path / 'rig.yaml').write_text(RIG)
    done = subprocess.run(
        [
            sys.executable,
            '-m',
            'dcdrw.cli',
            'trial',
            '--camera',
            '--rig',
            'rig.yaml',
            '--initial-phase',
            '35',
            '--seconds',
            '4',
            '--out',
            'out',
        ],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Against the simulator's own joint states, φ is 0." in done.stdout
    result = json.loads((tmp_path / 'out' / 'summary.json').read_text())
    assert result['end'] == 'complete'
    assert result['truth']['phi_deg'] < 0.3
    assert result['truth']['frames'] == result['samples']['joint_states'] > 20
    assert result['initial_phase_percent'] == pytest.approx(35.0, abs=1.0)
    assert result['duration_s'] == pytest.approx(4.0, abs=0.5)
    tracker = result['diagnostics']['tag_tracker']  # which warns of what a busy machine made it pass over
    assert 'tracking both wheels' in tracker['message']
    assert result['agreement']['phase_state']['equal'] == result['agreement']['phase_state']['recorded']
    for node in ('simulator', 'virtual_camera', 'tag_tracker', 'phase_estimator', 'sync_monitor', 'recorder'):
        assert 'Traceback' not in (tmp_path / 'out' / f'{node}.log').read_text()


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ('rear.ids: [0]', 'rear.ids: tag 0 is mounted twice'),
        ('camera: nowhere.yaml', 'nowhere.yaml'),
        ('occlude: all', 'occlude must be front, rear, both or empty'),
        ('encoding: rgb8', 'encoding must be mono8 or bgr8'),
    ],
)
def test_what_cannot_be_filmed_is_told_in_one_line(tmp_path, monkeypatch, capsys, values, message):
    monkeypatch.chdir(tmp_path)
    Path('rig.yaml').write_text(f'virtual_camera:\n  ros__parameters: {{{values}}}\n')
    assert main(['trial', '--camera', '--rig', 'rig.yaml', '--out', 'out']) == 2
    errors = capsys.readouterr().err
    assert message in errors
    assert errors.count('\n') == 1
    assert not Path('out').exists()

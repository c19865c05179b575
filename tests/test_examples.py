"""Every example and every tutorial runs, and what it claims is so."""

import os
import subprocess
import sys

import pytest

from dcdrw_msgs_py.topics import COUPLER_FORCE_COMMAND, SYNC_ERROR_PERCENT
from tests import ROOT

pytestmark = pytest.mark.processes
EXAMPLES = sorted((*(ROOT / 'examples').glob('*.py'), *(ROOT / 'docs' / 'tutorials').glob('*.py')))
WITH_ROS = ROOT / 'examples' / 'phase_controller.py'
ENVIRONMENT = {**os.environ, 'PYTHONPATH': str(ROOT)}


@pytest.mark.parametrize('path', [path for path in EXAMPLES if path != WITH_ROS], ids=lambda path: path.stem)
def test_example_runs(path, tmp_path):
    done = subprocess.run([sys.executable, path], cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout
    assert not done.stderr


def test_the_controllers_force_follows_the_error_within_its_limit(bench):
    errors, commands = bench.hear(SYNC_ERROR_PERCENT), bench.hear(COUPLER_FORCE_COMMAND)
    for name, parameters in (
        ('sync_monitor', {}), ('phase_estimator', {}), ('simulator', {'initial_phase_percent': 30.0})
    ):  # fmt: skip
        bench.start(name, **parameters)
    environment = {**ENVIRONMENT, 'ROS_DOMAIN_ID': str(bench.domain)}
    process = subprocess.Popen([sys.executable, WITH_ROS], env=environment)
    bench.processes.append(process)

    def answered():
        answers = {max(-20.0, min(20.0, 1.5 * error.data)) for error in errors}
        return len(answers & {command.data for command in commands}) > 50

    bench.wait(answered, 'fifty answers')
    assert {abs(command.data) <= 20.0 for command in commands} == {True}

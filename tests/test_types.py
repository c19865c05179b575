"""What is not physics does not pass the type checker."""

import subprocess
import sys

import pytest

from tests import ROOT

pytest.importorskip('mypy')

WRONG = """
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.dynamics import State, hub_distance
from dcdrw_sim.model.rigs import take
hub_distance(RigParams(), State('a', None, [], {}), None)
take(42, 'which')
"""
RIGHT = """
import numpy as np
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.dynamics import State, hub_distance
from dcdrw_sim.model.rigs import take
from dcdrw_sim.motion.ensemble import spread
hub_distance(RigParams(), State(0.0, 1.0, 0.1, 1.0), 1.0)
hub_distance(RigParams(), State(*np.zeros((4, 9))), np.ones(9))
take(spread(RigParams(), 9, {}), np.arange(3))
"""


def check(tmp_path, code):
    path = tmp_path / 'snippet.py'
    path.write_text(code)
    done = subprocess.run(
        [sys.executable, '-m', 'mypy', '--strict', '--allow-subclassing-any', str(path)],  # numba has no types
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout


def test_what_is_no_state_and_what_is_no_rig_are_errors(tmp_path):
    told = check(tmp_path, WRONG)
    assert 'snippet.py:5: error: Argument 1 to "State"' in told
    assert 'snippet.py:5: error: Argument 3 to "hub_distance"' in told
    assert 'snippet.py:6: error: Argument 1 to "take"' in told
    assert 'snippet.py:6: error: Argument 2 to "take"' in told


def test_numbers_and_arrays_are_not(tmp_path):
    assert check(tmp_path, RIGHT).startswith('Success')

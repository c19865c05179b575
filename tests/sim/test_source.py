"""What is kept, kernels and sweeps, is not used again when what it depends on has changed."""

import os
import shutil
import subprocess
import sys

import pytest

from dcdrw.commands.figures import COMPUTES
from dcdrw_sim.motion.compiled import AVAILABLE
from dcdrw_sim.source import fingerprint
from tests import ROOT

RUN = """
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.motion.ensemble import run_ensemble
motions = run_ensemble(RigParams(), [[-0.2, 1.1, 0.1, 1.0]], 2.0, 9, strict=False)
print(motions.ends.tolist(), motions.strikes['t'].tolist())
"""


@pytest.fixture
def tree(tmp_path):
    """A copy of the model, to change."""
    for package in ('dcdrw_msgs_py', 'dcdrw_sim'):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns('__pycache__'))
    return tmp_path


def python(tree, code):
    environment = os.environ | {'NUMBA_CACHE_DIR': str(tree / 'cache'), 'PYTHONDONTWRITEBYTECODE': '1'}
    return subprocess.check_output([sys.executable, '-W', 'error', '-c', code], cwd=tree, env=environment, text=True)


def kernels(tree):
    return {path: path.stat().st_mtime_ns for path in (tree / 'cache').rglob('*.nb?')}


def change(tree, path, old, new):
    text = (tree / path).read_text()
    assert old in text
    (tree / path).write_text(text.replace(old, new))


@pytest.mark.skipif(not AVAILABLE, reason='without numba nothing is compiled, and so nothing kept')
def test_kernels_are_found_again_until_a_constant_that_they_freeze_changes(tree):
    result = python(tree, RUN)
    assert result.startswith('[0]')
    kept = kernels(tree)
    assert kept
    assert python(tree, RUN) == result
    assert kernels(tree) == kept
    change(tree, 'dcdrw_sim/motion/ends.py', 'SHORTEST_STEP = 1e-9', 'SHORTEST_STEP = 10.0')
    assert python(tree, RUN).startswith('[-2]')  # too fast to follow


@pytest.mark.parametrize(
    ('path', 'old', 'new'),
    [
        ('dcdrw_msgs_py/rig.py', '= 5.25', '= 5.5'),
        ('dcdrw_msgs_py/rolling.py', 'S0 + 0.5 * step_length', 'S0 + 0.6 * step_length'),
        ('dcdrw_msgs_py/quantity.py', 'math.isfinite(value)', 'value < math.inf'),
        ('dcdrw_sim/model/wheel.py', 'wheel.mass * wheel.length**2', 'wheel.mass * wheel.length**3'),
        ('dcdrw_sim/motion/ends.py', 'STALL_TIME = 50.0', 'STALL_TIME = 51.0'),
        ('dcdrw_sim/map/limit_cycles.py', 'LIMIT = 30', 'LIMIT = 31'),
    ],
)
def test_a_rule_that_changes_changes_the_key_of_sweeps(tree, path, old, new):
    code = f'from dcdrw_sim.source import fingerprint; print(fingerprint(*{COMPUTES!r}))'
    assert python(tree, code).strip() == fingerprint(*COMPUTES)
    change(tree, path, old, new)
    assert python(tree, code).strip() != fingerprint(*COMPUTES)

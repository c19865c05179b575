import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

from dcdrw_msgs_py.quantity import fields, flatten
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.map.variation import motion_derivative
from dcdrw_sim.model.rigs import rig_at, take
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.ensemble import run_ensemble, spread
from dcdrw_sim.motion.trajectory import run
from tests import ROOT
from tests.sim.rigs import REAL, UNEQUAL

BEGUN = start(REAL, 0.3)
SECONDS = 1.5


def changed(name):
    """The rig with one parameter a little larger; of spokes a little fewer, so that no leg is beyond its guard."""
    value = flatten(BEGUN.rig)[name]
    change = 1e-3 * max(abs(value), 1.0)
    return spread(BEGUN.rig, 1, {name: value - change if name.endswith('spokes') else value + change})


@pytest.mark.parametrize('name', [field.name for field in fields(RigParams)])
def test_every_parameter_moves_both_steppers_alike_and_the_derivative(name):
    rig = rig_at(changed(name), 0)
    base, moved = (run(each, BEGUN.state, SECONDS) for each in (BEGUN.rig, rig))
    together = run_ensemble(rig, [BEGUN.state], SECONDS, 50)
    count = together.counts[0]
    assert together.strikes['t'][0, :count] == pytest.approx([strike.t for strike in moved.strikes], abs=1e-9)
    assert max(abs(a.t - b.t) for a, b in zip(base.strikes, moved.strikes, strict=True)) > 1e-6
    change = motion_derivative(rig, moved.segments) - motion_derivative(BEGUN.rig, base.segments)
    assert abs(change).max() > 1e-6


def test_what_is_taken_are_the_rigs_at_these_places():
    rigs = spread(UNEQUAL, 3, {'k': [1.0, 2.0, 3.0], 'rear.mass': [7.0, 8.0, 9.0]})
    assert rig_at(take(rigs, np.array([2, 0])), 0) == rig_at(rigs, 2)
    assert rig_at(rigs, 1) == UNEQUAL._replace(k=2.0, rear=UNEQUAL.rear._replace(mass=8.0)).resolved()


def test_a_parameter_that_no_equation_knows_is_refused(tmp_path):
    for package in ('dcdrw_msgs_py', 'dcdrw_sim'):
        shutil.copytree(ROOT / package, tmp_path / package)
    declared = tmp_path / 'dcdrw_msgs_py' / 'rig.py'
    text, count = re.subn(
        r'(class WheelParams.*?length: Length = [^\n]*\n)',
        r"\1    flex: Annotated[float, Quantity('of a spoke', 'm')] = 0.0\n",
        declared.read_text(),
        flags=re.DOTALL,
    )
    assert count == 1
    declared.write_text(text)
    for module in ('motion.pair', 'motion.ensemble', 'motion.cases', 'map.variation', 'study.points', 'rig.simulator'):
        done = subprocess.run(
            [sys.executable, '-c', f'import dcdrw_sim.{module}'],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 1
        assert 'WheelParams declares, or lacks, flex, which no equation knows' in done.stderr

import math

import pytest

from dcdrw_msgs_py.quantity import check
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.presets import PRESETS, preset
from dcdrw_sim.model.scaling import Scales, nondimensional
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.ends import End
from dcdrw_sim.motion.trajectory import run


def test_the_paper_s_rig_is_the_default():
    assert preset('paper') == RigParams()
    assert (preset('paper').k, preset('paper').b, preset('paper').front.length) == (5.25, 100.0, 0.9652)
    assert preset('paper').slope == math.radians(2.0)


def test_the_sweep_has_no_dimensions():
    rig = preset('paper-sweep')
    assert nondimensional(rig.resolved()) == (rig.resolved(), Scales(1.0, 1.0, 1.0))
    assert rig.slope == math.radians(1.75)
    assert 1e-4 <= rig.k <= 1e-2
    assert 0.1 <= rig.b <= 10.0


def test_the_sweep_comes_to_the_fixed_point_of_the_contract_s_table():
    rig = preset('paper-sweep')
    result = run(*start(rig, 0.45), strikes=400)
    before = [strike.state.theta2 for strike in result.strikes if strike.wheel == 1]
    assert result.end is End.STRIKES
    assert math.degrees(before[-1]) == pytest.approx(-0.863, abs=5e-4)


@pytest.mark.parametrize('name', PRESETS)
def test_every_preset_can_roll(name):
    rig = check(preset(name))
    assert PRESETS[name].doc
    assert run(*start(rig, 0.4), strikes=4).end is End.STRIKES


def test_an_unknown_preset_is_answered_with_those_that_there_are():
    with pytest.raises(ValueError, match="no preset is named 'papper'; there are paper, paper-sweep"):
        preset('papper')

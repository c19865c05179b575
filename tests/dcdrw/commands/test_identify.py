"""`dcdrw identify`: from a recording and what is known of a rig to a rig file that every command takes."""

import json
import math

import pytest

from dcdrw.cli import main
from dcdrw.recordings.joint_recording import record_joints
from dcdrw.suite.parameter_file import TrialParams, read_parameter_file, read_uncertainty
from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_msgs_py.samples import SECOND
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams
from dcdrw_tracker.gait.phase import PhaseParams
from tests.drawn import readable_figures

pytest.importorskip('matplotlib')
WHEEL = WheelParams(gyration=0.5, restitution=0.05)
TRUE = RigParams(WHEEL, WHEEL, b=80.0, D0=1.4)
RIG = '/**:\n  ros__parameters: {slope: 0.0349065850, front.mass: 10.0, rear.mass: 10.0}\n'


@pytest.fixture(scope='module')
def identified(tmp_path_factory):
    folder = tmp_path_factory.mktemp('identified')
    simulated = SimulatedRig(TRUE, SimulatorParams(rate=60.0, initial_phase_percent=30.0, noise_deg=0.1, seed=2))
    samples = [simulated.read(i / 60, SECOND + round(i / 60 * SECOND)) for i in range(360)]
    record_joints(folder / 'trial', [sample for sample in samples if sample], PhaseParams(), (), {})
    (folder / 'rig.yaml').write_text(RIG)
    arguments = ['identify', folder / 'trial', '--rig', folder / 'rig.yaml', '--fix', 'mass,slope']
    with readable_figures():
        assert main([*map(str, arguments), '--out', str(folder / 'out')]) == 0
    return folder


def test_it_writes_a_rig_with_its_errors(identified):
    found = json.loads((identified / 'out/identification.json').read_text())
    assert found['explained']
    assert found['given'] == ['mass', 'k', 'slope']
    b, drift = found['parameters']['b'], found['combinations']['drift']
    assert b['low'] < 80.0 < b['high']
    assert b['source'] == 'trial'
    assert drift['value'] == pytest.approx(
        5.25 * (1.4 - TRUE.resolved()._replace(D0=math.nan).resolved().D0) / 80.0, rel=0.1
    )
    rig = read_parameter_file(identified / 'out/rig.yaml', TrialParams()).rig
    assert rig.b == pytest.approx(b['value'])
    uncertainty = read_uncertainty(identified / 'out/rig.yaml')
    assert uncertainty.errors['b'] == pytest.approx(b['error'])
    assert uncertainty.errors['slope'] == 0.0
    assert (identified / 'out/identification.png').stat().st_size > 10_000


def test_every_command_takes_its_rig_file(identified, capsys):
    assert main(['urdf', '--rig', str(identified / 'out/rig.yaml')]) == 0
    assert '<robot' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('section', 'message'),
    [
        ('{standard_errors: {bb: 1.0}}', 'bb is nothing that can be uncertain; did you mean b'),
        ('{standard_errors: {b: -1.0}}', 'b must be ≥ 0'),
        ('{standard_error: {b: 1.0}}', 'did you mean standard_errors'),
        ('{standard_errors: {b: 1.0, k: 1.0}, correlations: {k: [1.5]}}', 'must be ≥ -1, ≤ 1'),
        ('{standard_errors: {b: 1.0}, correlations: {k: [0.5]}}', 'k must have a standard error'),
    ],
)
def test_an_uncertainty_that_makes_no_sense_is_refused(tmp_path, capsys, section, message):
    path = tmp_path / 'rig.yaml'
    path.write_text(f'{RIG}uncertainty:\n  ros__parameters: {section}\n')
    assert main(['urdf', '--rig', str(path)]) == 2
    assert message in capsys.readouterr().err


def test_what_cannot_be_fixed_is_told(identified, capsys):
    arguments = ['identify', str(identified / 'trial'), '--rig', str(identified / 'rig.yaml'), '--fix', 'masss']
    assert main(arguments) == 2
    assert 'did you mean mass' in capsys.readouterr().err

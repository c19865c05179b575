"""`dcdrw identify`: from a recording and what is known of a rig to a rig file that every command takes."""

import json
import math

import numpy as np
import pytest

from dcdrw.cli import main
from dcdrw.recordings.joint_recording import record_joints
from dcdrw.suite.parameter_file import TrialParams, read_parameter_file, read_uncertainty
from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_msgs_py.samples import SECOND
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.trajectory import run
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


def table(path, trial, heading='time,psi1_deg,note,psi2_deg'):
    """Samples of a trial as a logger of encoders writes them."""
    lines = [
        f'{time},{math.degrees(front) if front == front else ""},x,{math.degrees(rear)}'
        for time, (front, rear) in trial
    ]
    path.write_text('\n'.join([heading, *lines, '']))
    return ['identify', str(path), '--rig', str(path.parent / 'rig.yaml'), '--fix', 'mass,slope,gyration,restitution']


def test_a_table_of_encoders_with_gaps_is_taken(tmp_path, capsys):
    (tmp_path / 'rig.yaml').write_text(RIG)
    rig = RigParams(b=80.0)
    motion = run(*start(rig, 0.3), 3.0)
    times = np.arange(0.0, 3.0, 1 / 60)
    seen = motion.at(times)
    psi = np.column_stack([seen.rotation1, seen.rotation2]) + np.random.default_rng(1).normal(
        0.0, 1e-3, (len(times), 2)
    )
    psi[60:70, 0] = math.nan
    arguments = table(tmp_path / 'encoders.csv', zip(times.tolist(), psi.tolist(), strict=True))
    assert main([*arguments, '--json']) == 0
    found = json.loads(capsys.readouterr().out)['parameters']['b']
    assert found['low'] < 80.0 < found['high']


@pytest.mark.parametrize(
    ('heading', 'rows', 'message'),
    [
        ('time,front,x,rear', [(0.0, (0.0, 0.0))], 'must have columns time, psi1, psi2'),
        ('time,psi1,x,psi2', [(1.0, (0.0, 0.0)), (0.5, (0.0, 0.0))], 'line 3: time must go on'),
        ('time,psi1,psi2,x', [(1.0, (0.0, 0.0))], "line 2: 'x' is not a number"),
        ('time,psi1,x,psi2', [], 'has no samples'),
    ],
)
def test_what_is_no_table_of_encoders_is_told(tmp_path, capsys, heading, rows, message):
    (tmp_path / 'rig.yaml').write_text(RIG)
    assert main(table(tmp_path / 'encoders.csv', rows, heading)) == 2
    assert message in capsys.readouterr().err


def test_what_cannot_be_fixed_is_told(identified, capsys):
    arguments = ['identify', str(identified / 'trial'), '--rig', str(identified / 'rig.yaml'), '--fix', 'masss']
    assert main(arguments) == 2
    assert 'did you mean mass' in capsys.readouterr().err

"""`dcdrw film`: the video shows what its ground truth says, and the truth is the simulation's."""

import csv
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from dcdrw.cli import main
from dcdrw.suite.parameter_file import read_parameter_file
from dcdrw.trials.shots import CODECS, FilmParams
from dcdrw_msgs_py.camera import read_camera
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import JointSample, Turn
from dcdrw_msgs_py.tagging import TagParams
from dcdrw_sim.camera.render import LookParams, Renderer
from dcdrw_sim.camera.scene import Footing, SceneParams, ViewParams
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.rig.simulator import SimulatorParams
from tests import ROOT
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

cv2 = pytest.importorskip('cv2')

SMALL = ['--image-width', '320', '--image-height', '180', '--fps', '30']


def rows(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def frames(path: Path) -> list[np.ndarray]:
    video, result = cv2.VideoCapture(str(path)), []
    while (read := video.read())[0]:
        result.append(read[1])
    return result


@pytest.fixture(scope='module')
def film(tmp_path_factory):
    """Three seconds without loss; the rig is not the default one."""
    folder = tmp_path_factory.mktemp('film')
    (folder / 'rig.yaml').write_text(
        '/**:\n  ros__parameters:\n    front: {length: 1.0, spokes: 10}\n    rear: {length: 0.9}\n    slope: 0.05\n'
        '    size: 0.2\n    front.ids: [7]\n'
    )
    assert (
        main(
            [
                'film',
                '--out',
                str(folder / 'a.mkv'),
                '--rig',
                str(folder / 'rig.yaml'),
                '--seconds',
                '3',
                '--initial-phase',
                '30',
                '--grey',
                '--noise',
                '0',
                '--pan-deg',
                '20',
                '--k1',
                '-0.1',
                *SMALL,
            ]
        )
        == 0
    )
    return folder / 'a.mkv'


def rig_of(film: Path) -> FilmParams:
    return read_parameter_file(film.with_suffix('.rig.yaml'), FilmParams())


def test_truth_is_what_the_simulation_does(film):
    rig, state = SimulatorParams(initial_phase_percent=30.0).start(rig_of(film).rig)
    result = run(rig, state, seconds=3.0)
    truth = rows(film.with_suffix('.csv'))
    assert [int(row['stamp_ns']) for row in truth] == [round(k * 1e9 / 30) for k in range(90)]
    motion = result.at([k / 30 for k in range(90)])
    for name, column in (
        ('psi1', motion.rotation1),
        ('psi2', motion.rotation2),
        ('omega1', motion.omega1),
        ('omega2', motion.omega2),
        ('n', motion.steps1 - motion.steps2),
    ):
        assert [float(row[name]) for row in truth] == pytest.approx(list(column), abs=1e-9)
    phase = motion.rotation1 / (2 * rig.front.alpha) - motion.rotation2 / (2 * rig.rear.alpha)
    assert [float(row['phi']) for row in truth] == pytest.approx(
        list(phase % 1.0 * (rig.front.alpha + rig.rear.alpha)), abs=1e-9
    )


def test_strikes_are_those_of_the_simulation_with_their_feet(film):
    rig, state = SimulatorParams(initial_phase_percent=30.0).start(rig_of(film).rig)
    expected = [strike for strike in run(rig, state, seconds=3.0).strikes if strike.t <= 89 / 30]
    strikes = rows(film.with_suffix('.strikes.csv'))
    assert len(strikes) >= 8
    assert [(row['wheel'], int(row['stamp_ns'])) for row in strikes] == [
        (('front', 'rear')[strike.wheel - 1], round(strike.t * 1e9)) for strike in expected
    ]
    for wheel, start, shape in (('front', rig.S0, rig.front), ('rear', 0.0, rig.rear)):
        mine = [row for row in strikes if row['wheel'] == wheel]
        assert [int(row['steps']) for row in mine] == list(range(1, len(mine) + 1))
        assert [float(row['x']) for row in mine] == pytest.approx(
            [start + (k + 1) * shape.step_length for k in range(len(mine))]
        )


def test_each_frame_shows_its_row(film):
    params, camera = rig_of(film), read_camera(film.with_suffix('.camera.yaml'))
    rig = params.rig
    assert (params.tags.size, params.tags.front.ids) == (0.2, (7,))
    scene = SceneParams(
        *(SceneParams().front._replace(length=wheel.length, spokes=wheel.spokes) for wheel in (rig.front, rig.rear)),
        slope=rig.slope,
    )
    renderer = Renderer(scene, ViewParams(pan_deg=20.0), LookParams(noise=0.0), params.tags, camera, colour=False)
    images, truth = frames(film), rows(film.with_suffix('.csv'))
    assert len(images) == len(truth) == 90
    joints = [
        JointSample(int(row['stamp_ns']), *(Turn(float(row[f'psi{i}']), float(row[f'omega{i}'])) for i in (1, 2)))
        for row in truth
    ]
    footing = Footing(scene, joints[0])
    for k in (0, 1, 45, 89):
        difference = np.abs(images[k][..., 0].astype(int) - renderer.draw(footing, joints[k]))
        assert difference.mean() < 1.5
        assert np.abs(images[k][..., 0].astype(int) - renderer.draw(footing, joints[(k + 5) % 90])).mean() > 3.0


def test_in_the_place_of_lost_frames_the_last_is_repeated_so_that_the_video_keeps_its_time(tmp_path, capsys):
    assert main(['film', '--out', str(tmp_path / 'b.mkv'), '--seconds', '2', '--drop', '30', *SMALL]) == 0
    stamps = [int(row['stamp_ns']) for row in rows(tmp_path / 'b.stamps.csv')]
    taken = [int(row['stamp_ns']) for row in rows(tmp_path / 'b.csv')]
    images = frames(tmp_path / 'b.mkv')
    assert len(images) == len(stamps) == 60
    assert taken == sorted(set(stamps))
    assert 25 < len(taken) < 58
    for k, stamp in enumerate(stamps):
        if stamp in stamps[:k]:
            assert stamp == stamps[k - 1]
            assert np.array_equal(images[k], images[k - 1])
        else:
            assert stamp == pytest.approx(k / 30 * 1e9, abs=1)
    assert f'60 frames, 2.0 s of video, {60 - len(taken)} of them lost' in capsys.readouterr().out


def test_interrupting_keeps_a_valid_film(tmp_path):
    with subprocess.Popen(
        [sys.executable, '-m', 'dcdrw.cli', 'film', '--out', 'c.mp4', '--seconds', '3000', *SMALL],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, 'PYTHONPATH': f'{ROOT}:{os.environ.get("PYTHONPATH", "")}'},
    ) as process:
        end = time.monotonic() + PATIENCE
        while process.poll() is None and not any(path.stat().st_size > 100_000 for path in tmp_path.glob('.c.*.mp4')):
            if time.monotonic() > end:
                process.kill()
            time.sleep(0.05)
        assert not (tmp_path / 'c.mp4').exists()
        process.send_signal(signal.SIGINT)
        said, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert '; interrupted. Written: c.mp4' in said
    assert 'Traceback' not in errors
    assert len(frames(tmp_path / 'c.mp4')) == len(rows(tmp_path / 'c.csv')) > 10
    assert not (tmp_path / 'c.stamps.csv').exists()


def test_a_motion_that_cannot_go_on_ends_the_film_and_says_why(tmp_path, capsys):
    # On one foothold, the rear wheel the faster: its hub meets the other's.
    (tmp_path / 'rig.yaml').write_text(
        '/**:\n  ros__parameters: {S0: 0.0, k: 0.0, b: 0.0, theta1: 0.0, omega1: 1.0, theta2: -0.1, omega2: 2.0}\n'
    )
    assert (
        main(['film', '--out', str(tmp_path / 'd.mp4'), '--rig', str(tmp_path / 'rig.yaml'), '--seconds', '4', *SMALL])
        == 1
    )
    assert '; ended at 0.' in (said := capsys.readouterr().out)
    assert 'the hubs met' in said
    assert 0 < len(frames(tmp_path / 'd.mp4')) == len(rows(tmp_path / 'd.csv')) < 120


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['--out', 'there.mp4'], 'there.mp4 exists already, not overwriting'),
        (['--out', 'beside.mp4'], 'beside.csv exists already, not overwriting'),
        (['--out', 'film.gif'], '--out must end in .mp4, .avi, .mkv, got film.gif'),
        (['--out', 'no/such/film.mp4'], 'no/such is not a folder'),
        (['--out', 'film.mp4', '--drop', '100'], '--drop must be ≥ 0 and < 100 %'),
        (['--out', 'film.mp4', '--distance', '0'], 'distance must be > 0, ≤ 1000 m, got 0.0'),
        (['--out', 'film.mp4', '--occlude', 'all'], 'occlude must be front, rear, both or empty'),
        (['--out', 'film.mp4', '--camera', 'lens.yaml'], 'lens.yaml'),
        (['--out', 'film.mp4', '--rig', 'rig.yaml'], 'rear.ids: tag 0 is mounted twice'),
        (['--out', 'film.mp4', '--initial-phase', '120'], 'initial_phase_percent must be'),
    ],
)
def test_wrong_input_is_told_in_one_line_and_leaves_nothing(tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    for name in ('there.mp4', 'beside.csv'):
        Path(name).write_text('')
    Path('rig.yaml').write_text('/**:\n  ros__parameters: {rear.ids: [0]}\n')
    assert main(['film', '--seconds', '1', *arguments]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith('dcdrw film: ')
    assert message in lines[0]
    assert {path.name for path in tmp_path.iterdir()} == {'there.mp4', 'beside.csv', 'rig.yaml'}


def test_a_codec_that_is_not_there_is_told(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(CODECS, '.mkv', 'ZZZZ')
    assert main(['film', '--out', str(tmp_path / 'e.mkv'), '--seconds', '1', *SMALL]) == 2
    assert 'does not write ZZZZ into' in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_rig_file_of_a_film_is_the_rig(film):
    rig = rig_of(film).rig
    expected = RigParams()
    assert rig.front == expected.front._replace(length=1.0, spokes=10.0)
    assert math.isnan(rig.S0)
    assert TagParams().family in film.with_suffix('.rig.yaml').read_text()
    assert '&' not in film.with_suffix('.rig.yaml').read_text(), "ROS's own reader knows no YAML aliases"


def test_options_are_the_parameters(capsys):
    with pytest.raises(SystemExit):
        main(['film', '--help'])
    text = ' '.join(capsys.readouterr().out.split())
    for option in ('--distance', '--pan-deg', '--no-follow', '--exposure', '--blur-px', '--noise', '--occlude-from'):
        assert option in text
    assert 'level distance from the middle between the wheels' in text

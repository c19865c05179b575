"""`dcdrw track`: what comes of a video is what was filmed, and the same as a live trial's."""

import csv
import json
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
from dcdrw.trials.filmed import TrackedVideo
from dcdrw_msgs_py.camera import read_camera, write_camera
from dcdrw_msgs_py.samples import SECOND
from tests import ROOT
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

cv2 = pytest.importorskip('cv2')

RIG = '/**:\n  ros__parameters: {size: 0.3, k: 60.0}\n'
SMALL = ['--image-width', '640', '--image-height', '360', '--fps', '30', '--grey', '--quiet']
SECONDS = 4


def make_film(folder, name, *options):
    (folder / 'given.yaml').write_text(RIG)
    assert (
        main(
            [
                'film',
                '--out',
                str(folder / name),
                '--rig',
                str(folder / 'given.yaml'),
                '--initial-phase',
                '35',
                '--seconds',
                str(SECONDS),
                *SMALL,
                *options,
            ]
        )
        == 0
    )
    return folder / name


@pytest.fixture(scope='module')
def film(tmp_path_factory):
    return make_film(tmp_path_factory.mktemp('track'), 'film.mp4')


def track(film, out, *more):
    return main(
        [
            'track',
            str(film),
            '--camera',
            str(film.with_suffix('.camera.yaml')),
            '--rig',
            str(film.with_suffix('.rig.yaml')),
            '--out',
            str(out),
            '--quiet',
            *more,
        ]
    )


def rows(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def column(table, name):
    return np.array([float(row[name]) for row in table])


def check_truth(film, out):
    """Phase, n, speeds and strikes are those of the simulation; returns how many samples there are."""
    samples, truth = rows(out / 'samples.csv'), {row['stamp_ns']: row for row in rows(film.with_suffix('.csv'))}
    truth = [truth[row['stamp_ns']] for row in samples]
    error = column(samples, 'phi') - column(truth, 'phi')
    assert math.degrees(np.sqrt(np.mean(error**2))) < 0.2
    assert np.sqrt(np.mean((column(samples, 'omega1') - column(truth, 'omega1')) ** 2)) < 0.1
    same = column(samples, 'step_difference') == column(truth, 'n')
    assert np.count_nonzero(~same) <= 3, 'but for a sample right at a strike'
    strikes = rows(film.with_suffix('.strikes.csv'))
    for fall in rows(out / 'footfalls.csv'):
        off = [
            int(fall['stamp_ns']) - int(strike['stamp_ns']) for strike in strikes if strike['wheel'] == fall['wheel']
        ]
        assert min(map(abs, off)) < 0.5e9 / 30
    return len(samples)


def test_a_tracked_film_is_the_trial_that_was_filmed(film, tmp_path, capsys):
    assert track(film, tmp_path / 'out', '--debug', str(tmp_path / 'debug.mp4')) == 0
    out = tmp_path / 'out'
    assert check_truth(film, out) == SECONDS * 30 - 2
    result = json.loads((out / 'summary.json').read_text())
    said = capsys.readouterr().out
    assert result['sentence'] in said
    assert f'{SECONDS * 30 - 2} of {SECONDS * 30} frames show both wheels. front: tags of' in said
    assert result['end'] == 'complete'
    assert result['initial_phase_percent'] == pytest.approx(35.0, abs=1.5)
    assert result['parameters']['rig']['k'] == 60.0
    told = result['tracking']
    assert (told['frames'], told['frames_missing'], told['times_the_turns_were_lost']) == (SECONDS * 30, 0, 0)
    assert told['frame_rate_hz'] == pytest.approx(30.0)
    assert told['rear']['hub_travels_as_it_rolls']
    assert 0.0 < told['front']['reprojection_error_px'] < 0.2
    frames = rows(out / 'frames.csv')
    assert len(frames) == SECONDS * 30
    assert frames[0]['psi1'] == ''
    assert all(row['tags1'] == row['tags2'] == '1' for row in frames)
    assert (out / 'trial.png').read_bytes().startswith(b'\x89PNG')
    capsys.readouterr()
    assert main(['analyze', str(out)]) == 0
    assert result['sentence'] in capsys.readouterr().out, 'its recording tells the same'
    assert 'simulator' not in (out / 'recording' / 'parameters.yaml').read_text(), 'it counts as measured'
    debug = cv2.VideoCapture(str(tmp_path / 'debug.mp4'))
    assert debug.get(cv2.CAP_PROP_FRAME_COUNT) == SECONDS * 30
    picture = debug.read()[1].astype(int)
    assert (np.ptp(picture, axis=2) > 80).sum() > 500, 'what is drawn in has colours'


def test_lost_frames_are_gaps_by_the_stamps_beside_the_film(tmp_path):
    film = make_film(tmp_path, 'lossy.avi', '--drop', '20', '--occlude', 'rear', '--occlude-from', '2')
    assert track(film, tmp_path / 'out') == 0
    count = check_truth(film, tmp_path / 'out')
    assert SECONDS * 30 * 0.5 < count < SECONDS * 30 * 0.85
    told = json.loads((tmp_path / 'out' / 'summary.json').read_text())['tracking']
    assert told['frames_missing'] == SECONDS * 30 - told['frames']
    assert told['rear']['frames'] < told['front']['frames']


def test_a_part_of_a_film_is_tracked_by_itself(film, tmp_path):
    assert track(film, tmp_path / 'out', '--from', '1', '--to', '3') == 0
    frames = rows(tmp_path / 'out' / 'frames.csv')
    assert [int(row['stamp_ns']) for row in frames] == [round(k * 1e9 / 30) for k in range(30, 91)]


def test_interrupting_keeps_what_was_tracked(film, tmp_path):
    long = tmp_path / 'long.avi'
    reader, writer = (
        cv2.VideoCapture(str(film)),
        cv2.VideoWriter(str(long), cv2.VideoWriter_fourcc(*'MJPG'), 30.0, (640, 360)),
    )
    images = []
    while (read := reader.read())[0]:
        images.append(read[1])
    for _ in range(4):
        for image in (*images, *images[::-1]):  # to and fro
            writer.write(image)
    writer.release()
    process = subprocess.Popen(
        [
            sys.executable,
            '-m',
            'dcdrw.cli',
            'track',
            str(long),
            '--camera',
            str(film.with_suffix('.camera.yaml')),
            '--rig',
            str(film.with_suffix('.rig.yaml')),
            '--out',
            'out',
            '--debug',
            'debug.avi',
        ],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
    )
    end = time.monotonic() + PATIENCE
    while process.poll() is None and not any(path.stat().st_size > 500_000 for path in tmp_path.glob('.debug.*.avi')):
        if time.monotonic() > end:
            process.kill()
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    said, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert 'Traceback' not in errors
    assert 'Written: out/' in said
    assert json.loads((tmp_path / 'out' / 'summary.json').read_text())['end'] == 'interrupted'
    assert 10 < len(rows(tmp_path / 'out' / 'frames.csv')) < 8 * len(images)


def test_a_verdict_that_rests_on_a_part_of_the_film_is_no_success(film, tmp_path, capsys):
    late = [k * SECOND // 30 + (5 * SECOND if k >= 60 else 0) for k in range(SECONDS * 30)]
    (tmp_path / 'stamps.csv').write_text('\n'.join(['stamp_ns', *map(str, late)]))
    assert track(film, tmp_path / 'out', '--stamps', str(tmp_path / 'stamps.csv')) == 1
    assert 'what came before is left out' in capsys.readouterr().out
    assert json.loads((tmp_path / 'out' / 'summary.json').read_text())['complete'] is False


def test_a_truncated_video_is_told_and_what_came_before_is_kept(film, tmp_path, capsys):
    whole = make_film(tmp_path, 'whole.avi')
    content = whole.read_bytes()
    whole.write_bytes(content[: len(content) // 2])
    assert track(whole, tmp_path / 'out') == 1
    errors = capsys.readouterr().err
    assert f'of {SECONDS * 30} frames: it is truncated; what came before is kept' in errors
    assert errors.count('\n') == 1
    assert len(rows(tmp_path / 'out' / 'frames.csv')) > 30
    assert 'truncated' in json.loads((tmp_path / 'out' / 'summary.json').read_text())['end']


def test_a_truncated_video_that_is_interrupted_as_it_ends_is_told_in_one_line(tmp_path, capsys, monkeypatch):
    whole = make_film(tmp_path, 'whole.avi')
    content = whole.read_bytes()
    whole.write_bytes(content[: len(content) // 2])
    to_its_end = TrackedVideo.track

    def interrupted(film: TrackedVideo):
        for number, frame in enumerate(to_its_end(film), 1):
            yield frame
            if number == last:
                os.kill(os.getpid(), signal.SIGINT)

    assert track(whole, tmp_path / 'first') == 1
    last = len(rows(tmp_path / 'first' / 'frames.csv'))
    capsys.readouterr()
    monkeypatch.setattr(TrackedVideo, 'track', interrupted)
    assert track(whole, tmp_path / 'out') == 130
    errors = capsys.readouterr().err
    assert errors.startswith('dcdrw track: interrupted; ')
    assert 'it is truncated; what came before is kept' in errors
    assert errors.count('\n') == 1


def test_a_hub_that_does_not_travel_is_worth_a_word(film, tmp_path, capsys):
    rig = film.with_suffix('.rig.yaml').read_text().replace('camera_follows: true', 'camera_follows: false')
    (tmp_path / 'rig.yaml').write_text(rig)
    assert track(film, tmp_path / 'out', '--rig', str(tmp_path / 'rig.yaml')) == 0
    errors = capsys.readouterr().err
    assert 'the hub of the front wheel does not travel as the wheel rolls: see camera_follows' in errors


def raw_stream(path, frames=5):
    """Motion JPEG without a container: it has no time stamps."""
    image = cv2.imencode('.jpg', np.full((360, 640, 3), 100, np.uint8))[1].tobytes()
    path.write_bytes(image * frames)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['--rig', 'others.yaml'], 'no tag was seen; looked for 17 (front) and 18 (rear) of family 36h11'),
        (['--rig', 'half.yaml'], 'the rear wheel was never seen; looked for tag 18 of family 36h11'),
        (['--rig', 'twice.yaml'], 'rear.ids: tag 0 is mounted twice'),
        (['--rig', 'detector.yaml'], "detector must be aruco or apriltag, got 'eyes'"),
        (['--camera', 'nowhere.yaml'], 'nowhere.yaml'),
        (['--camera', 'half.yaml'], 'half.yaml: /** is not a key of a camera file'),
        (['--camera', 'large.yaml'], 'the picture is 640x360, but the camera is calibrated for 1280x720'),
        (['nowhere.mp4'], 'there is no video nowhere.mp4'),
        (['torn.mp4'], 'torn.mp4 is not a video that OpenCV reads, or it is truncated'),
        (['raw.mjpeg'], 'raw.mjpeg has no time stamps: set frame_rate'),
        (['--out', 'full'], 'full exists already, not overwriting'),
        (['--debug', 'half.yaml'], 'half.yaml exists already, not overwriting'),
        (['--debug', 'video.gif'], 'a video must end in .mp4, .avi, .mkv, got video.gif'),
        (['--from', '100', '--to', '200'], 'there is no frame between --from and --to'),
        (['--from', '3', '--to', '2'], '--from must be ≥ 0 s and less than --to, got 3 and 2'),
        (['--stamps', 'half.yaml'], "rear.ids: [18]}' is not a time stamp in ns"),
        (['--stamps', 'ms.csv'], 'ms.csv: 3.3e-08 s lie between one sample and the next'),
        (['--stamps', 'bare.csv'], 'has more frames than there are time stamps: 3'),
        (['--stamps', 'few.csv'], 'has more frames than there are time stamps: 2'),
        (['--stamps', 'back.csv'], 'back.csv: the time stamps must grow from line to line'),
    ],
)
def test_wrong_input_is_told_in_one_line_and_leaves_nothing(film, tmp_path, monkeypatch, capfd, arguments, message):
    monkeypatch.chdir(tmp_path)
    camera = read_camera(film.with_suffix('.camera.yaml'))
    write_camera(Path('large.yaml'), camera._replace(width=1280, height=720))
    for name, values in (
        ('others', 'front.ids: [17], rear.ids: [18]'),
        ('half', 'rear.ids: [18]'),
        ('twice', 'rear.ids: [0]'),
        ('detector', 'detector: eyes'),
    ):
        Path(f'{name}.yaml').write_text(f'/**:\n  ros__parameters: {{{values}}}\n')
    Path('full').mkdir()
    Path('full/summary.json').write_text('{}')
    Path('few.csv').write_text('stamp_ns\n0\n33000000\n')
    Path('bare.csv').write_text('0\n33000000\n66000000\n')
    Path('ms.csv').write_text('stamp_ms\n' + ''.join(f'{33 * k}\n' for k in range(100)))
    Path('back.csv').write_text('stamp_ns\n3\n2\n')
    Path('torn.mp4').write_bytes(film.read_bytes()[:100_000])
    raw_stream(Path('raw.mjpeg'))
    before = set(tmp_path.rglob('*'))
    video, options = (Path(arguments[0]), []) if len(arguments) == 1 else (film, arguments)
    given = {
        '--camera': str(film.with_suffix('.camera.yaml')),
        '--rig': str(film.with_suffix('.rig.yaml')),
        '--out': 'out',
        '--to': '1',
        **dict(zip(options[::2], options[1::2], strict=True)),
    }
    assert main(['track', str(video), '--quiet', *(word for pair in given.items() for word in pair)]) == 2
    errors = capfd.readouterr().err
    assert message in errors
    assert errors.startswith('dcdrw track: ')
    assert errors.count('\n') == 1
    assert set(tmp_path.rglob('*')) == before


def test_a_stream_without_stamps_is_tracked_by_its_rate(film, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    reader, stream = cv2.VideoCapture(str(film)), b''
    for _ in range(60):
        stream += cv2.imencode('.jpg', reader.read()[1])[1].tobytes()
    Path('raw.mjpeg').write_bytes(stream)
    assert (
        main(
            [
                'track',
                'raw.mjpeg',
                '--camera',
                str(film.with_suffix('.camera.yaml')),
                '--rig',
                str(film.with_suffix('.rig.yaml')),
                '--out',
                'out',
                '--frame-rate',
                '30',
                '--quiet',
            ]
        )
        == 0
    )
    assert check_truth(film, tmp_path / 'out') > 50

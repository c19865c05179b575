"""`dcdrw calibrate`: what is found in a film of a roll is how the film was made."""

import math
from pathlib import Path

import pytest
import yaml

from dcdrw.cli import main
from dcdrw.suite.parameter_file import read_parameter_file
from dcdrw.trials.filmed import TrackingParams

pytest.importorskip('cv2')
SMALL = ['--image-width', '640', '--image-height', '360', '--fps', '30', '--grey', '--quiet']
STANDING = ['--no-follow', '--distance', '5', '--place', '1.5']
MADE = """\
/**:
  ros__parameters:
    front: {angles_deg: [4.0]}
    rear: {angles_deg: [-7.5], x: [0.02], y: [-0.01], length: 0.95}
    size: 0.3
    S0: 0.7
"""
KNOWN = '/**:\n  ros__parameters:\n    size: 0.3\n    b: 90.0\n'


@pytest.fixture(scope='module')
def film(tmp_path_factory):
    """A roll before a camera that leans by 1.7°; the tags are glued on askew, and the rear wheel is smaller."""
    folder = tmp_path_factory.mktemp('roll')
    (folder / 'made.yaml').write_text(MADE)
    (folder / 'known.yaml').write_text(KNOWN)
    assert (
        main(
            [
                'film',
                '--out',
                str(folder / 'roll.mp4'),
                '--rig',
                str(folder / 'made.yaml'),
                '--seconds',
                '5',
                '--roll-deg',
                '1.7',
                *STANDING,
                *SMALL,
            ]
        )
        == 0
    )
    return folder / 'roll.mp4'


@pytest.fixture(scope='module')
def followed(tmp_path_factory):
    """A roll that the camera follows."""
    folder = tmp_path_factory.mktemp('followed')
    (folder / 'known.yaml').write_text(KNOWN)
    assert (
        main(['film', '--out', str(folder / 'f.mp4'), '--rig', str(folder / 'known.yaml'), '--seconds', '3', *SMALL])
        == 0
    )
    return folder / 'f.mp4'


def calibrate(film, out, *more, rig='known.yaml'):
    return main(
        [
            'calibrate',
            str(film),
            '--camera',
            str(film.with_suffix('.camera.yaml')),
            '--rig',
            str(film.parent / rig),
            '--out',
            str(out),
            '--quiet',
            *more,
        ]
    )


def check(params, roll_deg=1.7):
    tags, view, track, _ = params
    assert view.roll_deg == pytest.approx(roll_deg, abs=0.1)
    assert not track.camera_follows
    assert track.front.length == pytest.approx(0.9652, abs=0.003)
    assert track.rear.length == pytest.approx(0.95, abs=0.003)
    assert tags.front.angles_deg == pytest.approx((4.0,), abs=0.15)
    assert tags.rear.angles_deg == pytest.approx((-7.5,), abs=0.15)
    assert (*tags.front.x, *tags.front.y) == pytest.approx((0.0, 0.0), abs=0.002)
    assert (*tags.rear.x, *tags.rear.y) == pytest.approx((0.02, -0.01), abs=0.002)


def test_what_is_found_is_how_the_film_was_made(film, tmp_path, capsys):
    assert calibrate(film, tmp_path / 'rig.yaml') == 0
    check(read_parameter_file(tmp_path / 'rig.yaml', TrackingParams()))
    said = capsys.readouterr().out
    for text in ('configured', 'roll_deg', 'rear: step length σ', 'rear.angles_deg, tag 1', ' ± ', 'Written: '):
        assert text in said
    assert 'rear.length is -1.' in said, 'that it was measured badly is worth a word'
    assert 'front.length is' not in said
    content = yaml.safe_load((tmp_path / 'rig.yaml').read_text())
    assert content['/**']['ros__parameters']['b'] == 90.0, 'what is not learned stays'


def test_a_calibrated_rig_needs_no_further_correction(film, tmp_path):
    (tmp_path / 'known.yaml').write_text(KNOWN)
    assert calibrate(film, tmp_path / 'once.yaml') == 0
    assert calibrate(film, tmp_path / 'twice.yaml', rig=str(tmp_path / 'once.yaml')) == 0
    check(read_parameter_file(tmp_path / 'twice.yaml', TrackingParams()))


def test_with_a_level_camera_the_slope_is_learned(film, tmp_path):
    """A wrong slope, and a camera that leans as roll_deg says."""
    (tmp_path / 'steep.yaml').write_text(f'{KNOWN}    slope: 0.1\n    roll_deg: 1.7\n')
    assert calibrate(film, tmp_path / 'rig.yaml', '--learn-slope', rig=str(tmp_path / 'steep.yaml')) == 0
    params = read_parameter_file(tmp_path / 'rig.yaml', TrackingParams())
    check(params)
    assert math.degrees(params.track.slope) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ([], 'the camera must stand still, not follow the pair'),
        (['--to', '1.5'], ' steps before the camera, but 4 are needed: film a longer way'),
        (['--out', 'there.yaml'], 'there.yaml exists already, not overwriting'),
        (['--camera', 'no.yaml'], 'no.yaml'),
        (
            ['--rig', 'other.yaml', '--to', '0.5'],
            'no tag was seen; looked for 17 (front) and 18 (rear) of family 36h11',
        ),
    ],
)
def test_what_tells_nothing_is_refused_in_one_line(followed, tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    Path('there.yaml').write_text('')
    Path('other.yaml').write_text('/**:\n  ros__parameters: {front.ids: [17], rear.ids: [18]}\n')
    assert calibrate(followed, 'rig.yaml', *arguments) == 2
    errors = capsys.readouterr().err
    assert message in errors
    assert errors.count('\n') == 1
    assert not Path('rig.yaml').exists()

import math

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_msgs_py.camera import Camera, make_camera, pinhole, read_camera, write_camera

MATRIX = [900.0, 0.0, 640.0, 0.0, 905.0, 355.0, 0.0, 0.0, 1.0]
LENSES = {
    'plumb_bob': [-0.28, 0.09, 0.001, -0.0007, -0.012],
    'rational_polynomial': [5.2, 3.1, -0.0002, 0.0004, 0.15, 5.6, 4.5, 0.9],
}


def lens(model: str) -> Camera:
    return make_camera(1280, 720, MATRIX, model, LENSES[model])


@pytest.mark.parametrize('model', LENSES)
def test_pixels_are_those_of_opencv(model):
    cv2 = pytest.importorskip('cv2')
    camera = lens(model)
    points = np.random.default_rng(0).uniform((-1.0, -0.6, 1.0), (1.0, 0.6, 3.0), (200, 3))
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, camera.distortion)
    assert camera.project(points) == pytest.approx(expected.reshape(-1, 2), abs=1e-9)


@given(x=st.floats(0.0, 1279.0), y=st.floats(0.0, 719.0), model=st.sampled_from(sorted(LENSES)))
def test_rays_and_project_are_inverse_over_the_whole_picture(x, y, model):
    camera = lens(model)
    ray = camera.rays([(x, y)])
    assert camera.project(np.append(ray, 1.0)) == pytest.approx(np.array([(x, y)]), abs=1e-6)


def test_a_point_that_is_not_before_the_camera_has_no_pixel():
    assert np.isnan(pinhole(640, 480, 60.0).project([(0.1, 0.1, -1.0), (0.1, 0.1, 0.0)])).all()


def test_a_pixel_that_the_lens_never_reaches_has_no_ray():
    camera = make_camera(1280, 720, MATRIX, 'plumb_bob', [-0.5, 0.0, 0.0, 0.0, 0.0])  # r (1 − r²/2) is at most 0.544
    rays = camera.rays([(640.0, 355.0), (640.0 + 0.5 * 900.0, 355.0), (640.0 + 0.6 * 900.0, 355.0)])
    assert np.isfinite(rays[:2]).all()
    assert np.isnan(rays[2]).all()


def test_a_pinhole_sees_its_field_of_view():
    camera = pinhole(1280, 720, 90.0)
    left, middle, right = camera.rays([(-0.5, 359.5), (639.5, 359.5), (1279.5, 359.5)])
    assert left == pytest.approx((-1.0, 0.0))
    assert middle == pytest.approx((0.0, 0.0))
    assert right == pytest.approx((1.0, 0.0))


@pytest.mark.parametrize('angle', [0.0, 180.0, math.nan])
def test_an_impossible_field_of_view_is_refused(angle):
    with pytest.raises(ValueError, match='field_of_view_deg must be'):
        pinhole(1280, 720, angle)


@pytest.mark.parametrize('model', LENSES)
def test_what_is_written_is_read(model, tmp_path):
    camera = lens(model)
    write_camera(tmp_path / 'camera.yaml', camera)
    read = read_camera(tmp_path / 'camera.yaml')
    assert read[:2] == camera[:2]
    assert read.model == model
    np.testing.assert_array_equal(read.matrix, camera.matrix)
    np.testing.assert_array_equal(read.distortion, camera.distortion)


def test_the_file_has_every_field_that_ros_drivers_read(tmp_path):
    write_camera(tmp_path / 'camera.yaml', lens('plumb_bob'), 'tripod')
    content = yaml.safe_load((tmp_path / 'camera.yaml').read_text())
    assert list(content) == [
        'image_width',
        'image_height',
        'camera_name',
        'camera_matrix',
        'distortion_model',
        'distortion_coefficients',
        'rectification_matrix',
        'projection_matrix',
    ]
    shapes = {
        'camera_matrix': (3, 3),
        'distortion_coefficients': (1, 5),
        'rectification_matrix': (3, 3),
        'projection_matrix': (3, 4),
    }
    for name, (rows, cols) in shapes.items():
        assert (content[name]['rows'], content[name]['cols'], len(content[name]['data'])) == (rows, cols, rows * cols)


def test_a_lens_without_coefficients_is_straight():
    assert not make_camera(1280, 720, MATRIX, 'plumb_bob', []).distortion.any()
    assert make_camera(1280, 720, MATRIX, 'plumb_bob', [0.1, 0.2, 0.0, 0.0]).distortion.tolist() == [0.1, 0.2, 0, 0, 0]


def content(**changes: object) -> dict[str, object]:
    whole = {
        'image_width': 1280,
        'image_height': 720,
        'camera_matrix': {'data': MATRIX},
        'distortion_model': 'plumb_bob',
        'distortion_coefficients': {'data': LENSES['plumb_bob']},
        **changes,
    }
    return {name: value for name, value in whole.items() if value is not None}


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'image_width': None}, r'camera\.yaml has no image_width: is it a camera_info file'),
        ({'camera_matrix': None}, r'camera\.yaml has no camera_matrix\.data'),
        ({'camera_matrix': {'rows': 3}}, r'camera\.yaml has no camera_matrix\.data'),
        ({'distortion_coefficients': None}, r'has no distortion_coefficients\.data'),
        ({'image_height': 'tall'}, r"image_height must be a whole number, got 'tall'"),
        ({'image_height': 0}, 'image_width and image_height must be at least 1, got 1280 and 0'),
        ({'camera_matrix': {'data': [1.0]}}, r'camera_matrix\.data must be 9 finite numbers, got \[1\.0\]'),
        ({'camera_matrix': {'data': ['a'] * 9}}, r'camera_matrix\.data must be a list of numbers'),
        (
            {'camera_matrix': {'data': [0.0] * 9}},
            r'focal lengths .* must be > 0, got 0 and 0; calibrate the camera first',
        ),
        ({'distortion_model': 'equidistant'}, "must be plumb_bob or rational_polynomial, got 'equidistant'"),
        ({'distortion_coefficients': {'data': [0.1, 0.2]}}, r'plumb_bob must be 5 finite numbers, got \[0\.1, 0\.2\]'),
        ({'distortion_coefficients': {'data': [math.nan] * 5}}, 'plumb_bob must be 5 finite numbers'),
    ],
)
def test_a_bad_file_is_refused_with_the_key_that_is_to_blame(changes, message, tmp_path):
    path = tmp_path / 'camera.yaml'
    path.write_text(yaml.safe_dump(content(**changes)))
    with pytest.raises(ValueError, match=message) as error:
        read_camera(path)
    assert 'camera.yaml' in str(error.value)


@pytest.mark.parametrize(
    ('text', 'message'), [('a: [', 'is not YAML'), ('', 'has no image_width'), ('3', 'has no image_width')]
)
def test_what_is_no_camera_file_is_refused(text, message, tmp_path):
    path = tmp_path / 'camera.yaml'
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        read_camera(path)

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_msgs_py.camera import MODELS, Camera, make_camera, pinhole, read_camera, write_camera
from dcdrw_msgs_py.yaml_file import read_yaml, yaml_text

MATRIX = [900.0, 0.0, 640.0, 0.0, 905.0, 355.0, 0.0, 0.0, 1.0]
LENSES = {
    'plumb_bob': [-0.28, 0.09, 0.001, -0.0007, -0.012],
    'rational_polynomial': [5.2, 3.1, -0.0002, 0.0004, 0.15, 5.6, 4.5, 0.9],
    'thin_prism': [-0.2, 0.05, 0.001, -0.0007, 0.01, 0.02, 0.01, 0.003, 0.002, -0.001, 0.001, 0.0005],
    'tilted': [-0.2, 0.05, 0.001, -0.0007, 0.01, 0.02, 0.01, 0.003, 0.002, -0.001, 0.001, 0.0005, 0.05, -0.03],
    'equidistant': [-0.05, 0.01, -0.002, 0.0003],
}


def lens(model: str) -> Camera:
    name = model if model in MODELS else 'rational_polynomial'
    return make_camera(1280, 720, MATRIX, name, LENSES[model])


@pytest.mark.parametrize('model', LENSES)
def test_pixels_are_those_of_opencv(model):
    cv2 = pytest.importorskip('cv2')
    camera = lens(model)
    points = np.random.default_rng(0).uniform((-1.0, -0.6, 1.0), (1.0, 0.6, 3.0), (200, 3))
    project = cv2.fisheye.projectPoints if model == 'equidistant' else cv2.projectPoints
    shaped = points[:, None] if model == 'equidistant' else points
    expected, _ = project(shaped, np.zeros(3), np.zeros(3), camera.matrix, camera.distortion)
    assert camera.project(points) == pytest.approx(expected.reshape(-1, 2), abs=1e-9)


@given(x=st.floats(0.0, 1279.0), y=st.floats(0.0, 719.0), model=st.sampled_from(sorted(LENSES)))
def test_rays_and_project_are_inverse_over_the_whole_picture(x, y, model):
    camera = lens(model)
    ray = camera.rays([(x, y)])
    assert camera.project(np.append(ray, 1.0)) == pytest.approx(np.array([(x, y)]), abs=1e-6)


def test_rays_of_a_fisheye_are_those_of_opencv():
    cv2 = pytest.importorskip('cv2')
    camera = lens('equidistant')
    pixels = np.random.default_rng(0).uniform((0.0, 0.0), (1280.0, 720.0), (200, 2))
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-14)
    expected = cv2.fisheye.undistortPoints(pixels[:, None], camera.matrix, camera.distortion, criteria=criteria)
    assert camera.rays(pixels) == pytest.approx(expected.reshape(-1, 2), abs=1e-9)
    assert camera.rays([(640.0, 355.0)]) == pytest.approx(np.zeros((1, 2)))


def test_a_fisheye_has_no_ray_beside_or_behind_it():
    camera = make_camera(1280, 720, MATRIX, 'equidistant', [0.0] * 4)
    edge = 640.0 + 900.0 * math.pi / 2
    rays = camera.rays([(edge - 1.0, 355.0), (edge + 1.0, 355.0)])
    assert rays[0, 0] > 500.0
    assert np.isnan(rays[1]).all()


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
    assert read.model == camera.model
    np.testing.assert_array_equal(read.matrix, camera.matrix)
    np.testing.assert_array_equal(read.distortion, camera.distortion)


def test_the_file_has_every_field_that_ros_drivers_read(tmp_path):
    write_camera(tmp_path / 'camera.yaml', lens('plumb_bob'), 'tripod')
    content = read_yaml(tmp_path / 'camera.yaml')
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
        ({'image_height': 0}, 'image_width and image_height must be from 1 to 65536 pixels, got 1280 and 0'),
        ({'image_width': 10**9}, 'must be from 1 to 65536 pixels, got 1000000000 and'),
        (
            {'camera_matrix': {'data': [900.0, 0.0, 0.0, 0.0, 905.0, 0.0, 640.0, 355.0, 1.0]}},
            r'must be fx, 0, cx, 0, fy, cy, 0, 0, 1 row by row, got .*: it is transposed',
        ),
        ({'camera_matrix': {'data': [900.0, 0.0, 640.0, 0.0, 905.0, 355.0, 0.0, 0.0, 2.0]}}, 'row by row'),
        ({'camera_matrix': {'data': [1.0]}}, r'camera_matrix\.data must be 9 finite numbers, got \[1\.0\]'),
        ({'camera_matrix': {'data': ['a'] * 9}}, r'camera_matrix\.data must be a list of numbers'),
        (
            {'camera_matrix': {'data': [0.0] * 9}},
            r'focal lengths .* must be > 0, got 0 and 0; calibrate the camera first',
        ),
        (
            {'camera_matrix': {'data': [0.7, 0.0, 0.5, 0.0, 1.25, 0.5, 0.0, 0.0, 1.0]}},
            'focal lengths of 0.7 and 1.25 pixels are none of a picture of 1280 x 720: are they in another unit',
        ),
        ({'K': [1.0] * 9}, 'has both camera_matrix and K: leave one'),
        ({'distortion_model': 'ftheta'}, "must be plumb_bob or rational_polynomial or equidistant, got 'ftheta'"),
        ({'distortion_model': 3}, 'distortion_model must be a string, got 3'),
        ({'distortion_model': 'equidistant'}, 'an equidistant .* lens has 4 coefficients'),
        ({'distortion_coefficients': {'data': [0.1] * 3}}, 'plumb_bob must be 4, 5, 8, 12 or 14 numbers'),
        ({'distortion_coefficients': {'data': [math.nan] * 5}}, 'must be finite numbers'),
        (
            {'distorsion_model': 'equidistant'},
            'distorsion_model is not a key of a camera file; did you mean distortion',
        ),
        ({'camera_matrix': {'dat': MATRIX}}, 'dat is not a key of a camera file; did you mean data'),
        ({'lens': 'wide'}, 'lens is not a key of a camera file; known are image_width'),
    ],
)
def test_a_bad_file_is_refused_with_the_key_that_is_to_blame(changes, message, tmp_path):
    path = tmp_path / 'camera.yaml'
    path.write_text(yaml_text(content(**changes)))
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


ZEROS = [0.0] * 3


@pytest.mark.parametrize(
    ('model', 'coefficients', 'read', 'expected'),
    [
        ('plumb_bob', [*LENSES['plumb_bob'], *ZEROS], 'plumb_bob', LENSES['plumb_bob']),
        ('radtan', LENSES['plumb_bob'][:4], 'plumb_bob', [*LENSES['plumb_bob'][:4], 0.0]),
        ('rational_polynomial', LENSES['plumb_bob'], 'rational_polynomial', [*LENSES['plumb_bob'], *ZEROS]),
        ('plumb_bob', LENSES['rational_polynomial'], 'rational_polynomial', LENSES['rational_polynomial']),
        ('fisheye', LENSES['equidistant'], 'equidistant', LENSES['equidistant']),
        ('', LENSES['plumb_bob'], 'plumb_bob', LENSES['plumb_bob']),
        (None, LENSES['plumb_bob'], 'plumb_bob', LENSES['plumb_bob']),
        (None, LENSES['tilted'], 'rational_polynomial', LENSES['tilted']),
        ('none', [], 'plumb_bob', [0.0] * 5),
    ],
)
def test_models_are_read_as_people_name_them(model, coefficients, read, expected, tmp_path):
    path = tmp_path / 'camera.yaml'
    path.write_text(yaml_text(content(distortion_model=model, distortion_coefficients={'data': coefficients})))
    camera = read_camera(path)
    assert (camera.model, camera.distortion.tolist()) == (read, expected)


OPENCV = """%YAML:1.0
---
calibration_time: "Wed 25 Nov 2026 18:00:00"
image_width: 1280
image_height: 720
flags: 0
FISHEYEcamera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 9.0000000000000000e+02, 0., 640., 0., 905., 355., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ -0.05, 1.0e-02, -2e-03, 3e-04 ]
avg_reprojection_error: 2.1e-01
"""
KALIBR = """cam0:
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [-0.05, 0.01, -0.002, 0.0003]
  distortion_model: equidistant
  intrinsics: [900.0, 905.0, 640.0, 355.0]
  resolution: [1280, 720]
  rostopic: /cam0/image_raw
"""
VOXL = """%YAML:1.0
---
M: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 900., 0., 640., 0., 905., 355., 0., 0., 1. ]
D: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ -0.05, 0.01, -0.002, 0.0003 ]
reprojection_error: 0.2
width: 1280
height: 720
distortion_model: "fisheye"
calibration_time: "2026-11-25"
"""


ECHO = """header:
  stamp:
    sec: 1
    nanosec: 2
  frame_id: camera
height: 720
width: 1280
distortion_model: kannala_brandt
d: [-0.05, 0.01, -0.002, 0.0003]
k: [900.0, 0.0, 640.0, 0.0, 905.0, 355.0, 0.0, 0.0, 1.0]
r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
p: [900.0, 0.0, 640.0, 0.0, 0.0, 905.0, 355.0, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
---
"""


@pytest.mark.parametrize(
    'text',
    [
        OPENCV.replace('FISHEYE', 'fisheye_model: 1\n'),
        KALIBR,
        KALIBR.replace('cam0:\n', ''),
        VOXL,
        ECHO,
    ],
    ids=['OpenCV', 'kalibr', 'kalibr, one camera', 'voxl', 'ros2 topic echo'],
)
def test_files_of_other_calibrations_are_read(text, tmp_path):
    path = tmp_path / 'camera.yaml'
    path.write_text(text)
    camera = read_camera(path)
    assert camera[:2] == (1280, 720)
    assert camera.matrix.ravel().tolist() == MATRIX
    assert (camera.model, camera.distortion.tolist()) == ('equidistant', LENSES['equidistant'])


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        (KALIBR + KALIBR.replace('cam0', 'cam1'), 'has several cameras, cam0, cam1: keep the one'),
        (KALIBR.replace('pinhole', 'omni'), "camera_model must be pinhole, got 'omni'"),
        (KALIBR.replace('resolution', 'resolutoin'), 'resolutoin is not a key of a camera file; did you mean'),
        (KALIBR.replace('  resolution: [1280, 720]\n', ''), 'has no resolution'),
    ],
)
def test_a_bad_file_by_kalibr_is_told(text, message, tmp_path):
    path = tmp_path / 'camera.yaml'
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        read_camera(path)


@pytest.mark.parametrize(
    ('model', 'coefficients'),
    [
        ('plumb_bob', [1e6, 0.0, 0.0, 0.0, 0.0]),
        ('plumb_bob', [-5.0, 0.0, 0.0, 0.0, 0.0]),
        ('plumb_bob', [-0.28, 0.09, 3.0, -0.0007, 0.0]),
        ('rational_polynomial', [0.0, 0.0, 0.0, 0.0, 0.0, 1e4, 0.0, 0.0]),
        ('equidistant', [-3.0, 0.0, 0.0, 0.0]),
        ('equidistant', [1e5, 0.0, 0.0, 0.0]),
    ],
)
def test_a_distortion_that_no_lens_has_is_refused(model, coefficients):
    with pytest.raises(ValueError, match='camera_info: no lens bends a picture as distortion_coefficients'):
        make_camera(1280, 720, MATRIX, model, coefficients)


@pytest.mark.parametrize(
    ('width', 'height', 'matrix', 'message'),
    [
        (640, 480, [900.0, 0.0, 960.0, 0.0, 900.0, 540.0, 0.0, 0.0, 1.0], 'outside of the picture of 640 x 480'),
        (1280, 720, [9e6, 0.0, 640.0, 0.0, 9e6, 360.0, 0.0, 0.0, 1.0], 'are none of a picture of 1280 x 720'),
        (1280, 720, [900.0, 0.0, 640.0, 0.0, 90.0, 360.0, 0.0, 0.0, 1.0], 'are none of a picture of 1280 x 720'),
    ],
)
def test_a_matrix_that_is_none_of_the_picture_is_refused(width, height, matrix, message):
    with pytest.raises(ValueError, match=message):
        make_camera(width, height, matrix, 'plumb_bob', [])

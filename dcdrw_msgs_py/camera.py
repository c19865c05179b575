"""A camera: pinhole or fisheye with lens distortion, as the calibrations of ROS, OpenCV and kalibr write it."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dcdrw_msgs_py.quantity import suggestion
from dcdrw_msgs_py.values import Floats
from dcdrw_msgs_py.yaml_file import read_yaml, yaml_text

MODELS = {'plumb_bob': (5,), 'rational_polynomial': (8, 12, 14), 'equidistant': (4,)}
"""Distortion models, and how many coefficients each may have.

Brown's are k1, k2, p1, p2, k3, then k4, k5, k6 (rational), then s1 to s4 (thin prism) and τx, τy (tilted sensor), as
OpenCV has them; those of a fisheye, the polynomial in θ of Kannala and Brandt, are k1 to k4.
"""
ALIASES = {
    '': 'plumb_bob',
    'none': 'plumb_bob',
    'radtan': 'plumb_bob',
    'radial-tangential': 'plumb_bob',
    'rational': 'rational_polynomial',
    'thin_prism': 'rational_polynomial',
    'fisheye': 'equidistant',
    'equi': 'equidistant',
    'kannala_brandt': 'equidistant',
    'kannala_brandt4': 'equidistant',
}
"""Names that others give to the models."""
WIDEST = 65_536
"""No picture has more pixels a side."""
SHORTEST = 0.002
"""No lens has a focal length that is less of its picture's longer side: it would see 179.5° without a bend."""
LONGEST = 100.0
"""No lens has a focal length that is more: it would see half a degree."""
SQUAREST = 3.0
"""No pixel is more times as wide as it is high, or as high as it is wide."""
LEAST_SEEN = 0.25
"""Of a real lens's picture at least so much shows something: what lies around it may stay dark."""
MOST_STRETCHED = 2.0
"""No lens shows a thing more times as far from the middle as a pinhole does."""
NEWTON_STEPS = 20
"""Enough to invert any lens that can be inverted at all; three do for a usual one."""
RAY_TOLERANCE = 1e-10
"""How well a distortion is inverted, in units of the focal length: far less than a pixel."""


class Camera(NamedTuple):
    """What maps the optical frame (x right, y down, z forward) to pixels; a pixel's centre has whole coordinates."""

    width: int
    height: int
    matrix: Floats
    """Intrinsic matrix K, (3, 3)."""
    distortion: Floats
    """Coefficients, as many as their model has; see `MODELS`."""

    @property
    def model(self) -> str:
        """Name of the distortion model."""
        return next(name for name, counts in MODELS.items() if len(self.distortion) in counts)

    @property
    def is_straight(self) -> bool:
        """Whether what is straight stays so in the picture."""
        return self.model != 'equidistant' and not self.distortion.any()

    def project(self, points: ArrayLike) -> Floats:
        """Pixels (N, 2) of points (N, 3) in the optical frame; NaN for what is not in front of the camera."""
        x, y, z = np.asarray(points, float).reshape(-1, 3).T
        z = np.where(z > 0.0, z, np.nan)
        bent = _distort(np.stack((x / z, y / z)), self.distortion)
        return np.asarray((self.matrix[:2, :2] @ bent).T + self.matrix[:2, 2])

    def rays(self, pixels: ArrayLike) -> Floats:
        """Undistorted x/z and y/z, (N, 2), of pixels (N, 2); NaN for what this lens never projects there."""
        seen = np.asarray(pixels, float).reshape(-1, 2) - self.matrix[:2, 2]
        bent = np.linalg.solve(self.matrix[:2, :2], seen.T)
        return np.asarray((bent if self.is_straight else _undistort(bent, self.distortion)).T)


def _distort(straight: Floats, coefficients: Floats) -> Floats:
    """Where the lens puts undistorted coordinates (2, N)."""
    if len(coefficients) == 4:
        return _distort_fisheye(straight, coefficients)
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y = np.pad(coefficients, (0, 14 - len(coefficients)))
    x, y = straight
    r2 = x * x + y * y
    radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    bent = np.stack(
        (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (s1 + r2 * s2),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (s3 + r2 * s4),
        )
    )
    return _tilted(bent, tau_x, tau_y) if tau_x or tau_y else bent


def _tilted(bent: Floats, tau_x: float, tau_y: float) -> Floats:
    """The same on a sensor that is tilted about x and y [rad]."""
    (cx, sx), (cy, sy) = ((math.cos(tau), math.sin(tau)) for tau in (tau_x, tau_y))
    turn = np.array(((cy, sx * sy, -cx * sy), (0.0, cx, sx), (sy, -sx * cy, cx * cy)))
    onto = np.array(((turn[2, 2], 0.0, -turn[0, 2]), (0.0, turn[2, 2], -turn[1, 2]), (0.0, 0.0, 1.0)))
    x, y, z = onto @ turn @ np.stack((*bent, np.ones_like(bent[0])))
    return np.stack((x / z, y / z))


def _distort_fisheye(straight: Floats, coefficients: Floats) -> Floats:
    """θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) from the axis, where a pinhole puts tan θ."""
    r = np.hypot(*straight)
    theta = np.arctan(r)
    with np.errstate(invalid='ignore'):
        return straight * np.where(r > 0.0, _seen_angle(theta, coefficients)[0] / r, 1.0)


def _seen_angle(theta: Floats, coefficients: Floats) -> tuple[Floats, Floats]:
    """The angle θ as a fisheye shows it, and its derivative."""
    t2 = theta * theta
    value, slope = np.ones_like(theta), np.ones_like(theta)
    for power, k in enumerate(coefficients, start=1):
        value = value + k * t2**power
        slope = slope + (2 * power + 1) * k * t2**power
    return theta * value, slope


def _undistort_fisheye(bent: Floats, coefficients: Floats) -> Floats:
    """Inverse of `_distort_fisheye`, by Newton's method on θ; NaN from 90° on, and where no θ is shown there."""
    seen = np.hypot(*bent)
    theta = np.minimum(seen, 0.5 * math.pi)
    for _ in range(NEWTON_STEPS):
        value, slope = _seen_angle(theta, coefficients)
        with np.errstate(divide='ignore', invalid='ignore'):
            theta = theta - (value - seen) / slope
    value, slope = _seen_angle(theta, coefficients)
    good = (np.abs(value - seen) <= RAY_TOLERANCE) & (theta >= 0.0) & (theta < 0.5 * math.pi) & (slope > 0.0)
    with np.errstate(invalid='ignore'):
        return np.where(good, bent * np.where(seen > 0.0, np.tan(theta) / seen, 1.0), np.nan)


def _undistort(bent: Floats, coefficients: Floats) -> Floats:
    """Inverse of `_distort`, by Newton's method."""
    if len(coefficients) == 4:
        return _undistort_fisheye(bent, coefficients)
    straight, step = bent.copy(), 1e-6

    def slopes() -> tuple[Floats, Floats]:
        x, y = (
            (
                _distort(straight + np.array(axis)[:, None] * step, coefficients)
                - _distort(straight - np.array(axis)[:, None] * step, coefficients)
            )
            / (2.0 * step)
            for axis in ((1.0, 0.0), (0.0, 1.0))
        )
        return x, y

    error = _distort(straight, coefficients) - bent
    with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
        for _ in range(NEWTON_STEPS):
            (a, c), (b, d) = slopes()
            straight = straight - np.stack((d * error[0] - b * error[1], a * error[1] - c * error[0])) / (a * d - b * c)
            error = _distort(straight, coefficients) - bent
            if not (np.abs(error) > RAY_TOLERANCE).any():
                break
        (a, c), (b, d) = slopes()
        # Beyond the fold of a strong distortion the model comes back into the picture, turned over: no lens does.
        good = (np.abs(error) <= RAY_TOLERANCE).all(axis=0) & (a * d - b * c > 0.0) & (a + d > 0.0)
    return np.where(good, straight, np.nan)


def pinhole(width: int, height: int, field_of_view_deg: float) -> Camera:
    """A camera without distortion that looks through its middle; the field of view is that of the width [deg].

    Raises:
        ValueError: the field of view is not between 0 and 180 degrees.

    """
    if not 0.0 < field_of_view_deg < 180.0:
        raise ValueError(f'field_of_view_deg must be > 0, < 180, got {field_of_view_deg:g}')
    focal = 0.5 * width / math.tan(0.5 * math.radians(field_of_view_deg))
    matrix = (focal, 0.0, 0.5 * (width - 1), 0.0, focal, 0.5 * (height - 1), 0.0, 0.0, 1.0)
    return make_camera(width, height, matrix, 'plumb_bob', ())


def make_camera(
    width: int, height: int, matrix: ArrayLike, model: str, coefficients: Sequence[float], source: str = 'camera_info'
) -> Camera:
    """A camera from the fields of a CameraInfo; no coefficients at all stand for no distortion.

    Raises:
        ValueError: a field is impossible, or the camera was never calibrated; `source` is named.

    """
    if not (1 <= width <= WIDEST and 1 <= height <= WIDEST):
        raise ValueError(
            f'{source}: image_width and image_height must be from 1 to {WIDEST} pixels, got {width} and {height}'
        )
    K: Floats = np.array(matrix, float)
    if K.size != 9 or not np.isfinite(K).all():
        raise ValueError(f'{source}: camera_matrix.data must be 9 finite numbers, got {[float(x) for x in K.flat]}')
    K = K.reshape(3, 3)
    if not (K[0, 0] > 0.0 and K[1, 1] > 0.0):
        raise ValueError(
            f'{source}: the focal lengths in camera_matrix.data must be > 0, got {K[0, 0]:g} and '
            f'{K[1, 1]:g}; calibrate the camera first (ros2 run camera_calibration cameracalibrator)'
        )
    if min(K[0, 0], K[1, 1]) < SHORTEST * max(width, height):
        raise ValueError(
            f'{source}: focal lengths of {K[0, 0]:g} and {K[1, 1]:g} pixels are none of a picture of {width} x '
            f'{height}: are they in another unit?'
        )
    if K[1, 0] or K[2, 0] or K[2, 1] or K[2, 2] != 1.0:
        raise ValueError(
            f'{source}: camera_matrix.data must be fx, 0, cx, 0, fy, cy, 0, 0, 1 row by row, got '
            f'{[float(x) for x in K.flat]}{": it is transposed" if K[2, 0] and not K[0, 2] else ""}'
        )
    if max(K[0, 0], K[1, 1]) > LONGEST * max(width, height) or not 1.0 / SQUAREST < K[0, 0] / K[1, 1] < SQUAREST:
        raise ValueError(
            f'{source}: focal lengths of {K[0, 0]:g} and {K[1, 1]:g} pixels are none of a picture of {width} x {height}'
        )
    if not (0.0 <= K[0, 2] <= width and 0.0 <= K[1, 2] <= height):
        raise ValueError(
            f'{source}: the centre ({K[0, 2]:g}, {K[1, 2]:g}) lies outside of the picture of {width} x {height}: was '
            'the camera calibrated at another resolution?'
        )
    camera = Camera(int(width), int(height), K, _coefficients(model, np.array(coefficients, float).ravel(), source))
    _check_lens(camera, source)
    return camera


def _check_lens(camera: Camera, source: str) -> None:
    """Refuse a distortion that no lens has: one with which most of the picture shows nothing, or too little of it."""
    if camera.is_straight:
        return
    columns, rows = (np.linspace(0.0, pixels - 1.0, 9) for pixels in camera[:2])
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
        rays = np.hypot(*camera.rays(pixels).T)
        bent = np.hypot(*np.linalg.solve(camera.matrix[:2, :2], (pixels - camera.matrix[:2, 2]).T))
        seen = MOST_STRETCHED * rays >= bent
    if seen.mean() < LEAST_SEEN:
        raise ValueError(
            f'{source}: no lens bends a picture as distortion_coefficients {camera.distortion.tolist()} of '
            f'{camera.model} do: are they in the order of this model, and is it the right one?'
        )


def _coefficients(model: str, D: Floats, source: str) -> Floats:
    """As many coefficients as the model has; what is left out is zero."""
    name = ALIASES.get(model.lower(), model.lower())
    if name not in MODELS:
        raise ValueError(f'{source}: distortion_model must be {" or ".join(MODELS)}, got {model!r}')
    if not np.isfinite(D).all():
        raise ValueError(f'{source}: distortion_coefficients.data must be finite numbers, got {D.tolist()}')
    if name == 'equidistant':
        if len(D) not in (0, 4) and D[4:].any():
            raise ValueError(f'{source}: an equidistant (fisheye) lens has 4 coefficients, got {D.tolist()}')
        return np.pad(D[:4], (0, 4 - len(D[:4])))
    if len(D) not in (0, 2, 4, 5, 8, 12, 14):
        raise ValueError(
            f'{source}: distortion_coefficients.data of {name} must be 4, 5, 8, 12 or 14 numbers, got {D.tolist()}'
        )
    if name == 'plumb_bob' and not D[5:].any():  # OpenCV takes any lens with more for a rational one
        return np.pad(D[:5], (0, 5 - len(D[:5])))
    return np.pad(D, (0, max(8 - len(D), 0)))


def read_camera(path: Path) -> Camera:
    """Read a calibration file, as `camera_calibration` (ROS), OpenCV's FileStorage or kalibr writes it.

    What `ros2 topic echo --once` shows of a CameraInfo is one, too.

    Raises:
        ValueError: not such a file; the key that is missing, wrong or unknown is named.
        OSError: the file cannot be read.

    """
    content = read_yaml(path)
    if not isinstance(content, dict):
        content = {}
    cameras = [name for name in content if str(name).startswith('cam') and str(name)[3:].isdecimal()]
    if len(cameras) > 1:
        raise ValueError(f'{path} has several cameras, {", ".join(cameras)}: keep the one that looks at the wheels')
    if cameras or 'intrinsics' in content:
        return _kalibr(content[cameras[0]] if cameras else content, path)
    return _calibration(content, path)


_NAMES = {
    'image_width': ('image_width', 'width'),
    'image_height': ('image_height', 'height'),
    'camera_matrix': ('camera_matrix', 'M', 'K', 'k', 'cameraMatrix'),
    'distortion_model': ('distortion_model',),
    'distortion_coefficients': ('distortion_coefficients', 'D', 'd', 'distCoeffs', 'dist_coeffs', 'dist_coeff'),
}
"""What is read of a file by ROS, and by what names its messages and OpenCV's users know it."""
_BESIDE = (
    *(
        'camera_name',
        'rectification_matrix',
        'projection_matrix',
        'binning_x',
        'binning_y',
        'roi',
        'header',
        'frame_id',
    ),
    *('calibration_time', 'nframes', 'nr_of_frames', 'flags', 'fisheye_model', 'board_width', 'board_height'),
    *('square_size', 'marker_size', 'aspectRatio', 'avg_reprojection_error', 'reprojection_error'),
    *('per_view_reprojection_errors', 'extrinsic_parameters', 'image_points', 'grid_points', 'rms', 'R', 'P', 'r', 'p'),
)
"""What else these files hold."""
_MATRIX = ('rows', 'cols', 'data', 'dt')
_KALIBR = ('camera_model', 'intrinsics', 'distortion_model', 'distortion_coeffs', 'resolution')
_KALIBR_BESIDE = ('rostopic', 'cam_overlaps', 'T_cam_imu', 'T_imu_cam', 'T_cn_cnm1', 'timeshift_cam_imu')


def _refuse_unknown(content: dict[Any, Any], known: Sequence[str], path: Path) -> None:
    for key in content:
        if key not in known:
            raise ValueError(f'{path}: {key} is not a key of a camera file{suggestion(key, known)}')


def _calibration(content: dict[Any, Any], path: Path) -> Camera:
    _refuse_unknown(content, [*(name for names in _NAMES.values() for name in names), *_BESIDE], path)

    def value(name: str) -> Any:
        there = [key for key in _NAMES[name] if key in content]
        if len(there) > 1:
            raise ValueError(f'{path} has both {" and ".join(there)}: leave one')
        return content[there[0]] if there else None

    def data(name: str) -> list[Any]:
        held = value(name)
        if isinstance(held, dict):
            _refuse_unknown(held, _MATRIX, path)
            held = held.get('data')
        if held is None:
            raise _missing(f'{name}.data', path)
        return _numbers(held, f'{name}.data', path)

    width, height = (_whole(value(name), name, path) for name in ('image_width', 'image_height'))
    model = value('distortion_model')
    if model is None:  # as camera_calibration_parsers takes it; OpenCV's sample says it in its own way
        model = 'equidistant' if content.get('fisheye_model') else ''
        model = model or ('rational_polynomial' if len(data('distortion_coefficients')) > 5 else 'plumb_bob')
    if not isinstance(model, str):
        raise ValueError(f'{path}: distortion_model must be a string, got {model!r}')
    return make_camera(width, height, data('camera_matrix'), model, data('distortion_coefficients'), str(path))


def _kalibr(content: Any, path: Path) -> Camera:
    content = content if isinstance(content, dict) else {}
    _refuse_unknown(content, (*_KALIBR, *_KALIBR_BESIDE), path)
    for name in _KALIBR:
        if name not in content:
            raise _missing(name, path)
    if content['camera_model'] != 'pinhole':
        raise ValueError(f'{path}: camera_model must be pinhole, got {content["camera_model"]!r}')
    intrinsics, resolution, coefficients = (
        _numbers(content[name], name, path) for name in ('intrinsics', 'resolution', 'distortion_coeffs')
    )
    if len(intrinsics) != 4 or len(resolution) != 2:
        raise ValueError(f'{path}: intrinsics must be fx, fy, cx, cy, and resolution width and height')
    fx, fy, cx, cy = intrinsics
    width, height = (_whole(pixels, 'resolution', path) for pixels in resolution)
    matrix = (fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
    return make_camera(width, height, matrix, str(content['distortion_model']), coefficients, str(path))


def _missing(name: str, path: Path) -> ValueError:
    return ValueError(f'{path} has no {name}: is it a camera_info file, as camera_calibration writes it?')


def _whole(value: Any, name: str, path: Path) -> int:
    if value is None:
        raise _missing(name, path)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value // 1:
        raise ValueError(f'{path}: {name} must be a whole number, got {value!r}')
    return int(value)


def _numbers(value: Any, name: str, path: Path) -> list[Any]:
    """A list of numbers, or of rows of them."""
    flat = (
        [item for row in value for item in (row if isinstance(row, list) else [row])] if isinstance(value, list) else []
    )
    if not isinstance(value, list) or any(isinstance(x, bool) or not isinstance(x, (int, float)) for x in flat):
        raise ValueError(f'{path}: {name} must be a list of numbers, got {value!r}')
    return flat


def write_camera(path: Path, camera: Camera, name: str = 'camera') -> None:
    """Write the file that `read_camera` and ROS's camera drivers read."""
    Path(path).write_text(
        yaml_text(
            {
                'image_width': camera.width,
                'image_height': camera.height,
                'camera_name': name,
                'camera_matrix': _matrix(camera.matrix),
                'distortion_model': camera.model,
                'distortion_coefficients': _matrix(camera.distortion[None]),
                'rectification_matrix': _matrix(np.eye(3)),
                'projection_matrix': _matrix(np.pad(camera.matrix, ((0, 0), (0, 1)))),
            }
        ),
        encoding='utf-8',
    )


def _matrix(values: Floats) -> dict[str, Any]:
    rows, cols = values.shape
    return {'rows': rows, 'cols': cols, 'data': [float(value) for value in values.flat]}

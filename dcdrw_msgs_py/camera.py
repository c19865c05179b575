"""A camera: pinhole with lens distortion, as ROS's camera calibration writes it (camera_info)."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

MODELS = {'plumb_bob': 5, 'rational_polynomial': 8}
"""Distortion models, and how many coefficients each has: k1, k2, p1, p2, k3, then k4, k5, k6."""
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
    """Coefficients, (5,) or (8,); see `MODELS`."""

    @property
    def model(self) -> str:
        """Name of the distortion model."""
        return next(name for name, count in MODELS.items() if count == len(self.distortion))

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
        return np.asarray(_undistort(bent, self.distortion).T if self.distortion.any() else bent.T)


def _distort(straight: Floats, coefficients: Floats) -> Floats:
    """Where the lens puts undistorted coordinates (2, N): Brown's model, rational where it has 8 coefficients."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (*coefficients, 0.0, 0.0, 0.0)[:8]
    x, y = straight
    r2 = x * x + y * y
    radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return np.stack(
        (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    )


def _undistort(bent: Floats, coefficients: Floats) -> Floats:
    """Inverse of `_distort`, by Newton's method."""
    straight, step = bent.copy(), 1e-6
    error = _distort(straight, coefficients) - bent
    for _ in range(NEWTON_STEPS):
        (a, c), (b, d) = (
            (
                _distort(straight + np.array(axis)[:, None] * step, coefficients)
                - _distort(straight - np.array(axis)[:, None] * step, coefficients)
            )
            / (2.0 * step)
            for axis in ((1.0, 0.0), (0.0, 1.0))
        )
        with np.errstate(divide='ignore', invalid='ignore'):
            straight = straight - np.stack((d * error[0] - b * error[1], a * error[1] - c * error[0])) / (a * d - b * c)
        error = _distort(straight, coefficients) - bent
        if not (np.abs(error) > RAY_TOLERANCE).any():
            break
    return np.where((np.abs(error) <= RAY_TOLERANCE).all(axis=0), straight, np.nan)


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
    if not (width >= 1 and height >= 1):
        raise ValueError(f'{source}: image_width and image_height must be at least 1, got {width} and {height}')
    K: Floats = np.array(matrix, float)
    if K.size != 9 or not np.isfinite(K).all():
        raise ValueError(f'{source}: camera_matrix.data must be 9 finite numbers, got {[float(x) for x in K.flat]}')
    K = K.reshape(3, 3)
    if not (K[0, 0] > 0.0 and K[1, 1] > 0.0):
        raise ValueError(
            f'{source}: the focal lengths in camera_matrix.data must be > 0, got {K[0, 0]:g} and '
            f'{K[1, 1]:g}; calibrate the camera first (ros2 run camera_calibration cameracalibrator)'
        )
    if model not in MODELS:
        raise ValueError(f'{source}: distortion_model must be {" or ".join(MODELS)}, got {model!r}')
    D = np.array(coefficients, float).ravel()
    if len(D) not in (0, 4, MODELS[model]) or not np.isfinite(D).all():  # 4: k3 left out
        raise ValueError(
            f'{source}: distortion_coefficients.data of {model} must be {MODELS[model]} finite numbers, '
            f'got {D.tolist()}'
        )
    return Camera(int(width), int(height), K, np.pad(D, (0, MODELS[model] - len(D))))


def read_camera(path: Path) -> Camera:
    """Read a calibration file, as `camera_calibration` writes it.

    Raises:
        ValueError: not such a file; the key that is missing or wrong is named.
        OSError: the file cannot be read.

    """
    try:
        content = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f'{path} is not YAML: {" ".join(str(error).split())}') from None

    def entry(name: str, kind: type) -> Any:
        value: Any = content
        for key in name.split('.'):
            if not isinstance(value, dict) or key not in value:
                raise ValueError(f'{path} has no {name}: is it a camera_info file, as camera_calibration writes it?')
            value = value[key]
        numbers = not isinstance(value, list) or all(isinstance(item, (int, float)) for item in value)
        if not isinstance(value, kind) or not numbers:
            raise ValueError(f'{path}: {name} must be {_KINDS[kind]}, got {value!r}')
        return value

    return make_camera(
        entry('image_width', int),
        entry('image_height', int),
        entry('camera_matrix.data', list),
        entry('distortion_model', str),
        entry('distortion_coefficients.data', list),
        str(path),
    )


_KINDS: dict[type, str] = {int: 'a whole number', list: 'a list of numbers', str: 'a string'}


def write_camera(path: Path, camera: Camera, name: str = 'camera') -> None:
    """Write the file that `read_camera` and ROS's camera drivers read."""
    Path(path).write_text(
        yaml.safe_dump(
            {
                'image_width': camera.width,
                'image_height': camera.height,
                'camera_name': name,
                'camera_matrix': _matrix(camera.matrix),
                'distortion_model': camera.model,
                'distortion_coefficients': _matrix(camera.distortion[None]),
                'rectification_matrix': _matrix(np.eye(3)),
                'projection_matrix': _matrix(np.pad(camera.matrix, ((0, 0), (0, 1)))),
            },
            sort_keys=False,
        ),
        encoding='utf-8',
    )


def _matrix(values: Floats) -> dict[str, Any]:
    rows, cols = values.shape
    return {'rows': rows, 'cols': cols, 'data': [float(value) for value in values.flat]}

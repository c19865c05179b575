"""Between messages and pictures, cameras and poses."""

from array import array
from typing import Any

import numpy as np
from geometry_msgs.msg import Point
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import ImageMarker

from dcdrw_msgs_py.camera import Camera, make_camera
from dcdrw_msgs_py.frame import Frame, Picture
from dcdrw_msgs_py.messages import stamp_ns, to_stamp
from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.samples import PoseSample

_CHANNELS = {
    'mono': 1,
    'rgb': 3,
    'bgr': 3,
    'rgba': 4,
    'bgra': 4,
    **dict.fromkeys(('bayer_rggb', 'bayer_bggr', 'bayer_gbrg', 'bayer_grbg'), 1),
}
PIXELS = {
    **{f'{order}{bits}': (order, count, bits // 8) for order, count in _CHANNELS.items() for bits in (8, 16)},
    **{
        f'{bits}{kind}C{count}': (order, count, bits // 8)
        for bits, kind in ((8, 'U'), (16, 'U'))
        for order, count in (('mono', 1), ('bgr', 3), ('bgra', 4))
    },
}
"""Encodings of whole pixels: the order of their channels, how many there are, and how many bytes each has."""
LUMINANCE = {
    **dict.fromkeys(('yuv422', 'uyvy'), (1, 2)),
    **dict.fromkeys(('yuv422_yuy2', 'yuyv', 'yuy2'), (0, 2)),
    **dict.fromkeys(('nv12', 'nv21', 'nv24', 'i420', 'yv12'), (0, 1)),
}
"""Encodings of brightness and colour apart: the first byte of brightness in a row, and from one to the next.

The tags are black and white: only the brightness is read. Where it stands in a plane of its own, that is the first.
"""
BAYER = {'bayer_rggb': 'BG', 'bayer_bggr': 'RG', 'bayer_gbrg': 'GR', 'bayer_grbg': 'GB'}
"""What OpenCV calls these patterns: after their second row."""
DEPTHS = (10, 12, 14)
"""Bits that a sensor may have whose numbers are sent in words of 16."""


def frame(message: Any) -> Frame:
    """The frame in an Image; where the encoding allows, its pixels are those of the message, not copied.

    Raises:
        ValueError: an encoding that is not read, or data that do not fill the picture.

    """
    return Frame(stamp_ns(message.header.stamp), _picture(message))


def _picture(message: Any) -> Picture:
    encoding, height, width, step = message.encoding, message.height, message.width, message.step
    name = encoding if encoding in PIXELS else encoding.lower()
    if name in LUMINANCE:
        first, apart = LUMINANCE[name]
        return _rows(message, height, width * apart, step)[:, first::apart]
    if name not in PIXELS:
        raise ValueError(
            f'the encoding {encoding!r} is not read; let the camera send {", ".join((*PIXELS, *LUMINANCE))}'
        )
    order, channels, size = PIXELS[name]
    rows = _rows(message, height, width * channels * size, step)
    if size == 2:
        rows = _upper_bits(rows, bool(message.is_bigendian))
    if order == 'mono':
        return rows
    cv2 = opencv()
    if order in BAYER:
        return np.asarray(cv2.cvtColor(rows, getattr(cv2, f'COLOR_Bayer{BAYER[order]}2BGR')), np.uint8)
    colours = rows.reshape(height, width, channels)
    if order == 'bgr':
        return colours
    return np.asarray(cv2.cvtColor(colours, getattr(cv2, f'COLOR_{order.upper()}2BGR')), np.uint8)


def _rows(message: Any, height: int, row: int, step: int) -> Picture:
    """The rows of a message's picture, without what fills them up."""
    data = np.frombuffer(message.data, np.uint8)
    if not (row and height) or step < row or data.size < step * (height - 1) + row:
        raise ValueError(
            f'{data.size} bytes in rows of {step} are not a {message.encoding} picture of {message.width}x{height}'
        )
    return np.lib.stride_tricks.as_strided(data, (height, row), (step, 1), writeable=False)


def _upper_bits(rows: Picture, bigendian: bool) -> Picture:
    """The upper eight of the bits that are in use: a sensor of 10, 12 or 14 bits leaves the others of 16 empty."""
    words = np.ascontiguousarray(rows).view('>u2' if bigendian else '<u2')
    brightest = int(words.max())
    bits = next((bits for bits in DEPTHS if brightest < 1 << bits), 16)
    return (words >> (bits - 8)).astype(np.uint8)


def compressed_frame(message: Any) -> Frame:
    """The frame in a CompressedImage (JPEG, PNG and what else OpenCV decodes).

    Raises:
        ValueError: the data are not a picture.

    """
    cv2 = opencv()
    data = np.frombuffer(message.data, np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_ANYCOLOR) if data.size else None
    if image is None:
        raise ValueError(f'{data.size} bytes of format {message.format!r} are not a picture that OpenCV decodes')
    return Frame(stamp_ns(message.header.stamp), np.asarray(image, np.uint8))


def image_message(frame: Frame, frame_id: str = 'camera') -> Any:
    """The Image of a frame: mono8 or bgr8."""
    height, width = frame.image.shape[:2]
    channels = 1 if frame.image.ndim == 2 else 3
    message = Image(height=height, width=width, encoding='mono8' if channels == 1 else 'bgr8', step=width * channels)
    message.header.stamp, message.header.frame_id = to_stamp(frame.stamp_ns), frame_id
    message.data = array('B', frame.image.tobytes())
    return message


def camera(message: Any) -> Camera:
    """The camera in a CameraInfo.

    Raises:
        ValueError: it is not calibrated, or a field is impossible.

    """
    return make_camera(message.width, message.height, message.k, message.distortion_model, list(message.d))


def camera_message(camera: Camera, stamp: int, frame_id: str = 'camera') -> Any:
    """The CameraInfo of a camera at a time [ns]."""
    message = CameraInfo(width=camera.width, height=camera.height, distortion_model=camera.model)
    message.header.stamp, message.header.frame_id = to_stamp(stamp), frame_id
    message.d = camera.distortion.tolist()
    message.k = camera.matrix.ravel()
    message.r = np.eye(3).ravel()
    message.p = np.pad(camera.matrix, ((0, 0), (0, 1))).ravel()
    return message


def tag_message(wheel: str, tag: int, corners: Any, stamp: int, frame_id: str = 'camera') -> Any:
    """One tag as `tag_detections` carries it: its corners (4, 2) [px], from the top left of the upright tag on."""
    message = ImageMarker(
        ns=wheel,
        id=tag,
        type=ImageMarker.POLYGON,
        action=ImageMarker.ADD,
        scale=2.0,
        outline_color=ColorRGBA(r=1.0, g=0.5, b=0.1, a=1.0),
    )
    message.header.stamp, message.header.frame_id = to_stamp(stamp), frame_id
    message.points = [Point(x=x, y=y) for x, y in corners.tolist()]
    return message


def pose(message: Any) -> PoseSample:
    """The pose in a PoseStamped."""
    place, turn = message.pose.position, message.pose.orientation
    return PoseSample(stamp_ns(message.header.stamp), (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))

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

ENCODINGS = {
    'mono8': (1, 1),
    '8UC1': (1, 1),
    'mono16': (1, 2),
    '16UC1': (1, 2),
    'bgr8': (3, 1),
    '8UC3': (3, 1),
    'rgb8': (3, 1),
}
"""Encodings that are read: how many channels each has, and how many bytes a channel."""


def frame(message: Any) -> Frame:
    """The frame in an Image; where the encoding allows, its pixels are those of the message, not copied.

    Raises:
        ValueError: an encoding that is not read, or data that do not fill the picture.

    """
    return Frame(stamp_ns(message.header.stamp), _picture(message))


def _picture(message: Any) -> Picture:
    encoding, height, width, step = message.encoding, message.height, message.width, message.step
    if encoding not in ENCODINGS:
        raise ValueError(f'the encoding {encoding!r} is not read; let the camera send {", ".join(ENCODINGS)}')
    channels, size = ENCODINGS[encoding]
    row = width * channels * size
    data = np.frombuffer(message.data, np.uint8)
    if not (row and height) or step < row or data.size < step * (height - 1) + row:
        raise ValueError(f'{data.size} bytes in rows of {step} are no {encoding} picture of {width}x{height}')
    rows = np.lib.stride_tricks.as_strided(data, (height, row), (step, 1), writeable=False)
    if size == 2:  # the upper byte of each
        return rows[:, 0 if message.is_bigendian else 1 :: 2]
    if channels == 1:
        return rows
    colours = rows.reshape(height, width, channels)
    return _swapped(colours) if encoding == 'rgb8' else colours


def _swapped(colours: Picture) -> Picture:
    cv2 = opencv()
    return np.asarray(cv2.cvtColor(colours, cv2.COLOR_RGB2BGR), np.uint8)


def compressed_frame(message: Any) -> Frame:
    """The frame in a CompressedImage (JPEG, PNG and what else OpenCV decodes).

    Raises:
        ValueError: the data are no picture.

    """
    cv2 = opencv()
    data = np.frombuffer(message.data, np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_ANYCOLOR) if data.size else None
    if image is None:
        raise ValueError(f'{data.size} bytes of format {message.format!r} are no picture that OpenCV decodes')
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

"""Between messages and pictures, cameras and poses."""

import math
from array import array

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from dcdrw_msgs_py.camera import pinhole
from dcdrw_msgs_py.frame import Frame
from dcdrw_msgs_py.image_messages import (
    camera,
    camera_message,
    compressed_frame,
    frame,
    image_message,
    pose,
    tag_message,
)
from dcdrw_msgs_py.messages import to_stamp

RANDOM = np.random.default_rng(0)
GREY = RANDOM.integers(0, 256, (7, 5), np.uint8)
COLOUR = RANDOM.integers(0, 256, (7, 5, 3), np.uint8)


def message(encoding, rows, step=None, bigendian=False, width=5):
    """An Image of rows of bytes, each filled up to `step`."""
    rows = rows.reshape(rows.shape[0], -1)
    step = step or rows.shape[1]
    padded = np.pad(rows, ((0, 0), (0, step - rows.shape[1])), constant_values=77)
    made = Image(height=rows.shape[0], width=width, encoding=encoding, step=step, is_bigendian=int(bigendian))
    made.data = array('B', padded.tobytes())
    made.header.stamp = to_stamp(12_000_000_345)
    return made


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 9))
def test_every_encoding_is_read_whatever_the_step(more):
    assert (frame(message('mono8', GREY, 5 + more)).image == GREY).all()
    assert (frame(message('bgr8', COLOUR, 15 + more)).image == COLOUR).all()
    assert (frame(message('rgb8', COLOUR[..., ::-1], 15 + more)).image == COLOUR).all()
    assert frame(message('mono8', GREY)).stamp_ns == 12_000_000_345
    for bigendian in (False, True):
        deep = (GREY.astype(np.uint16) << 8 | 13).astype('>u2' if bigendian else '<u2').view(np.uint8)
        assert (frame(message('mono16', deep, 10 + more, bigendian)).image == GREY).all()


@pytest.mark.parametrize('bits', [10, 12, 14, 16])
@pytest.mark.parametrize('bigendian', [False, True])
def test_the_upper_bits_of_a_deep_picture_are_read(bits, bigendian):
    grey = GREY.copy()
    grey[0, 0] = 255
    deep = (grey.astype(np.uint16) << (bits - 8) | 1).astype('>u2' if bigendian else '<u2').view(np.uint8)
    assert (frame(message('mono16', deep, bigendian=bigendian)).image == grey).all()
    assert (frame(message('16UC1', deep, bigendian=bigendian)).image == grey).all()


@pytest.mark.parametrize('alpha', [0, 255])
def test_colours_are_read_in_every_order(alpha):
    pytest.importorskip('cv2')
    with_alpha = np.dstack((COLOUR, np.full((7, 5), alpha, np.uint8)))
    assert (frame(message('bgra8', with_alpha)).image == COLOUR).all()
    assert (frame(message('8UC4', with_alpha)).image == COLOUR).all()
    assert (frame(message('rgba8', with_alpha[..., (2, 1, 0, 3)])).image == COLOUR).all()
    bright = COLOUR.copy()
    bright[0, 0, 0] = 255
    deep = (bright.astype('<u2') << 8).view(np.uint8)
    assert (frame(message('bgr16', deep)).image == bright).all()


def test_the_brightness_of_yuv_is_read():
    packed = np.dstack((GREY, np.full_like(GREY, 128)))
    for encoding in ('yuv422_yuy2', 'yuyv'):
        assert (frame(message(encoding, packed)).image == GREY).all()
    for encoding in ('yuv422', 'uyvy', 'UYVY'):
        assert (frame(message(encoding, packed[..., ::-1])).image == GREY).all()
    for encoding in ('nv12', 'nv21', 'nv24'):
        planes = message(encoding, np.vstack((GREY, RANDOM.integers(0, 256, (4, 5), np.uint8))))
        planes.height = 7
        assert (frame(planes).image == GREY).all()


@pytest.mark.parametrize(
    ('pattern', 'red', 'blue'),
    [('rggb', (0, 0), (1, 1)), ('bggr', (1, 1), (0, 0)), ('gbrg', (1, 0), (0, 1)), ('grbg', (0, 1), (1, 0))],
)
def test_colours_behind_a_bayer_filter_are_told_apart(pattern, red, blue):
    """The reference is cv_bridge's own table of patterns; here: a red picture and a blue one."""
    pytest.importorskip('cv2')
    for (row, column), channel in ((red, 2), (blue, 0)):
        mosaic = np.zeros((8, 8), np.uint8)
        mosaic[row::2, column::2] = 200
        image = frame(message(f'bayer_{pattern}8', mosaic, width=8)).image
        assert image[2:6, 2:6, channel].min() == 200
        assert image[2:6, 2:6, 1].max() == 0
        assert image[2:6, 2:6, 2 - channel].max() == 0


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 40), st.integers(1, 40), st.booleans(), st.integers(0, 2**31 * 10**9 - 1))
def test_frames_survive(height, width, colour, stamp):
    image = RANDOM.integers(0, 256, (height, width, 3) if colour else (height, width), np.uint8)
    read = frame(image_message(Frame(stamp, image)))
    assert read.stamp_ns == stamp
    assert (read.image == image).all()


def test_compressed_frames_are_read():
    cv2 = pytest.importorskip('cv2')
    for image in (GREY, COLOUR):
        data = cv2.imencode('.png', image)[1].tobytes()
        read = compressed_frame(CompressedImage(format='png', data=array('B', data)))
        assert (read.image == image).all()


@pytest.mark.parametrize(
    ('bad', 'error'),
    [
        (message('yuv411', COLOUR), "the encoding 'yuv411' is not read; let the camera send mono8"),
        (message('bgr8', GREY), '35 bytes in rows of 5 are not a bgr8 picture of 5x7'),
        (Image(encoding='mono8', width=5, step=5), '0 bytes in rows of 5 are not a mono8 picture of 5x0'),
    ],
)
def test_what_is_no_picture_is_told(bad, error):
    with pytest.raises(ValueError, match=error):
        frame(bad)


def test_what_is_no_compressed_picture_is_told():
    pytest.importorskip('cv2')
    for data in (b'', b'nothing'):
        with pytest.raises(ValueError, match=f"{len(data)} bytes of format 'jpeg' are not a picture"):
            compressed_frame(CompressedImage(format='jpeg', data=array('B', data)))


def test_cameras_survive():
    given_ = pinhole(640, 480, 70.0)._replace(distortion=np.array((-0.2, 0.05, 1e-3, -1e-3, 0.01)))
    read = camera(camera_message(given_, 5))
    assert (read.width, read.height) == (640, 480)
    assert (read.matrix == given_.matrix).all()
    assert (read.distortion == given_.distortion).all()


def test_an_uncalibrated_camera_is_told():
    with pytest.raises(ValueError, match='calibrate the camera first'):
        camera(CameraInfo(width=640, height=480, distortion_model='plumb_bob'))


def test_poses_and_tags_are_read_and_written():
    made = PoseStamped()
    made.header.stamp = to_stamp(7)
    made.pose.position.x, made.pose.orientation.w = 1.5, 1.0
    assert pose(made) == (7, (1.5, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    corners = np.array(((1.0, 2.0), (3.0, 2.0), (3.0, 4.0), (1.0, math.pi)))
    tag = tag_message('front', 5, corners, 9)
    assert (tag.ns, tag.id, [[p.x, p.y] for p in tag.points]) == ('front', 5, corners.tolist())

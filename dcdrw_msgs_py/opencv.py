"""OpenCV, where it is installed: 4.6 (Ubuntu and Debian) to 5, whose ArUco modules differ."""

import os
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.tagging import FAMILIES


def opencv() -> Any:
    """The module cv2.

    Raises:
        ValueError: it is not installed, or was built without ArUco.

    """
    os.environ.setdefault('OPENCV_FFMPEG_LOGLEVEL', '-8')  # what is wrong with a video is told in one line of ours
    try:
        import cv2
    except ImportError:
        raise ValueError("pictures need OpenCV: apt install python3-opencv, or pip install 'dcdrw[camera]'") from None
    if not hasattr(cv2, 'aruco'):  # PyPI's opencv-python before 4.7
        raise ValueError(
            f'OpenCV {cv2.__version__} is here without its ArUco module: pip install '
            "'opencv-python-headless>=4.7', or opencv-contrib-python-headless of the same version"
        )
    return cv2


@cache
def tag_dictionary(family: str) -> Any:
    """ArUco's dictionary of an AprilTag family."""
    aruco = opencv().aruco
    return aruco.getPredefinedDictionary(getattr(aruco, f'DICT_APRILTAG_{family}'))


def tag_cells(family: str, tag: int) -> NDArray[np.bool_]:
    """A tag's cells as one looks at it upright, black border included, (n, n); True is white.

    Upright is what the AprilTag library's own pictures show. ArUco's are turned by half a turn.

    Raises:
        ValueError: the family has no such tag.

    """
    across, size = FAMILIES[family]
    if not 0 <= tag < size:
        raise ValueError(f'family {family} has the tags 0 to {size - 1}, not {tag}')
    cells = opencv().aruco.Dictionary_getBitsFromByteList(tag_dictionary(family).bytesList[tag : tag + 1], across)
    return np.pad(np.rot90(cells, 2) > 0, 1)

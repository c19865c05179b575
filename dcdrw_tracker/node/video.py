"""Video files and cameras as sources of frames."""

import math
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dcdrw_msgs_py.camera import Camera
from dcdrw_msgs_py.frame import Frame
from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.samples import SECOND

SLOWEST_RATE, FASTEST_RATE = 1e-3, 1e5
"""No file tells a rate beyond these in earnest [Hz]."""
LONGEST = 1e8
"""No frame is taken so long after the first [s]."""
RAW_RATE = 25.0
"""What FFmpeg makes of a stream without index and stamps (raw MJPEG, H.264) [Hz]."""
ENDS_EARLY = 0.98
"""A video that yields less than this share of the frames that it promises is truncated."""
PICTURES = '.png', '.jpg', '.jpeg', '.bmp', '.tif', '.tiff', '.webp', '.pgm', '.ppm'
"""Endings of pictures, which OpenCV takes for videos of one frame."""
LARGEST_PICTURE = 2**26
"""Pixels of a picture beyond which a video is taken to be damaged."""


class VideoFile:
    """A video file, frame by frame; `frame_rate` [Hz], where it is a number, takes the place of the file's own stamps.

    Raises:
        OSError: there is no such file, or it cannot be read.
        ValueError: it is not a video that can be read.

    """

    def __init__(self, path: Path, frame_rate: float = math.nan) -> None:
        cv2 = opencv()
        if path.is_dir():
            raise ValueError(f'{path} is a folder: a video is needed, which ffmpeg makes of pictures, too')
        if not path.is_file():
            raise FileNotFoundError(f'there is no video {path}')
        with path.open('rb'):  # OpenCV does not tell why it cannot
            pass
        self._path, self._given_rate = path, frame_rate
        self._capture = cv2.VideoCapture(str(path))
        if not self._capture.isOpened():
            raise ValueError(f'{path} is not a video that OpenCV reads, or it is truncated')
        width, height = self._told(cv2.CAP_PROP_FRAME_WIDTH), self._told(cv2.CAP_PROP_FRAME_HEIGHT)
        if width * height > LARGEST_PICTURE:
            raise ValueError(f'{path} claims pictures of {width:.0f} × {height:.0f} pixels, more than a camera takes')
        self.own_rate = self._told(cv2.CAP_PROP_FPS)
        """Frames per second that the file tells; 0 where it does not."""
        if not SLOWEST_RATE <= self.own_rate <= FASTEST_RATE:
            self.own_rate = 0.0
        self.count = int(self._told(cv2.CAP_PROP_FRAME_COUNT))
        """Frames that the file promises; 0 where it does not say."""
        if self.count <= 1 and path.suffix.lower() in PICTURES:
            raise ValueError(f'{path} is a picture: a video of the rig is needed')
        self.read = 0
        """Frames that have been read."""

    def _told(self, key: int) -> float:
        """What the file tells of itself; 0 where it is no number that can be."""
        value = float(self._capture.get(key))
        return value if 0.0 < value < math.inf else 0.0

    @property
    def complaint(self) -> str:
        """What is wrong with the file, once it has been read; empty where nothing is."""
        if self.read >= ENDS_EARLY * self.count:
            return ''
        return f'{self._path} ends after {self.read} of {self.count} frames: it is truncated'

    def frames(self, start_ns: int = 0) -> Iterator[Frame]:
        """Every frame, once; the first has the stamp `start_ns`.

        Raises:
            ValueError: neither the file nor `frame_rate` tells when the frames were taken.

        """
        cv2, first, last = opencv(), 0.0, -1.0
        no_stamps = f'{self._path} has no time stamps: set frame_rate to that of the camera'
        invented = self.count == 0 and self.own_rate in (0.0, RAW_RATE)
        if invented and math.isnan(self._given_rate):
            raise ValueError(no_stamps)
        while True:
            try:
                good, image = self._capture.read()
            except cv2.error:  # of any kind, for the content may be anything
                good = False
            if not good:
                self._capture.release()
                return
            time = self._capture.get(cv2.CAP_PROP_POS_MSEC) * 1e-3
            first, time = (time, 0.0) if self.read == 0 else (first, time - first)
            if math.isfinite(self._given_rate):
                time = self.read / self._given_rate
            elif not last < time < LONGEST:  # they stand still
                if not self.own_rate:
                    raise ValueError(no_stamps)
                time = last + 1.0 / self.own_rate
            self.read += 1
            last = time
            yield Frame(start_ns + round(time * SECOND), np.asarray(image, np.uint8))


class CameraDevice:
    """A camera of this machine (`/dev/video0`, `0`) or of the network (`rtsp://…`).

    Raises:
        OSError: it is not there.

    """

    def __init__(
        self, source: str, camera: Camera | None = None, frame_rate: float = math.nan, pixel_format: str = ''
    ) -> None:
        cv2 = opencv()
        index = source.removeprefix('/dev/video')
        if index.isdecimal() and not Path(f'/dev/video{index}').exists():
            raise OSError(f'there is no camera at /dev/video{index}')
        self._capture = cv2.VideoCapture(int(index), cv2.CAP_V4L2) if index.isdecimal() else cv2.VideoCapture(source)
        if not self._capture.isOpened():
            raise OSError(f'the camera at {source} cannot be opened: is it there, and used by nobody else?')
        wanted: dict[int, float] = {}
        if camera:
            wanted = {cv2.CAP_PROP_FRAME_WIDTH: camera.width, cv2.CAP_PROP_FRAME_HEIGHT: camera.height}
        if pixel_format:
            wanted[cv2.CAP_PROP_FOURCC] = cv2.VideoWriter.fourcc(*pixel_format)
        if math.isfinite(frame_rate):
            wanted[cv2.CAP_PROP_FPS] = frame_rate
        for key, value in wanted.items():
            self._capture.set(key, value)

    def read(self) -> Frame | None:
        """The next frame, as soon as it comes; None where the camera is gone.

        Its stamp is the driver's where that has one of the monotonic clock, as V4L2 does, else the time of arrival.
        """
        good, image = self._capture.read()
        if not good:
            return None
        age = time.monotonic() - self._capture.get(opencv().CAP_PROP_POS_MSEC) * 1e-3
        now = time.time_ns()
        return Frame(now - round(age * SECOND) if 0.0 <= age < 1.0 else now, np.asarray(image, np.uint8))

    def close(self) -> None:
        """Let the camera go."""
        self._capture.release()


def is_device(source: str) -> bool:
    """Whether a source is a camera rather than a file."""
    return source.isdecimal() or source.startswith('/dev/') or '://' in source

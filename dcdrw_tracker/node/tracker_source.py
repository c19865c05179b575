"""Where the tag tracker's frames, or the poses in their place, come from."""

import math
from typing import Annotated, NamedTuple

from dcdrw_msgs_py.quantity import Quantity

TOPIC, POSES = 'topic', 'poses'
RAW, COMPRESSED = 'raw', 'compressed'


class SourceParams(NamedTuple):
    """Where the frames, or the poses in their place, come from."""

    source: Annotated[
        str,
        Quantity(
            f'{TOPIC}: pictures from image_raw; {POSES}: motion capture from front_pose and rear_pose; or '
            'a video file, or a camera (0, /dev/video0, rtsp://…)'
        ),
    ] = TOPIC
    image_transport: Annotated[str, Quantity(f'of the topic: {RAW}, or {COMPRESSED} for image_raw/compressed')] = RAW
    camera: Annotated[
        str, Quantity('camera_info file (as config/camera.yaml); where none is named, the topic camera_info')
    ] = ''
    frame_rate: Annotated[
        float,
        Quantity(
            'of a camera: what it is asked for; of a video: in the place of its own stamps',
            'Hz',
            above=0.0,
            high=10_000.0,
            derived="the source's own",
        ),
    ] = math.nan
    pixel_format: Annotated[str, Quantity('what a camera is asked for, four letters as MJPG; empty: as it likes')] = ''
    detector: Annotated[
        str,
        Quantity(
            'what finds the tags: aruco (OpenCV), or apriltag (pupil-apriltags), slower, for small or blurred ones'
        ),
    ] = 'aruco'

    @property
    def opens_itself(self) -> bool:
        """Whether the node reads a file or a camera of its own."""
        return self.source not in (TOPIC, POSES)

    def check_source(self) -> None:
        """Refuse what cannot be read.

        Raises:
            ValueError: as told.

        """
        if self.image_transport not in (RAW, COMPRESSED):
            raise ValueError(f'image_transport must be {RAW} or {COMPRESSED}, got {self.image_transport!r}')
        if len(self.pixel_format) not in (0, 4):
            raise ValueError(f'pixel_format must be four letters, as MJPG, or empty, got {self.pixel_format!r}')
        if self.opens_itself and not self.camera:
            raise ValueError(
                f'the source {self.source} needs the parameter camera: the camera_info file, as '
                'camera_calibration writes it, of the camera that took it'
            )

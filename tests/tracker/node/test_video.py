"""Files and cameras as sources of frames."""

import math
import time
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from dcdrw_msgs_py.frame import Frame
from dcdrw_msgs_py.opencv import opencv
from dcdrw_tracker.node.frame_thread import FrameThread, Slot
from dcdrw_tracker.node.video import CameraDevice, VideoFile, is_device
from tests.patience import PATIENCE

cv2 = pytest.importorskip('cv2')


def grey(index):
    return np.full((48, 64, 3), 2 * index, np.uint8)


def write(path, count=60, rate=50.0):
    writer = opencv().VideoWriter(str(path), cv2.VideoWriter.fourcc(*'MJPG'), rate, (64, 48))
    assert writer.isOpened()
    for index in range(count):
        writer.write(grey(index))
    writer.release()
    return path


def await_(condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


# --- files ---------------------------------------------------------------------------------------------------------


def test_a_video_is_read_whole_with_its_own_stamps(tmp_path):
    video = VideoFile(write(tmp_path / 'a.avi'))
    frames = list(video.frames(5_000_000_000))
    assert (video.count, video.read, video.complaint) == (60, 60, '')
    assert [frame.stamp_ns for frame in frames] == [5_000_000_000 + 20_000_000 * i for i in range(60)]
    assert [round(frame.image.mean() / 2) for frame in frames] == pytest.approx(list(range(60)), abs=1)


def test_a_given_frame_rate_takes_the_place_of_the_files(tmp_path):
    """A high-speed camera's file often says 25 or 30 Hz."""
    stamps = [frame.stamp_ns for frame in VideoFile(write(tmp_path / 'a.avi', 5), 240.0).frames()]
    assert stamps == [round(i / 240 * 1e9) for i in range(5)]


@pytest.mark.parametrize('rate', [b'\0' * 8, b'\0\0\0\0\1\0\0\0', b'\1\0\0\0\0\0\0\0', b'\xff\xff\xff\x7f\1\0\0\0'])
def test_a_file_whose_rate_is_no_number_asks_for_one(rate, tmp_path):
    path = write(tmp_path / 'a.avi', 5)
    data = bytearray(path.read_bytes())
    at = data.index(b'strh') + 28  # scale and rate
    data[at : at + 8] = rate
    path.write_bytes(data)
    assert [frame.stamp_ns for frame in VideoFile(path, 50.0).frames()] == [20_000_000 * i for i in range(5)]
    stamps = []
    with suppress(ValueError):
        stamps += [frame.stamp_ns for frame in VideoFile(path).frames()]
    assert all(0 < later - earlier < 10**12 for earlier, later in pairwise(stamps))


def test_a_truncated_video_is_told_and_what_is_there_is_read(tmp_path):
    whole = write(tmp_path / 'a.avi')
    data = whole.read_bytes()
    whole.write_bytes(data[: len(data) * 6 // 10])
    video = VideoFile(whole)
    assert 20 < len(list(video.frames())) < 60
    assert video.complaint == f'{whole} ends after {video.read} of 60 frames: it is truncated'


def test_a_stream_without_stamps_needs_the_frame_rate(tmp_path):
    path = tmp_path / 'raw.mjpeg'
    path.write_bytes(b''.join(cv2.imencode('.jpg', grey(i))[1].tobytes() for i in range(30)))
    with pytest.raises(ValueError, match='has no time stamps: set frame_rate'):
        next(VideoFile(path).frames())
    stamps = [frame.stamp_ns for frame in VideoFile(path, 100.0).frames()]
    assert stamps == [10_000_000 * i for i in range(30)]


def test_what_is_no_video_is_told(tmp_path):
    with pytest.raises(FileNotFoundError, match='there is no video'):
        VideoFile(tmp_path / 'none.mp4')
    (tmp_path / 'text.mp4').write_text('no video')
    with pytest.raises(ValueError, match='is not a video that OpenCV reads, or it is truncated'):
        VideoFile(tmp_path / 'text.mp4')


def test_cameras_and_files_are_told_apart():
    assert all(map(is_device, ('0', '2', '/dev/video0', 'rtsp://10.0.0.2/stream')))
    assert not any(map(is_device, ('trial.mp4', '/data/trial.avi', 'topic')))


def test_a_camera_that_is_not_there_is_named():
    with pytest.raises(OSError, match='there is no camera at /dev/video99'):
        CameraDevice('/dev/video99')


# --- threads -------------------------------------------------------------------------------------------------------


def test_the_newest_item_is_kept_and_the_others_are_counted():
    slot = Slot()
    for item in range(5):
        slot.put(item)
    assert slot.take() == 4
    assert slot.dropped == 4
    slot.close()
    assert slot.take() is None


def test_a_file_is_handed_over_whole_however_slow_the_taker(tmp_path):
    slot = Slot()
    thread = FrameThread(slot)
    thread.play(VideoFile(write(tmp_path / 'a.avi'), 2000.0), 0)
    stamps = []
    for _ in range(60):
        time.sleep(0.001)
        stamps.append(slot.take().stamp_ns)
    assert stamps == [500_000 * i for i in range(60)]
    await_(lambda: thread.state == 'the video has ended after 60 frames')
    assert (thread.good, slot.dropped) == (True, 0)
    thread.close()


def test_a_file_is_played_no_faster_than_it_was_taken(tmp_path):
    slot = Slot()
    thread = FrameThread(slot)
    begin = time.monotonic()
    thread.play(VideoFile(write(tmp_path / 'a.avi', 10), 50.0), 0)
    for _ in range(10):
        frame = slot.take()
        assert time.monotonic() - begin >= frame.stamp_ns * 1e-9 - 1e-3
    thread.close()


class Plugged:
    """A camera that yields some frames and is then unplugged."""

    def __init__(self, count, start):
        self._frames = iter(range(start, start + count))
        self.closed = False

    def read(self):
        time.sleep(0.002)
        index = next(self._frames, None)
        return None if index is None else Frame(index, grey(index % 100))

    def close(self):
        self.closed = True


def test_a_camera_that_is_unplugged_is_told_and_found_again(monkeypatch):
    monkeypatch.setattr('dcdrw_tracker.node.frame_thread.RETRY_SECONDS', 0.05)
    first, second = Plugged(20, 0), Plugged(10_000, 1000)
    states = []

    def open_camera():
        states.append((thread.state, thread.good))
        if len(states) == 2:
            raise OSError('there is no camera at /dev/video0')
        return first if len(states) == 1 else second

    slot = Slot()
    thread = FrameThread(slot)
    thread.film(open_camera, '/dev/video0')
    await_(lambda: (frame := slot.take()) and frame.stamp_ns >= 1010)
    assert states == [
        ('starting', True),
        ('the camera at /dev/video0 is gone; it is looked for every 0.05 s', False),
        ('there is no camera at /dev/video0; it is looked for every 0.05 s', False),
    ]
    assert (thread.state, thread.good, first.closed) == ('filming', True, True)
    thread.close()
    await_(lambda: second.closed)


def test_stamps_of_every_source_grow(tmp_path):
    for name in ('a.avi', 'a.mkv'):
        stamps = [frame.stamp_ns for frame in VideoFile(write(tmp_path / name, 40, 29.97)).frames()]
        assert all(0 < b - a < 50_000_000 for a, b in pairwise(stamps))
        assert stamps[-1] == pytest.approx(39 / 29.97 * 1e9, abs=2e6)
        assert math.isfinite(stamps[0])


def test_a_picture_is_no_video(tmp_path):
    path = tmp_path / 'rig.PNG'
    assert opencv().imwrite(str(path), np.zeros((48, 64, 3), np.uint8))
    with pytest.raises(ValueError, match=r'rig\.PNG is a picture: a video of the rig is needed'):
        VideoFile(path)


def test_a_video_that_nobody_may_read_is_told_from_one_that_is_none(tmp_path, monkeypatch):
    def refuse(path, mode):
        raise PermissionError(13, 'Permission denied', str(path))

    path = write(tmp_path / 'a.avi')
    monkeypatch.setattr(Path, 'open', refuse)
    with pytest.raises(PermissionError, match=r'a\.avi'):
        VideoFile(path)


def test_a_folder_of_pictures_is_no_video(tmp_path):
    with pytest.raises(ValueError, match='is a folder: a video is needed, which ffmpeg makes of pictures'):
        VideoFile(tmp_path)

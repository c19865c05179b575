"""Frames from one thread to another: the reader of a file or a camera, and the slot through which it hands over."""

import time
from collections.abc import Callable
from contextlib import suppress
from threading import Condition, Event, Thread
from typing import Any, Generic, TypeVar

from dcdrw_msgs_py.frame import Frame
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.words import counted
from dcdrw_tracker.node.video import VideoFile

RETRY_SECONDS = 1.0
"""How often a camera that is not there is looked for."""
CLOSE_SECONDS = 2.0
"""A camera that is gone may keep its reader waiting longer; nobody waits for that."""

Item = TypeVar('Item')


class Slot(Generic[Item]):
    """Hands items from one thread to another: there is room for one, and the newest is kept."""

    def __init__(self) -> None:
        self._changed = Condition()
        self._item: Item | None = None
        self._closed = False
        self.taken = 0
        self.dropped = 0
        """Items that a newer one has replaced."""

    def put(self, item: Item) -> None:
        """Leave an item, in the place of one that was not taken."""
        with self._changed:
            self.dropped += self._item is not None
            self._item = item
            self._changed.notify_all()

    def put_waiting(self, item: Item) -> None:
        """Leave an item as soon as the last was taken."""
        with self._changed:
            self._changed.wait_for(lambda: self._item is None or self._closed)
            self._item = item
            self._changed.notify_all()

    def take(self) -> Item | None:
        """The newest item, as soon as there is one; None once the slot is closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._item is not None or self._closed)
            item, self._item = self._item, None
            self.taken += item is not None
            self._changed.notify_all()
            return None if self._closed else item

    def close(self) -> None:
        """Wake whoever waits, for good."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


class FrameThread:
    """Reads a source in a thread of its own, and hands its frames over through a slot."""

    def __init__(self, slot: Slot[Frame]) -> None:
        self._slot = slot
        self._end = Event()
        self._thread: Thread | None = None
        self.state = 'starting'
        """What to say of the source; it changes as the source does."""
        self.good = True
        """Frames come, or may come soon."""

    def play(self, video: VideoFile, start_ns: int) -> None:
        """Hand over a file's frames at the pace at which they were taken; none is dropped."""
        self._start(lambda: self._play(video, start_ns))

    def film(self, open_camera: Callable[[], Any], name: str) -> None:
        """Hand over a camera's frames as they come; a camera that goes is looked for until it is back.

        Args:
            open_camera: makes a `CameraDevice`, or raises OSError.
            name: the camera's, for messages.

        """
        self._start(lambda: self._film(open_camera, name))

    def close(self) -> None:
        """End the thread."""
        self._end.set()
        self._slot.close()
        if self._thread:
            self._thread.join(CLOSE_SECONDS)

    def _start(self, work: Callable[[], None]) -> None:
        self._thread = Thread(target=work, name='frames', daemon=True)
        self._thread.start()

    def _say(self, state: str, good: bool) -> None:
        self.state, self.good = state, good

    def _play(self, video: VideoFile, start_ns: int) -> None:
        self._say('playing', True)
        begin = time.monotonic()
        try:
            for frame in video.frames(start_ns):
                due = (frame.stamp_ns - start_ns) / SECOND - (time.monotonic() - begin)
                if self._end.wait(max(due, 0.0)):
                    return
                self._slot.put_waiting(frame)
        except ValueError as error:
            self._say(str(error), False)
            return
        self._say(video.complaint or f'the video has ended after {counted(video.read, "frame")}', not video.complaint)

    def _film(self, open_camera: Callable[[], Any], name: str) -> None:
        while not self._end.is_set():
            try:
                device = open_camera()
            except OSError as error:
                self._say(f'{error}; it is looked for every {RETRY_SECONDS:g} s', False)
            else:
                try:
                    self._read(device, name)
                finally:
                    with suppress(Exception):
                        device.close()
            self._end.wait(RETRY_SECONDS)

    def _read(self, device: Any, name: str) -> None:
        self._say('filming', True)
        while not self._end.is_set():
            frame = device.read()
            if frame is None:
                self._say(f'the camera at {name} is gone; it is looked for every {RETRY_SECONDS:g} s', False)
                return
            self._slot.put(frame)

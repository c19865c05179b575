"""Recordings: opened whoever made them, mended where their recorder was killed, read as messages and as joints."""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from itertools import groupby, islice
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from dcdrw.recordings.joint_batch import JointBatch, decode_joints
from dcdrw.recordings.recorder import METADATA, PARAMETERS, require_libraries

BATCH = 4096
"""Messages that are decoded at once."""
RECORDING = 'recording'
"""The folder of the recording within that of a trial."""
JOINT_STATE = 'sensor_msgs/msg/JointState'


class Message(NamedTuple):
    """One recorded message."""

    topic: str
    log_ns: int
    """When the recorder got it."""
    data: bytes
    """As it came off the wire (CDR)."""


class Recording(AbstractContextManager['Recording']):
    """An open recording: one by `dcdrw record`, `dcdrw trial` or `ros2 bag record`, in MCAP or sqlite3.

    One that was not closed is mended where it is: whole chunks are kept, and get the index that is missing.

    Args:
        path: the recording's folder, that of a trial, or an .mcap or .db3 file.

    Raises:
        ValueError: no recording, or one that cannot be read; or rosbags is missing.
        OSError: it cannot be read or mended.

    """

    def __init__(self, path: Path) -> None:
        require_libraries()
        from rosbags.rosbag2 import Reader

        from dcdrw.recordings.mending import is_closed, mend

        self.path = find(path)
        for file in [self.path] if self.path.is_file() else sorted(self.path.glob('*.mcap')):
            if not is_closed(file):
                mend(file)
        try:
            self._reader: Any = Reader(self.path)
            self._reader.open()
        except PermissionError:
            raise
        except Exception as error:  # of any kind, for the content may be anything
            raise ValueError(f'{path} cannot be read: {str(error) or type(error).__name__}') from None
        self.types: dict[str, str] = {c.topic: c.msgtype for c in self._reader.connections}
        """The topics, and their types."""
        self.start_ns: int = self._reader.start_time
        self.end_ns: int = self._reader.end_time
        """When the first message came, and just after the last."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        self._reader.close()

    @property
    def parameters(self) -> Path | None:
        """The parameters that the nodes had, as a file; None where they were not recorded."""
        file = (self.path if self.path.is_dir() else self.path.parent) / PARAMETERS
        return file if file.exists() else None

    def count(self, topic: str) -> int:
        """How many messages a topic has."""
        return sum(c.msgcount for c in self._reader.connections if c.topic == topic)

    def find(self, name: str, kind: str = JOINT_STATE) -> str:
        """The topic of this name, in whatever namespace.

        Raises:
            ValueError: there is none, or one in several namespaces.

        """
        found = [
            topic
            for topic, its in self.types.items()
            if its == kind and (topic == name or topic.endswith(f'/{name.lstrip("/")}'))
        ]
        if len(found) == 1:
            return found[0]
        others = ', '.join(topic for topic, its in self.types.items() if its == kind) or 'none'
        raise ValueError(
            f'{self.path} has {"several topics" if found else "no topic"} {name} of {kind}; '
            f'of this type it has: {others}'
        )

    def messages(
        self, topics: Sequence[str], start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[Message]:
        """The messages of these topics that came from start to before stop, in the order in which they came.

        Raises:
            ValueError: the recording is damaged.

        """
        for connection, log_ns, data in self._read(topics, start_ns, stop_ns):
            yield Message(connection.topic, log_ns, data)

    def joints(self, topic: str, start_ns: int | None = None, stop_ns: int | None = None) -> Iterator[JointBatch]:
        """The JointState messages of a topic, decoded many at once, and cut where the names or the frame change."""
        messages = ((log_ns, data) for _, log_ns, data in self._read([topic], start_ns, stop_ns))
        for _, group in groupby(messages, lambda message: len(message[1])):
            while batch := list(islice(group, BATCH)):
                yield from decode_joints([data for _, data in batch], [log_ns for log_ns, _ in batch])

    def _read(self, topics: Sequence[str], start_ns: int | None, stop_ns: int | None) -> Iterator[Any]:
        connections = [c for c in self._reader.connections if c.topic in topics]
        if not connections:
            return
        try:
            yield from self._reader.messages(connections, start_ns, stop_ns)
        except OSError:
            raise
        except Exception as error:  # of any kind, for the content may be anything
            raise ValueError(f'{self.path} is damaged: {str(error) or type(error).__name__}') from None


def find(path: Path) -> Path:
    """The folder with metadata.yaml, or the lone file, that a path means.

    Raises:
        ValueError: there is none.

    """
    if not path.exists():
        raise ValueError(f'{path} does not exist')
    if path.is_file():
        if path.suffix in ('.mcap', '.db3'):
            return path
        raise ValueError(f'{path} is no recording: give its folder, an .mcap or a .db3 file')
    for folder in (path, path / RECORDING):
        if (folder / METADATA).exists():
            return folder
        files = [file for kind in ('*.mcap', '*.db3') for file in sorted(folder.glob(kind))]
        if len(files) == 1:
            return files[0]
        if files:
            raise ValueError(f'{folder} has several files but no {METADATA}: run ros2 bag reindex {folder}')
    raise ValueError(f'{path} is no recording: it has neither {METADATA} nor an .mcap or .db3 file')

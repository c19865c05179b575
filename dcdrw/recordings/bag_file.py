"""What the files of a recording have in common, whatever their storage."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from dcdrw.recordings.decompression import LARGEST, ZSTD_MAGIC, decompress

CDR = 'cdr'


class Stream(NamedTuple):
    """What makes messages belong together: a topic of one name may carry several types, each a stream of its own."""

    name: str
    """Of the topic."""
    type: str
    serialization: str = CDR


class Message(NamedTuple):
    """One recorded message."""

    topic: Stream
    log_ns: int
    """When the recorder got it."""
    data: bytes
    """The message as it came off the wire (CDR)."""


class RecordedTopic(NamedTuple):
    """A topic as rosbag2's metadata describe it."""

    name: str
    type: str
    hash: str = ''
    """Hash of the type (RIHS01)."""
    qos: str = ''
    """What its publishers offer, as YAML."""
    definition: str = ''
    """Definition of the type and of the types within it; empty where it is not known."""
    definition_format: str = ''
    """`ros2msg` or `ros2idl`."""
    serialization: str = CDR

    @property
    def stream(self) -> Stream:
        """What its messages are found by."""
        return Stream(self.name, self.type, self.serialization)


class BagFile(ABC):
    """One file of a recording, open for reading, with the topics and counts that it holds.

    What is damaged is left out; `damage` tells what, after `messages` has passed it at the latest.
    """

    def __init__(self, path: Path, name: str) -> None:
        self.path = path
        self.name = name
        """For messages: the file's name as it was given."""
        self.topics: dict[Stream, RecordedTopic] = {}
        self.counts: dict[Stream, int] = {}
        self.start_ns = self.end_ns = 0
        """When the first and the last message came."""
        self.closed = True
        """Whether its writer came to an end."""
        self._damage: dict[Any, str] = {}

    @property
    def damage(self) -> list[str]:
        """What was left out, each with the reason."""
        return list(self._damage.values())

    @abstractmethod
    def messages(self, topics: Collection[Stream], start_ns: int, stop_ns: int) -> Iterator[Message]:
        """The messages of these topics from start to before stop, in the order in which they came."""

    @abstractmethod
    def close(self) -> None:
        """Close it."""

    def _whole(self, data: bytes) -> bytes:
        """A message as it came off the wire; empty where its compressed bytes are damaged."""
        if data[:4] != ZSTD_MAGIC:  # no CDR begins so
            return data
        plain = decompress(data, 'zstd')
        return plain if len(plain) <= LARGEST else b''


def full_type(kind: str) -> str:
    """The name of a type as ROS 2 has it, of one that may be written as ROS 1 does."""
    return kind.replace('/', '/msg/') if kind.count('/') == 1 else kind

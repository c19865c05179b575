"""The recorder: messages as they came off the wire into a rosbag2 recording (MCAP) that no crash spoils.

MCAP is written by the official library: its chunks can be closed and flushed at will, where rosbags' writer keeps up
to a megabyte for itself. Whole chunks are all that a killed recorder leaves, and all that a reader needs.
"""

import fcntl
import os
import platform
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import dcdrw
from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.yaml_file import yaml_text

FLUSH_SECONDS = 0.5
"""How often a recorder flushes: what a kill loses at most [s]."""
METADATA = 'metadata.yaml'
PARAMETERS = 'parameters.yaml'

INFORMATION = 'rosbag2_bagfile_information'
_VERSION = 9  # of rosbag2's metadata, as Jazzy writes it
_INFINITE = {'sec': 9223372036, 'nsec': 854775807}


def require_libraries() -> None:
    """Make sure that the libraries of recordings are there.

    Raises:
        ValueError: one is missing; the message says what to install.

    """
    try:
        import mcap  # noqa: F401
        import rosbags  # noqa: F401
    except ImportError:
        raise ValueError("a recording needs rosbags and mcap: pip install 'dcdrw[record]'") from None


class RecorderParams(NamedTuple):
    """What the recorder writes, and where to."""

    folder: Annotated[
        str,
        Quantity(
            "the recording's folder, which must not exist; empty: recordings/DATE-TIME, a new one for each", live=True
        ),
    ] = ''
    note: Annotated[str, Quantity('what the operator has to say of the recording', live=True)] = ''
    topics: Annotated[
        str,
        Quantity(
            'further topics, images for instance, separated by spaces, or each with its type as NAME:TYPE',
        ),
    ] = ''
    record: Annotated[bool, Quantity('begin at once: else when ~/record says so')] = False


class RecordedTopic(NamedTuple):
    """A topic as rosbag2's metadata describe it."""

    name: str
    type: str
    hash: str
    """Of the type (RIHS01)."""
    qos: list[dict[str, Any]]
    """What its publishers offer."""


class Span(NamedTuple):
    """What a recording holds."""

    counts: dict[str, int]
    """Messages by topic."""
    start_ns: int
    end_ns: int
    """When the first and the last message came."""


def offered_qos(reliable: bool, latched: bool, depth: int = 0) -> dict[str, Any]:
    """A QoS profile as rosbag2 writes it; depth 0: unknown, for DDS does not tell it."""
    return {
        'history': 'keep_last' if depth else 'unknown',
        'depth': depth,
        'reliability': 'reliable' if reliable else 'best_effort',
        'durability': 'transient_local' if latched else 'volatile',
        'deadline': _INFINITE,
        'lifespan': _INFINITE,
        'liveliness': 'automatic',
        'liveliness_lease_duration': _INFINITE,
        'avoid_ros_namespace_conventions': False,
    }


def new_folder() -> Path:
    """A folder for a recording of now."""
    return Path('recordings') / datetime.now().strftime('%Y%m%d-%H%M%S')


def origin() -> dict[str, str]:
    """Who records: version, git revision of the source where it is a working copy, machine."""
    here = Path(dcdrw.__file__).parent.parent
    revision = ''
    if (here / '.git').exists():
        with suppress(OSError):
            revision = subprocess.run(
                ['git', '-C', here, 'describe', '--always', '--dirty', '--abbrev=12'],
                capture_output=True,
                text=True,
                check=False,
            ).stdout.strip()
    try:
        release = version('dcdrw')
    except PackageNotFoundError:
        release = ''
    return {
        'dcdrw_version': release,
        'git_revision': revision,
        'machine': f'{platform.node()}: {platform.platform()}, Python {platform.python_version()}',
        'started': datetime.now().astimezone().isoformat(timespec='seconds'),
    }


class Recorder:
    """Writes one recording.

    `about` is kept with it (rosbag2's custom_data) and may change while it runs. What is written up to a `flush`
    survives a kill. A disk that is full, or any other OSError, ends the recording; what was flushed stays.

    Raises:
        ValueError: the folder exists, or a library is missing.
        OSError: the folder cannot be made.

    """

    def __init__(self, folder: Path, about: Mapping[str, str] | None = None) -> None:
        require_libraries()
        from mcap.writer import CompressionType, Writer
        from rosbags.typesys import Stores, get_typestore

        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise ValueError(f'{folder} exists already, not overwriting') from None
        self.folder = folder
        self.about = origin() | dict(about or {})
        self.counts: dict[str, int] = {}
        """Messages by topic."""
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._topics: dict[str, RecordedTopic] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._file = _WholeFile(folder / f'{folder.resolve().name}_0.mcap')
        self._writer: Any = Writer(self._file, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        # Wall time at the start, and from there on a clock that never jumps: the log stays in order.
        self._zero_ns = time.time_ns() - time.monotonic_ns()
        self._start_ns = self._end_ns = 0
        self._writer.start('ros2', f'dcdrw {self.about["dcdrw_version"]}')
        self._note_metadata()
        self.flush()

    @property
    def size(self) -> int:
        """Bytes on the disk."""
        return self._file.size

    def add_topic(self, name: str, kind: str, qos: Sequence[dict[str, Any]]) -> None:
        """Add a topic, with what its publishers offer.

        Raises:
            ValueError: the type is not one of ROS 2 Jazzy's own, so its definition is not known.

        """
        if kind not in self._types.types:
            raise ValueError(f'{name} is not recorded: the definition of {kind} is not known')
        if kind not in self._schemas:
            definition, _ = self._types.generate_msgdef(kind, ros_version=2)
            self._schemas[kind] = self._writer.register_schema(kind, 'ros2msg', definition.encode())
        topic = RecordedTopic(name, kind, self._types.hash_rihs01(kind), list(qos))
        self._topics[name] = topic
        self._channels[name] = self._writer.register_channel(
            name,
            'cdr',
            self._schemas[kind],
            {'offered_qos_profiles': yaml_text(topic.qos).strip(), 'topic_type_hash': topic.hash},
        )
        self.counts[name] = 0

    def write(self, topic: str, data: bytes, log_ns: int | None = None) -> None:
        """Take a serialized message (CDR) that has come at a time, by default now."""
        now = self._zero_ns + time.monotonic_ns() if log_ns is None else log_ns
        self._writer.add_message(self._channels[topic], now, data, now)
        self.counts[topic] += 1
        self._start_ns, self._end_ns = self._start_ns or now, now

    def flush(self) -> None:
        """Bring to the disk what there is, and the metadata to its state.

        Raises:
            OSError: the disk is full, say.

        """
        self._writer.flush()
        self._write_metadata()

    def close(self) -> None:
        """End the recording with its index.

        Raises:
            OSError: as `flush`; what was flushed before stays, and is indexed when it is opened.

        """
        try:
            self._note_metadata()
            self._writer.finish()
            self._file.flush()
            self._write_metadata()
        finally:
            self._file.close()

    def abort(self) -> None:
        """End the recording without its index, after an OSError."""
        self._file.close()

    def _metadata(self) -> dict[str, Any]:
        return bag_metadata(
            self._file.path.name,
            list(self._topics.values()),
            Span(self.counts, self._start_ns, self._end_ns),
            self.about,
        )

    def _note_metadata(self) -> None:
        """The metadata within the file, as rosbag2 does it."""
        self._writer.add_metadata('rosbag2', {'serialized_metadata': yaml_text(self._metadata()[INFORMATION])})

    def _write_metadata(self) -> None:
        write_whole(self.folder / METADATA, yaml_text(self._metadata()))


def bag_metadata(file: str, topics: Sequence[RecordedTopic], span: Span, about: Mapping[str, str]) -> dict[str, Any]:
    """The content of metadata.yaml: rosbag2's rosbag2_storage/yaml.hpp."""
    extent = {
        'duration': {'nanoseconds': span.end_ns - span.start_ns},
        'starting_time': {'nanoseconds_since_epoch': span.start_ns},
        'message_count': sum(span.counts.values()),
    }
    return {
        INFORMATION: {
            'version': _VERSION,
            'storage_identifier': 'mcap',
            **extent,
            'topics_with_message_count': [
                {
                    'topic_metadata': {
                        'name': topic.name,
                        'type': topic.type,
                        'serialization_format': 'cdr',
                        'offered_qos_profiles': topic.qos,
                        'type_description_hash': topic.hash,
                    },
                    'message_count': span.counts.get(topic.name, 0),
                }
                for topic in topics
            ],
            'compression_format': '',
            'compression_mode': '',  # chunks are compressed by MCAP itself
            'relative_file_paths': [file],
            'files': [{'path': file, **extent}],
            'custom_data': dict(about),
            'ros_distro': os.environ.get('ROS_DISTRO', 'jazzy'),
        }
    }


def write_whole(path: Path, text: str) -> None:
    """Write a file so that whoever reads it, and whenever a kill comes, finds the old content or the new."""
    new = path.with_suffix(f'{path.suffix}.new')
    try:
        new.write_text(text, encoding='utf-8')
        new.replace(path)
    except OSError:
        with suppress(OSError):
            new.unlink()
        raise


class _WholeFile:
    """A new file that grows by what was written between two flushes, or not at all. Locked while it grows."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = 0
        self._file = path.open('xb', buffering=0)
        fcntl.flock(self._file, fcntl.LOCK_EX)
        self._pending = bytearray()

    def write(self, data: bytes) -> int:
        self._pending += data
        return len(data)

    def tell(self) -> int:
        return self.size + len(self._pending)

    def flush(self) -> None:
        rest = memoryview(bytes(self._pending))
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError:
            self._file.truncate(self.size)
            raise
        self.size += len(self._pending)
        self._pending.clear()

    def close(self) -> None:
        self._file.close()

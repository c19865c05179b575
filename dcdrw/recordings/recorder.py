"""The recorder: messages as they came off the wire into a rosbag2 recording (MCAP) that no crash spoils.

MCAP is written by the official library: its chunks can be closed and flushed at will, where rosbags' writer keeps up
to a megabyte for itself. Whole chunks are all that a killed recorder leaves, and all that a reader needs.
"""

import os
import platform
import subprocess
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from datetime import datetime
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import dcdrw
from dcdrw.recordings.bag_file import RecordedTopic, Stream
from dcdrw_msgs_py.yaml_file import parse_yaml, yaml_text

FLUSH_SECONDS = 0.5
"""How often a recorder flushes: what a kill loses at most, and with as much again a loss of power [s]."""
METADATA = 'metadata.yaml'
PARAMETERS = 'parameters.yaml'

INFORMATION = 'rosbag2_bagfile_information'
_LONGEST_QOS = 2**16
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
    survives a kill, and a loss of power as soon as the disk has it, which a thread sees to. A disk that is full, or any
    other OSError, ends the recording; what was flushed stays.

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
        self.counts: dict[Stream, int] = {}
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._topics: dict[Stream, RecordedTopic] = {}
        self._channels: dict[Stream, int] = {}
        """Channels of the topics that have a message; a topic without one is left out of the recording."""
        self._schemas: dict[str, int] = {}
        self._described = b''
        """New topics, for the file to name them outside of the chunk that does: a damaged chunk costs none its name."""
        self._file = _WholeFile(folder / f'{folder.resolve().name}_0.mcap')
        self._writer: Any = Writer(self._file, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        # Wall time at the start, and from there on a clock that never jumps: the log stays in order.
        self._zero_ns = time.time_ns() - time.monotonic_ns()
        self._start_ns = self._end_ns = 0
        self._disk = ThreadPoolExecutor(1, 'disk')
        self._syncing: Future[None] | None = None
        self._writer.start('ros2', f'dcdrw {self.about["dcdrw_version"]}')
        self._note_metadata()
        self.flush()

    @property
    def size(self) -> int:
        """Bytes on the disk."""
        return self._file.size

    def add_topic(self, name: str, kind: str, qos: Sequence[dict[str, Any]]) -> Stream:
        """Add a topic, or tell anew what its publishers offer; returns what `write` knows it by.

        Raises:
            ValueError: the type is not one of ROS 2 Jazzy's own, so its definition is not known.

        """
        if kind not in self._types.types:
            raise ValueError(f'{name} is not recorded: the definition of {kind} is not known')
        definition, _ = self._types.generate_msgdef(kind, ros_version=2)
        return self.add(
            RecordedTopic(
                name, kind, self._types.hash_rihs01(kind), yaml_text(list(qos)).strip(), definition, 'ros2msg'
            )
        )

    def add(self, topic: RecordedTopic) -> Stream:
        """Add a topic that is described already; returns what `write` knows it by."""
        self._topics[topic.stream] = topic
        self.counts.setdefault(topic.stream, 0)
        return topic.stream

    def write(self, topic: Stream, data: bytes, log_ns: int | None = None) -> None:
        """Take a serialized message (CDR) that has come at a time, by default now."""
        now = self._zero_ns + time.monotonic_ns() if log_ns is None else log_ns
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._register(self._topics[topic])
        self._writer.add_message(channel, now, data, now)
        self.counts[topic] += 1
        self._start_ns, self._end_ns = min(self._start_ns or now, now), max(self._end_ns, now)

    def flush(self) -> None:
        """Hand to the operating system what there is, and begin to bring it to the disk.

        Raises:
            OSError: the disk is full, say, or was when the last flush was brought there.

        """
        self._writer.flush()
        if self._described:
            self._file.write(self._described)
            self._file.flush()
            self._described = b''
        if self._syncing and self._syncing.done():
            self._syncing.result()
            self._syncing = None
        if self._syncing is None:
            self._syncing = self._disk.submit(self._sync, self._metadata())

    def close(self) -> None:
        """End the recording with its index.

        Raises:
            OSError: as `flush`; what was flushed before stays.

        """
        try:
            self._note_metadata()
            self._writer.finish()
            self._file.flush()
            if self._syncing:
                self._syncing.result()
            self._sync(self._metadata())
        finally:
            self.abort()

    def abort(self) -> None:
        """End the recording without its index, after an OSError."""
        self._disk.shutdown()
        self._file.close()

    def _register(self, topic: RecordedTopic) -> int:
        """Describe a topic in the file, when its first message comes."""
        from mcap.data_stream import RecordBuilder
        from mcap.records import Channel, Schema

        definition = topic.definition.encode()
        if topic.type not in self._schemas:
            self._schemas[topic.type] = self._writer.register_schema(topic.type, topic.definition_format, definition)
        schema = Schema(self._schemas[topic.type], definition, topic.definition_format, topic.type)
        about = {'offered_qos_profiles': topic.qos, 'topic_type_hash': topic.hash}
        key = int(self._writer.register_channel(topic.name, topic.serialization, schema.id, about))
        builder = RecordBuilder()
        schema.write(builder)
        Channel(key, topic.name, topic.serialization, about, schema.id).write(builder)
        self._described += builder.end()  # type: ignore[no-untyped-call]
        return key

    def _metadata(self) -> dict[str, Any]:
        """The content of metadata.yaml: rosbag2's rosbag2_storage/yaml.hpp."""
        extent = {
            'duration': {'nanoseconds': self._end_ns - self._start_ns},
            'starting_time': {'nanoseconds_since_epoch': self._start_ns},
            'message_count': sum(self.counts.values()),
        }
        file = self._file.path.name
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
                            'serialization_format': topic.serialization,
                            'offered_qos_profiles': _profiles(topic.qos),
                            'type_description_hash': topic.hash,
                        },
                        'message_count': self.counts[topic.stream],
                    }
                    for topic in map(self._topics.__getitem__, self._channels)
                ],
                'compression_format': '',
                'compression_mode': '',  # chunks are compressed by MCAP itself
                'relative_file_paths': [file],
                'files': [{'path': file, **extent}],
                'custom_data': dict(self.about),
                'ros_distro': os.environ.get('ROS_DISTRO', 'jazzy'),
            }
        }

    def _note_metadata(self) -> None:
        """The metadata within the file, as rosbag2 does it."""
        self._writer.add_metadata('rosbag2', {'serialized_metadata': yaml_text(self._metadata()[INFORMATION])})

    def _sync(self, metadata: dict[str, Any]) -> None:
        """Bring to the disk what was flushed, and then the metadata, which count no message that is not there."""
        self._file.sync()
        write_whole(self.folder / METADATA, yaml_text(metadata))


@lru_cache
def _profiles(qos: str) -> list[Any]:
    """QoS profiles from their text, which may come from a damaged recording."""
    try:
        profiles = parse_yaml(qos[:_LONGEST_QOS])
    except ValueError:
        return []
    return profiles if isinstance(profiles, list) else []


def write_whole(path: Path, text: str) -> None:
    """Write a file so that whoever reads it, and whenever a kill comes, finds the old content or the new."""
    new = path.with_suffix(f'{path.suffix}.new')
    try:
        with new.open('w', encoding='utf-8') as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
        _sync_folder(path.parent)
    except OSError:
        with suppress(OSError):
            new.unlink()
        raise


def _sync_folder(folder: Path) -> None:
    """Bring to the disk which files a folder has."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


class _WholeFile:
    """A new file that grows by what was written between two flushes, or not at all."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = 0
        self._file = path.open('xb', buffering=0)
        _sync_folder(path.parent)
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

    def sync(self) -> None:
        """Bring to the disk what was flushed."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        self._file.close()

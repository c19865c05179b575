"""Recordings: opened whoever made them, read as messages and as joints, and never written to."""

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from itertools import groupby, islice
from pathlib import Path
from types import TracebackType
from typing import Any

from dcdrw.console import in_words
from dcdrw.recordings.bag_file import CDR, BagFile, Message, RecordedTopic, Stream
from dcdrw.recordings.bag_folder import COMPRESSIONS, find_bag
from dcdrw.recordings.joint_batch import JointBatch, decode_joints
from dcdrw.recordings.recorder import PARAMETERS, require_libraries
from dcdrw_msgs_py.text_file import one_line
from dcdrw_msgs_py.words import by_count, counted, listed

BATCH = 4096
"""Messages that are decoded at once."""
JOINT_STATE = 'sensor_msgs/msg/JointState'
_NAMED = 5
"""Things of one kind that are named in a message at most."""
_FIRST, _LAST = -(2**63), 2**64


class Recording(AbstractContextManager['Recording']):
    """An open recording: one by `dcdrw record`, `dcdrw trial` or `ros2 bag record`, in MCAP or sqlite3.

    No file of it is written to or locked, and none is made beside it. What is damaged is left out, and told in
    `damage`; the recording may be one that somebody is still writing.

    Args:
        path: the recording's folder, that of a trial, or a file of it, compressed or not.

    Raises:
        ValueError: no recording, or none of its files can be read; or a library is missing.
        OSError: its folder cannot be read.

    """

    def __init__(self, path: Path) -> None:
        require_libraries()
        bag = find_bag(path)
        self.path = bag.path
        """Its folder, or its lone file."""
        self.about = bag.about
        """What was kept with it (rosbag2's custom_data)."""
        self._notes = list(bag.notes)
        self._lost = list(bag.lost)
        self._files: list[BagFile] = []
        self._stack = ExitStack()
        try:
            for file in bag.files:
                self._open(file)
            if not self._files:
                raise ValueError('; '.join(self._lost))
        except BaseException:
            self._stack.close()
            raise
        self._files.sort(key=lambda file: file.start_ns)
        self.topics: dict[Stream, RecordedTopic] = {}
        for one in self._files:
            for stream, topic in one.topics.items():
                self.topics.setdefault(stream, topic)
        self._notes += self._names_of_several()
        filled = [one for one in self._files if any(one.counts.values())]
        self.start_ns: int = min((one.start_ns for one in filled), default=0)
        self.end_ns: int = max((one.end_ns for one in filled), default=-1) + 1
        """When the first message came, and just after the last."""
        count = sum(map(self.count, self.topics))
        if count < bag.messages and not self.damage:
            self._lost.append(
                f'the metadata of {path} tell of {counted(bag.messages, "message")}, '
                f'{count} {by_count(count, "is", "are")} there'
            )

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        self._stack.close()

    @property
    def damage(self) -> list[str]:
        """What was left out, and why: complete when every message was read."""
        return [*self._lost, *(text for file in self._files for text in file.damage)]

    @property
    def notes(self) -> list[str]:
        """What is not as it should be, but costs nothing; and where something is amiss, what can be done."""
        unclosed = [
            f'{file.name} was not closed: its recorder was killed, or is at work; what it has so far is read'
            for file in self._files
            if not file.closed
        ]
        hint = [f'`dcdrw mend {self.path} --out NEW` writes what can be read into a new recording']
        return [*self._notes, *unclosed, *(hint if unclosed or self.damage else [])]

    @property
    def parameters(self) -> Path | None:
        """The parameters that the nodes had, as a file; None where they were not recorded."""
        file = (self.path if self.path.is_dir() else self.path.parent) / PARAMETERS
        return file if file.exists() else None

    def count(self, topic: Stream) -> int:
        """How many messages a topic has."""
        return sum(file.counts.get(topic, 0) for file in self._files)

    def found(self, name: str, kind: str = JOINT_STATE, namespace: str = '') -> list[Stream]:
        """The topics of this name and type, in this namespace, or in whatever one they are."""
        end = '/'.join(('', *namespace.strip('/').split('/'), name.lstrip('/'))).replace('//', '/')
        return [
            topic
            for topic in self.of_type(kind)
            if topic.name == name or (topic.name == end if namespace else topic.name.endswith(end))
        ]

    def of_type(self, kind: str) -> list[Stream]:
        """The topics of a type, as ROS 2 reads them."""
        return [topic for topic in self.topics if (topic.type, topic.serialization) == (kind, CDR)]

    def find(self, name: str, kind: str = JOINT_STATE, namespace: str = '') -> Stream:
        """The topic of this name and type, in this namespace, or in whatever one there is.

        Raises:
            ValueError: there is none, or one in several namespaces.

        """
        found = self.found(name, kind, namespace)
        if len(found) == 1:
            return found[0]
        if found:
            spaces = sorted(one_line(topic.name).removesuffix(f'/{name.lstrip("/")}') or '/' for topic in found)
            raise ValueError(
                f'{self.path} has several suites with {name}: choose one with --namespace {listed(spaces, " or ")}'
            )
        others = listed(one_line(topic.name) for topic in self.of_type(kind)) or 'none'
        namesakes = [
            f'; its {one_line(topic.name)} is of {_kind(topic)}'
            for topic in self.topics
            if topic.name.endswith(f'/{name.lstrip("/")}')
        ]
        raise ValueError(
            f'{self.path} has no topic {name} of {kind}{f" in {namespace}" if namespace else ""}; '
            f'of this type it has: {others}{"".join(namesakes[:_NAMED])}'
        )

    def messages(self, topics: Sequence[Stream], start_ns: int = _FIRST, stop_ns: int = _LAST) -> Iterator[Message]:
        """The messages of these topics that came from start to before stop, in the order in which they came."""
        for file in self._files:
            there = [topic for topic in topics if topic in file.topics]
            if there and file.start_ns < stop_ns and start_ns <= file.end_ns:
                yield from file.messages(there, start_ns, stop_ns)

    def joints(self, topic: Stream, start_ns: int = _FIRST, stop_ns: int = _LAST) -> Iterator[JointBatch]:
        """The JointState messages of a topic, decoded many at once, and cut where the names or the frame change."""
        messages = ((log_ns, data) for _, log_ns, data in self.messages([topic], start_ns, stop_ns))
        for _, group in groupby(messages, lambda message: len(message[1])):
            while batch := list(islice(group, BATCH)):
                yield from decode_joints([data for _, data in batch], [log_ns for log_ns, _ in batch])

    def decoded(
        self, topics: Sequence[Stream], start_ns: int = _FIRST, stop_ns: int = _LAST
    ) -> Iterator[tuple[Stream, int, Any]]:
        """The messages of these topics as rosbags decodes them: topic, log time, message; damaged ones are left out."""
        from rosbags.typesys import Stores, get_typestore

        if not self.topics.keys() & set(topics):
            return
        types = get_typestore(Stores.ROS2_JAZZY)
        for topic, log_ns, data in self.messages(topics, start_ns, stop_ns):
            try:
                message = types.deserialize_cdr(data, topic.type)
            except Exception:  # of any kind, for the content may be anything
                text = f'{self.path}: messages of {one_line(topic.name)} are malformed'
                self._lost.extend([] if text in self._lost else [text])
                continue
            yield topic, log_ns, message

    def _names_of_several(self) -> list[str]:
        """The names that carry messages of more than one type."""
        streams: dict[str, list[str]] = {}
        for topic in self.topics:
            if count := self.count(topic):
                streams.setdefault(topic.name, []).append(f'{_kind(topic)} ({counted(count, "message")})')
        several = {name: kinds for name, kinds in streams.items() if len(kinds) > 1}
        return [
            f'{self.path}: {one_line(name)} carries messages of several types: {", ".join(kinds[:_NAMED])}'
            for name, kinds in islice(several.items(), _NAMED)
        ]

    def _open(self, path: Path) -> None:
        """Open a file; one that is none costs only itself where there are others."""
        from dcdrw.recordings import mcap_file, sqlite_file
        from dcdrw.recordings.decompression import unpack_file

        name, inner, plain = str(path), path, path.with_suffix('')
        try:
            if path.suffix in COMPRESSIONS:
                has_end = (mcap_file if plain.suffix == '.mcap' else sqlite_file).has_end
                inner = self._scratch() / plain.name
                trouble, unended = unpack_file(path, inner)
                whole = has_end(inner) and (unended or not trouble)
                if not whole and self.path.is_dir() and plain.is_file() and has_end(plain):
                    self._notes.append(f'{name} is not whole; {plain.name} is read in its place')
                    name, inner = str(plain), plain
                elif trouble and not whole:
                    self._lost.append(f'{name}: {trouble}')
            file: BagFile = (
                mcap_file.McapFile(inner, name)
                if inner.suffix == '.mcap'
                else sqlite_file.SqliteFile(inner, name, self._scratch())
            )
        except (ValueError, OSError) as error:
            self._lost.append(in_words(error))
            return
        self._stack.callback(file.close)
        self._files.append(file)

    def _scratch(self) -> Path:
        """A new folder for copies, which goes when the recording is closed."""
        return Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix='dcdrw-')))


def _kind(topic: Stream) -> str:
    """A topic's type, and what its messages are written in where that is not what ROS 2 reads."""
    kind = one_line(topic.type or 'no type')
    return kind if topic.serialization == CDR else f'{kind} in {one_line(topic.serialization)}'

"""Mends MCAP files whose recorder was killed: whole chunks stay, and get the index and the end that are missing."""

import fcntl
import struct
import sys
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import get_chunk_data_stream

from dcdrw.recordings.recorder import INFORMATION, METADATA, RecordedTopic, Span, bag_metadata, write_whole
from dcdrw_msgs_py.yaml_file import parse_yaml, read_yaml, yaml_text

_MAGIC = b'\x89MCAP0\r\n'
_HEAD = struct.Struct('<BQ')
"""Of every record: its kind, and the length of what follows."""
_MESSAGE_HEAD = struct.Struct('<HIQ')
"""Of a message: channel, sequence number, log time."""
_MESSAGE = int(Opcode.MESSAGE)


def is_closed(file: Path) -> bool:
    """Whether an MCAP file has its end; true, too, for what is no MCAP file at all."""
    with file.open('rb') as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:
            return True
        size = stream.seek(0, 2)
        stream.seek(-len(_MAGIC), 2)
        return size > len(_MAGIC) and stream.read() == _MAGIC


def mend(file: Path) -> None:
    """Give an MCAP file its end, in place, and renew the metadata beside it.

    Raises:
        ValueError: no message in it is whole, or a recorder is at work on it.
        OSError: the disk is full or not to be written.

    """
    try:
        with file.open('r+b') as stream:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            index = _Index(stream)
            if not index.span.counts:
                raise ValueError(f'{file} ends before its first message: nothing was recorded')
            end = index.written()
            stream.truncate(index.end)
            stream.seek(index.end)
            stream.write(end)
        _renew_metadata(file, index)
    except BlockingIOError:
        raise ValueError(f'{file} is being recorded; end that first') from None
    except OSError as error:
        raise OSError(
            error.errno,
            f'not closed, and not to be mended here ({error.strerror}): copy it to where '
            'there is room and leave to write',
            str(file),
        ) from None
    print(f'{file} was not closed; mended: {sum(index.span.counts.values())} messages are whole', file=sys.stderr)


def _renew_metadata(file: Path, index: '_Index') -> None:
    """Bring metadata.yaml up to date; not where the file is one of several."""
    if list(file.parent.glob('*.mcap')) != [file]:
        return
    path = file.parent / METADATA
    about: dict[str, str] = {}
    with suppress(OSError, ValueError, KeyError, TypeError):
        about = read_yaml(path)[INFORMATION]['custom_data'] or {}
    write_whole(path, yaml_text(bag_metadata(file.name, index.topics, index.span, about)))


class _Index:
    """What is whole in an MCAP file without an end (https://mcap.dev/spec), and the summary that it should have."""

    def __init__(self, stream: BinaryIO) -> None:
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: dict[int, int] = {}
        self._start_ns, self._end_ns = 2**64 - 1, 0
        self._last: dict[int, list[tuple[int, int]]] = {}
        """Time and place of each message in the last chunk, by channel."""
        self.end = stream.seek(len(_MAGIC))
        """Where the last whole record ends."""
        while self._read(stream):
            self.end = stream.tell()
        if self._chunks and self._last.keys() - self._chunks[-1].message_index_offsets.keys():
            # The kill came amid the indexes of the last chunk: they are made anew, after it.
            last = self._chunks[-1]
            self.end = last.chunk_start_offset + last.chunk_length
            last.message_index_offsets, last.message_index_length = {}, 0
        else:
            self._last = {}

    @property
    def topics(self) -> list[RecordedTopic]:
        """The topics, as metadata.yaml tells them."""
        return [
            RecordedTopic(
                channel.topic,
                self._schemas[channel.schema_id].name,
                channel.metadata.get('topic_type_hash', ''),
                parse_yaml(channel.metadata.get('offered_qos_profiles') or '[]'),
            )
            for channel in self._channels.values()
        ]

    @property
    def span(self) -> Span:
        """What is whole."""
        counts = {self._channels[key].topic: count for key, count in self._counts.items()}
        return Span(counts, self._start_ns, self._end_ns)

    def written(self) -> bytes:
        """All that belongs after `end`: indexes that the last chunk lacks, end of data, summary, footer."""
        tail = RecordBuilder()
        for channel, places in self._last.items():
            chunk = self._chunks[-1]
            chunk.message_index_offsets[channel] = self.end + tail.count
            MessageIndex(channel, places).write(tail)
            chunk.message_index_length = tail.count
        DataEnd(0).write(tail)
        start = self.end + tail.count
        for record in (*self._schemas.values(), *self._channels.values(), *self._chunks, *self._metadata):
            record.write(tail)
        Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=self._end_ns,
            message_start_time=self._start_ns,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        ).write(tail)
        Footer(start, 0, 0).write(tail)
        return bytes(tail.end()) + _MAGIC  # type: ignore[no-untyped-call]

    def _read(self, stream: BinaryIO) -> bool:
        """Take the next record; False where it is not whole, or where the data end."""
        begin = stream.tell()
        head = stream.read(_HEAD.size)
        if len(head) < _HEAD.size:
            return False
        kind, length = _HEAD.unpack(head)
        content = stream.read(min(length, 2**40))
        if len(content) < length or kind in (0, Opcode.DATA_END, Opcode.FOOTER):
            return False
        if kind == Opcode.CHUNK:
            return self._take_chunk(begin, content)
        if kind == Opcode.MESSAGE_INDEX and self._chunks:
            chunk = self._chunks[-1]
            chunk.message_index_offsets[int.from_bytes(content[:2], 'little')] = begin
            chunk.message_index_length += len(head) + length
        elif kind == Opcode.METADATA:
            self._metadata.append(MetadataIndex(begin, len(head) + length, Metadata.read(_stream(content)).name))
        else:
            self._take(kind, memoryview(content))
        return True

    def _take_chunk(self, begin: int, content: bytes) -> bool:
        chunk = Chunk.read(_stream(content))
        try:
            records, size = get_chunk_data_stream(chunk, validate_crc=True)
        except Exception:  # whatever the decompressor makes of it: a disk that lost power, say
            return False
        data, at = memoryview(records.read(size)), 0
        self._last = {}
        while at < size:
            kind, length = _HEAD.unpack_from(data, at)
            found = self._take(kind, data[at + _HEAD.size : at + _HEAD.size + length])
            if found:
                channel, log_ns = found
                self._last.setdefault(channel, []).append((log_ns, at))
            at += _HEAD.size + length
        self._chunks.append(
            ChunkIndex(
                chunk_length=_HEAD.size + len(content),
                chunk_start_offset=begin,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                message_end_time=chunk.message_end_time,
                message_index_length=0,
                message_index_offsets={},
                message_start_time=chunk.message_start_time,
                uncompressed_size=chunk.uncompressed_size,
            )
        )
        return True

    def _take(self, kind: int, content: memoryview) -> tuple[int, int] | None:
        """Take a record from within a chunk or without; return channel and time of a message."""
        if kind == _MESSAGE:
            channel, _, log_ns = _MESSAGE_HEAD.unpack_from(content)
            self._counts[channel] = self._counts.get(channel, 0) + 1
            self._start_ns, self._end_ns = min(self._start_ns, log_ns), max(self._end_ns, log_ns)
            return channel, log_ns
        if kind == Opcode.SCHEMA:
            schema = Schema.read(_stream(content))
            self._schemas[schema.id] = schema
        elif kind == Opcode.CHANNEL:
            found = Channel.read(_stream(content))
            self._channels[found.id] = found
        return None


def _stream(content: bytes | memoryview) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))

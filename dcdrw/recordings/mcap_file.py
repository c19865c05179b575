"""MCAP files (https://mcap.dev/spec), read whatever befell them: what is whole is found record by record.

The official library reads through the index at the end, or stops at the first record that is damaged. Here damage
costs what it touched: a record is known by its shape, and where one is broken the next is searched for.
"""

import os
import re
import struct
import zlib
from bisect import bisect_right
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from dcdrw.recordings.bag_file import CDR, BagFile, Message, RecordedTopic, Stream, full_type
from dcdrw.recordings.decompression import LARGEST, decompress
from dcdrw_msgs_py.words import by_count, counted

MAGIC = b'\x89MCAP0\r\n'
_HEAD = struct.Struct('<BQ')
"""The head of a record: its kind, and the length of what follows."""
_CHUNK = struct.Struct('<QQQII')
"""First and last log time, size and checksum of the records, length of the compression's name."""
_MESSAGE = struct.Struct('<BQHIQ')
"""Kind and length, then channel, sequence number, log time; the publish time follows."""
_MESSAGE_HEAD = _HEAD.size + 22
_FOOTER = struct.Struct('<9xQQI')
"""Kind and length, then the place of the summary and of its offsets, and the checksum of all up to it."""
_PARSED: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.STATISTICS: Statistics,
    Opcode.METADATA: Metadata,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.SUMMARY_OFFSET: SummaryOffset,
}
_WITH_MESSAGES = (Opcode.MESSAGE, Opcode.CHUNK)
_LONGEST_TEXT = 16 * 2**20
"""Longest record of those that are parsed [bytes]."""
_MAYBE = re.compile(rb'(?=[\x01-\x0f].{5}\0\0\0)', re.DOTALL)
"""Where a record of less than 2^40 bytes may begin."""
_BLOCK = 2**20
_MOST_LOOKS = 1_000_000
"""Places that are looked at for the next whole record before the rest is given up: seconds."""
_MOST_HELD = 64 * 2**20
"""Messages that are held back to bring them into order [bytes]."""
_MOST_NOTES = 20
_WEIGHT = 200
"""What a message costs beside its data [bytes]."""


class _Piece(NamedTuple):
    """Bytes of the file that hold messages: a chunk, or a row of messages outside of chunks."""

    record: int
    """Where the chunk's record begins, or the first message's."""
    begin: int
    size: int
    start_ns: int
    compression: str = ''
    plain_size: int = -1
    """Size of the records within, uncompressed; -1: as much as there is."""
    checksum: int = 0


def has_end(path: Path) -> bool:
    """Whether an MCAP file ends as its writer ends one."""
    with path.open('rb') as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - len(MAGIC)))
        return size >= 2 * len(MAGIC) and file.read() == MAGIC


class McapFile(BagFile):
    """An open MCAP file.

    Raises:
        ValueError: it is not an MCAP file.
        OSError: it cannot be read.

    """

    def __init__(self, path: Path, name: str) -> None:
        super().__init__(path, name)
        self._file = path.open('rb')
        try:
            self._size = os.fstat(self._file.fileno()).st_size
            self._window, self._window_at = b'', 0
            self.closed = has_end(path)
            self._schemas: dict[int, Schema] = {}
            self._channels: dict[int, Channel] = {}
            self._statistics: Statistics | None = None
            self._told_by_data: tuple[dict[int, Schema], dict[int, Channel]] = {}, {}
            """What the file tells before its summary."""
            self._pieces: list[_Piece] = []
            self._looks = 0
            self._walk()
            if not self._pieces and not self._channels and not self._schemas:
                raise ValueError(self._stranger())
            if self._is_described():
                self._count_by_statistics()
            else:
                self._count_by_reading()
            self._name_topics()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close it."""
        self._file.close()

    def messages(self, topics: Collection[Stream], start_ns: int, stop_ns: int) -> Iterator[Message]:
        """The messages of these topics from start to before stop, in the order in which they came.

        Chunks may overlap in time: each message is held until no later chunk may begin before it. Where that would
        hold more than 64 MiB, as only a file whose chunks lie in disorder does, what is held goes on as it is.
        """
        wanted = {key: stream for key in self._channels if (stream := self._topic(key).stream) in topics}
        bounds = [2**64]
        for piece in reversed(self._pieces):
            bounds.append(min(bounds[-1], piece.start_ns))
        bounds.pop()
        held: list[Message] = []
        weight = 0
        for piece in self._pieces:
            bound = bounds.pop()
            for channel, log_ns, data in self._read(piece):
                topic = wanted.get(channel)
                if topic is not None and start_ns <= log_ns < stop_ns:
                    whole = self._whole(data)
                    if whole:
                        held.append(Message(topic, log_ns, whole))
                        weight += _WEIGHT + len(whole)
                    else:
                        self._note(('message', piece.record), f'a compressed message at byte {piece.record} is damaged')
            held.sort(key=_log_ns)
            ready = len(held) if weight > _MOST_HELD else bisect_right(held, bound, key=_log_ns)
            yield from held[:ready]
            weight -= sum(_WEIGHT + len(message.data) for message in held[:ready])
            del held[:ready]

    # Finding what is whole.

    def _walk(self) -> None:
        """Go from record to record, and past what is none."""
        at = len(MAGIC) if self._bytes(0, len(MAGIC)) == MAGIC else 0
        if not at:
            at = self._resume(0)
        unsure: int | None = None
        """A record just before, whose shape does not vouch for its length."""
        cut: _Piece | None = None
        """A chunk that the file's end cuts off."""
        while at < self._size:
            end = self._end_of(at)
            if end is None:
                if self._is_end(at):
                    break
                chunk = self._cut_chunk(at)
                if chunk and not chunk.compression:  # its records stand there as they would outside of chunks
                    cut, at, unsure = chunk, chunk.begin, None
                    continue
                if chunk:
                    self._pieces.append(chunk._replace(size=self._size - chunk.begin, plain_size=-1, checksum=0))
                if chunk or self._is_cut_off(at):
                    if self._bytes(at, 1)[0] in _WITH_MESSAGES:  # of an index that is cut off nothing is missed
                        self._note_end(at)
                    break
                if unsure is not None:
                    self._forget(unsure)
                at = self._resume(at if unsure is None else unsure)
                unsure = None
                continue
            kind = self._bytes(at, 1)[0]
            self._take(kind, at, end)
            unsure = at if kind == Opcode.MESSAGE else None
            at = end
        if cut:
            there = self._size - cut.begin
            self._note('end', f'the chunk at byte {cut.record} is cut off: {there} of {cut.size} bytes are there')

    def _is_end(self, at: int) -> bool:
        """Whether the file ends here, and as it should."""
        return self._bytes(at, len(MAGIC) + 1) == MAGIC

    def _resume(self, at: int) -> int:
        """Note damage, and return where the next whole record begins."""
        found = self._find(at + 1)
        if found == self._size and not self.closed:
            self._note_end(at)
        else:
            self._note(('gap', at), f'{self._stretch(at, found)} damaged')
        return found

    def _note_end(self, at: int) -> None:
        self._note('end', f'{self._stretch(at, self._size)} the beginning of what is missing')

    @staticmethod
    def _stretch(begin: int, end: int) -> str:
        return f'{counted(end - begin, "byte")} from byte {begin} on {by_count(end - begin, "is", "are")}'

    def _find(self, at: int) -> int:
        """The next place where two whole records follow each other; the file's size where there is none."""
        while at < self._size:
            block = os.pread(self._file.fileno(), _BLOCK + _HEAD.size, at)
            if not block:
                break
            for match in _MAYBE.finditer(block):
                place = match.start()
                if place >= _BLOCK:
                    break
                self._looks += 1
                if self._looks > _MOST_LOOKS:
                    self._note('looks', 'the rest is too badly damaged to be searched')
                    return self._size
                end = self._end_of(at + place)
                if end is not None and (end == self._size or self._is_end(end) or self._end_of(end) is not None):
                    return at + place
            at += _BLOCK
        return self._size

    def _end_of(self, at: int) -> int | None:
        """Where the record ends that begins here; None where none does, by its length or its shape."""
        head = self._bytes(at, _HEAD.size)
        if len(head) < _HEAD.size:
            return None
        kind, length = _HEAD.unpack(head)
        begin, end = at + _HEAD.size, at + _HEAD.size + length
        if end > self._size or not self._has_shape(kind, begin, length):
            return None
        return int(end)

    def _has_shape(self, kind: int, begin: int, length: int) -> bool:
        if kind == Opcode.MESSAGE:
            if not 22 <= length <= LARGEST:
                return False
            channel = int.from_bytes(self._bytes(begin, 2), 'little')
            return not self._channels or channel in self._channels
        if kind == Opcode.CHUNK:
            chunk = self._chunk(begin - _HEAD.size)
            return chunk is not None and chunk.begin + chunk.size == begin + length
        if kind == Opcode.MESSAGE_INDEX:
            return length >= 6 and length == 6 + int.from_bytes(self._bytes(begin + 2, 4), 'little')
        if kind in (Opcode.DATA_END, Opcode.FOOTER):
            return length == (4 if kind == Opcode.DATA_END else 20)
        if kind == Opcode.ATTACHMENT:
            return length >= 36
        return kind in _PARSED and self._parse(kind, self._bytes(begin, length, _LONGEST_TEXT)) is not None

    def _chunk(self, at: int) -> _Piece | None:
        """The chunk whose record begins here; None where it has not the shape of one."""
        head = self._bytes(at + _HEAD.size, _CHUNK.size + 12)
        if len(head) < _CHUNK.size + 8:
            return None
        start_ns, _, plain_size, checksum, name_length = _CHUNK.unpack_from(head)
        name = head[_CHUNK.size : _CHUNK.size + name_length]
        begin = at + _HEAD.size + _CHUNK.size + len(name) + 8
        if name_length > 4 or name not in (b'', b'lz4', b'zstd') or len(head) < _CHUNK.size + len(name) + 8:
            return None
        (size,) = struct.unpack_from('<Q', head, _CHUNK.size + len(name))
        if max(size, plain_size) > LARGEST:
            return None
        return _Piece(at, begin, size, start_ns, name.decode(), plain_size, checksum)

    def _cut_chunk(self, at: int) -> _Piece | None:
        """The chunk that begins here and that the file's end cuts off; None where there is none."""
        head = self._bytes(at, _HEAD.size)
        if head[:1] != bytes([Opcode.CHUNK]):
            return None
        chunk = self._chunk(at)
        end = at + _HEAD.size + int.from_bytes(head[1:], 'little')
        return chunk if chunk and chunk.begin + chunk.size == end > self._size and not self.closed else None

    def _is_cut_off(self, at: int) -> bool:
        """Whether a record begins here that the file's end cuts off, and nothing whole comes after."""
        head = self._bytes(at, _HEAD.size + 2)
        kind, length, channel = head[0], *(int.from_bytes(part, 'little') for part in (head[1:9], head[9:]))
        longest = LARGEST if kind in _WITH_MESSAGES else _LONGEST_TEXT
        if self.closed or not Opcode.HEADER <= kind <= Opcode.DATA_END or length > longest:
            return False
        if kind == Opcode.MESSAGE and len(head) == _HEAD.size + 2 and channel not in self._channels:
            return False
        return at + _HEAD.size + length > self._size and self._find(at + 1) == self._size

    @staticmethod
    def _parse(kind: int, content: bytes) -> Any:
        """A record with text in it; None where its parts do not fill it."""
        try:
            stream = ReadDataStream(BytesIO(content))
            record = _PARSED[kind].read(stream)
        except Exception:  # of any kind, for the content may be anything
            return None
        return record if stream.count == len(content) else None

    def _take(self, kind: int, at: int, end: int) -> None:
        """Keep what a whole record tells."""
        if kind == Opcode.CHUNK:
            chunk = self._chunk(at)
            if chunk:
                self._pieces.append(chunk)
        elif kind == Opcode.MESSAGE:
            self._take_message(at, end)
        elif kind in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS):
            self._describe(kind, self._bytes(at + _HEAD.size, end - at - _HEAD.size, _LONGEST_TEXT))
        elif kind == Opcode.DATA_END:
            self._told_by_data = dict(self._schemas), dict(self._channels)
        elif kind == Opcode.FOOTER and not self._is_summary_whole(at):
            self._note('summary', f'the summary before byte {at} is damaged')
            (self._schemas, self._channels), self._statistics = self._told_by_data, None

    def _is_summary_whole(self, footer: int) -> bool:
        """Whether the summary that ends with this footer has the checksum that was written, if one was."""
        at, _, checksum = _FOOTER.unpack(self._bytes(footer, _FOOTER.size))
        if not at or not checksum:  # there is none
            return True
        found, end = 0, footer + _FOOTER.size - 4
        while at < end and (block := os.pread(self._file.fileno(), min(_BLOCK, end - at), at)):
            found, at = zlib.crc32(block, found), at + len(block)
        return bool(found == checksum)

    def _take_message(self, at: int, end: int) -> None:
        """A message outside of chunks: it joins the row that it ends."""
        last = self._pieces[-1] if self._pieces else None
        *_, log_ns = _MESSAGE.unpack(self._bytes(at, _MESSAGE.size))
        if last and last.record == last.begin and last.begin + last.size == at and end - last.begin <= _BLOCK:
            self._pieces[-1] = last._replace(size=end - last.begin, start_ns=min(last.start_ns, log_ns))
        else:
            self._pieces.append(_Piece(at, at, end - at, log_ns))

    def _forget(self, at: int) -> None:
        """Take back the message that began here."""
        last = self._pieces.pop()
        if last.record < at:
            self._pieces.append(last._replace(size=at - last.begin))

    def _describe(self, kind: int, content: bytes, lost: bool = False) -> None:
        """Take a schema, a channel or the statistics; from a damaged chunk only what is told nowhere else."""
        record = self._parse(kind, content)
        if isinstance(record, Schema):
            if not (lost and record.id in self._schemas):
                self._schemas[record.id] = record
        elif isinstance(record, Channel):
            if not (lost and record.id in self._channels):
                self._channels[record.id] = record
        elif isinstance(record, Statistics):
            self._statistics = record

    def _bytes(self, at: int, length: int, longest: int = _BLOCK) -> bytes:
        """Bytes of the file, fewer at its end."""
        length = min(length, longest)
        offset = at - self._window_at
        if offset < 0 or offset + length > len(self._window):
            self._window = os.pread(self._file.fileno(), max(length, 4096), at)
            self._window_at, offset = at, 0
        return self._window[offset : offset + length]

    # What it holds.

    def _is_described(self) -> bool:
        """Whether the end tells all that there is, so that no chunk need be opened to know."""
        told = self._statistics
        return (
            self.closed
            and not self._damage
            and told is not None
            and (not self._pieces or told.message_start_time == min(piece.start_ns for piece in self._pieces))
            and bool(self._pieces) == bool(told.message_count)
            and told.message_count == sum(told.channel_message_counts.values())
            and told.chunk_count == sum(piece.record != piece.begin for piece in self._pieces)
            and all(
                key in self._channels and self._channels[key].schema_id in self._schemas
                for key in told.channel_message_counts
            )
        )

    def _count_by_statistics(self) -> None:
        told = self._statistics
        if told:
            self._counts = dict(told.channel_message_counts)
            self.start_ns, self.end_ns = told.message_start_time, told.message_end_time

    def _count_by_reading(self) -> None:
        """Open every chunk."""
        self._counts = {}
        start_ns, end_ns = 2**64, 0
        for piece in self._pieces:
            for channel, log_ns, _ in self._read(piece):
                self._counts[channel] = self._counts.get(channel, 0) + 1
                start_ns, end_ns = min(start_ns, log_ns), max(end_ns, log_ns)
        if self._counts:
            self.start_ns, self.end_ns = start_ns, end_ns
        lost = sum(count for channel, count in self._counts.items() if channel not in self._channels)
        if lost:
            self._note('channels', f'the name of the topic is lost of {counted(lost, "message")}')

    def _name_topics(self) -> None:
        for key in self._channels:
            topic = self._topic(key)
            self.topics.setdefault(topic.stream, topic)
            self.counts[topic.stream] = self.counts.get(topic.stream, 0) + self._counts.get(key, 0)

    def _topic(self, key: int) -> RecordedTopic:
        """What the file tells of a channel."""
        channel = self._channels[key]
        schema = self._schemas.get(channel.schema_id)
        return RecordedTopic(
            channel.topic,
            full_type(schema.name) if schema else '',
            channel.metadata.get('topic_type_hash', ''),
            channel.metadata.get('offered_qos_profiles', ''),
            schema.data.decode(errors='replace') if schema else '',
            schema.encoding if schema else '',
            channel.message_encoding or CDR,
        )

    def _read(self, piece: _Piece) -> Iterator[tuple[int, int, bytes]]:
        """Channel, log time and data of each message in a piece; nothing of one that is damaged."""
        data = decompress(os.pread(self._file.fileno(), piece.size, piece.begin), piece.compression)
        whole = piece.plain_size < 0 or (
            len(data) == piece.plain_size and (not piece.checksum or zlib.crc32(data) == piece.checksum)
        )
        if not whole:
            self._note(
                ('chunk', piece.record), f'the chunk at byte {piece.record} ({counted(piece.size, "byte")}) is damaged'
            )
        at, size = 0, len(data)
        while at + _HEAD.size <= size:
            kind, length = _HEAD.unpack_from(data, at)
            begin, end = at + _HEAD.size, at + _HEAD.size + length
            if end > size or (kind == Opcode.MESSAGE and length < 22):
                break
            if kind == Opcode.MESSAGE:
                if whole:
                    _, _, channel, _, log_ns = _MESSAGE.unpack_from(data, at)
                    if log_ns < 2**63:
                        yield channel, log_ns, data[at + _MESSAGE_HEAD : end]
                    else:
                        self._note(('time', piece.record), f'a message at byte {piece.record} has no possible time')
            elif kind in (Opcode.SCHEMA, Opcode.CHANNEL) and length <= _LONGEST_TEXT:
                self._describe(kind, data[begin:end], lost=not whole)
            at = end
        if whole and at < size and piece.plain_size >= 0:
            rest = size - at
            text = f'{counted(rest, "byte")} of the chunk at byte {piece.record} {by_count(rest, "is", "are")} damaged'
            self._note(('chunk', piece.record), text)

    def _note(self, key: Any, text: str) -> None:
        if len(self._damage) < _MOST_NOTES:
            self._damage.setdefault(key, f'{self.name}: {text}')
        else:
            self._damage.setdefault('more', f'{self.name}: more of it is damaged')

    def _stranger(self) -> str:
        """What to say of a file in which nothing of MCAP is found."""
        start = self._bytes(0, 64)
        if start.startswith(b'version https://git-lfs'):
            return f'{self.name} is a pointer of Git LFS, not the recording itself: run git lfs pull'
        if start.startswith(MAGIC):
            return f'{self.name} ends before its first message: nothing was recorded'
        return f'{self.name} is {"empty" if not start else "not an MCAP file"}'


def _log_ns(message: Message) -> int:
    return message.log_ns

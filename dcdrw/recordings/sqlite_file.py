"""sqlite3 files of rosbag2, read whatever befell them, and without a trace beside them.

sqlite3 itself would lock the file, and write where a recorder was killed: it rolls back or forward what stands in the
file's journal. So a file with a journal is copied with it, and the copy is opened. It refuses a file that is shorter
than its first page tells: a copy is made as long again, with pages of zeros in the place of those that are missing.
"""

import os
import re
import shutil
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from dcdrw.recordings.bag_file import CDR, BagFile, Message, RecordedTopic, Stream, full_type
from dcdrw.recordings.decompression import LARGEST

JOURNALS = ('-wal', '-journal')
_MAGIC = b'SQLite format 3\0'
_ROWS = 512
"""Rows that are asked for at once."""
_STEPS = 100_000
"""Instructions of sqlite3 between two looks at how many it has taken."""
_MOST_COPIES = 5
_MOST_GAPS = 1000
"""Damaged stretches after which the rest is given up: seconds."""
_LAST_ID = 2**63 - 1
_DAMAGED = (sqlite3.Error, UnicodeError, OverflowError, MemoryError)
"""What sqlite3 raises on damage: a length that no machine has is MemoryError."""
_NO_MESSAGE = re.compile(r'^message_count: 0$', re.MULTILINE)
"""In metadata: none was written yet, in all files together."""
_LIMIT_LENGTH = 0
"""SQLITE_LIMIT_LENGTH, which Python names from 3.11 on."""


def has_end(path: Path) -> bool:
    """Whether an sqlite3 file has as many pages as its first one tells."""
    with path.open('rb') as file:
        page, pages = _pages(file.read(100))
    return 0 < page * pages <= path.stat().st_size


class SqliteFile(BagFile):
    """An open sqlite3 file.

    Args:
        path: of the file.
        name: of the file as it was given.
        scratch: an empty folder for a copy, which the caller removes.

    Raises:
        ValueError: it is not a recording.
        OSError: it cannot be read, or not be copied.

    """

    def __init__(self, path: Path, name: str, scratch: Path) -> None:
        super().__init__(path, name)
        with path.open('rb') as file:
            start = file.read(100)
        if start.startswith(b'version https://git-lfs'):
            raise ValueError(f'{name} is a pointer of Git LFS, not the recording itself: run git lfs pull')
        journals = [journal for journal in _journals(path) if journal.stat().st_size]
        if not journals and not start.startswith(_MAGIC):
            raise ValueError(f'{name} is {"not an sqlite3 file" if start else "empty"}')
        page, pages = _pages(start)
        size, told = path.stat().st_size, 0 if journals else page * pages
        if journals or size < told:
            path = _copy(path, scratch / 'copy.db3')
        if size < told:
            os.truncate(path, size - size % page)
            os.truncate(path, told)
            self._damage['end'] = f'{name} is cut off: {size} of {told} bytes are there'
        self._size = path.stat().st_size + sum(journal.stat().st_size for journal in _journals(path))
        uri = f'{path.resolve().as_uri()}?{"mode=rw" if journals else "mode=ro&immutable=1"}'
        self._steps = 0
        self._connection = sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False)
        try:
            self._open()
            self.closed = not (journals or self._is_begun())
        except (*_DAMAGED, TypeError) as error:
            self.close()
            raise ValueError(f'{name} cannot be read: {" ".join(str(error).split())[:200]}') from None
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close it."""
        self._connection.close()

    def messages(self, topics: Collection[Stream], start_ns: int, stop_ns: int) -> Iterator[Message]:
        """The messages of these topics from start to before stop, in the order in which they came."""
        wanted = {key: stream for key, stream in self._streams.items() if stream in topics}
        for key, log_ns, data in self._rows(wanted, start_ns, min(stop_ns, _LAST_ID)):
            whole = self._whole(data) if isinstance(data, bytes) and isinstance(log_ns, int) else b''
            if whole:
                yield Message(wanted[key], log_ns, whole)
            else:
                self._damage.setdefault('message', f'{self.name}: a message is damaged')

    def _open(self) -> None:
        connection = self._connection
        connection.set_progress_handler(self._tire, _STEPS)
        connection.execute('PRAGMA trusted_schema = OFF')
        connection.execute('PRAGMA cell_size_check = ON')
        if hasattr(connection, 'setlimit'):
            connection.setlimit(_LIMIT_LENGTH, LARGEST)
        tables = {name for name, kind in self._query('SELECT name, type FROM sqlite_master') if kind == 'table'}
        if not {'topics', 'messages'} <= tables:
            raise ValueError(f'{self.name} is not a recording: it has no table of topics, or none of messages')
        self._streams: dict[int, Stream] = {}
        definitions: dict[str, tuple[str, str]] = {}
        if 'message_definitions' in tables:
            with suppress(*_DAMAGED, ValueError):
                definitions = {
                    str(kind): (str(text), str(form))
                    for kind, form, text in self._query(
                        'SELECT topic_type, encoding, encoded_message_definition FROM message_definitions'
                    )
                }
        known = {row[1] for row in self._query('PRAGMA table_info(topics)')}
        columns = ('id', 'name', 'type', 'serialization_format', 'offered_qos_profiles', 'type_description_hash')
        asked = ', '.join(column if column in known else "''" for column in columns)
        for key, name, kind, form, qos, digest in self._query(f'SELECT {asked} FROM topics'):
            described = definitions.get(str(kind), ('', ''))
            topic = RecordedTopic(str(name), full_type(str(kind)), str(digest), str(qos), *described, str(form) or CDR)
            self._streams[key] = topic.stream
            self.topics.setdefault(topic.stream, topic)
        try:
            counts = self._query('SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages GROUP BY 1')
            whole = self._query("SELECT count(*) FROM messages WHERE typeof(timestamp) = 'integer'")
            times = [time for row in counts for time in row[2:]]
            if whole != [(sum(row[1] for row in counts),)] or not all(isinstance(time, int) for time in times):
                self._damage['time'] = f'{self.name}: a message has no possible time'
                raise sqlite3.DataError
            self._count([row for row in counts if row[0] in self._streams])
            self._orderly = self._is_indexed(sum(row[1] for row in counts))
        except (*_DAMAGED, TypeError):
            self._orderly = False
            self._count([(key, 1, log_ns, log_ns) for key, log_ns, _ in self._salvage()])

    def _is_begun(self) -> bool:
        """Whether its recorder told the metadata as it opened the file, still without messages, and not again.

        rosbag2 tells them here as it opens a file and as it closes it; up to Humble never; rosbags as it closes it.
        """
        told: list[Any] = []
        with suppress(*_DAMAGED):
            told = self._query('SELECT metadata FROM metadata LIMIT 2')
        return len(told) == 1 and bool(_NO_MESSAGE.search(str(told[0][0]))) and any(self.counts.values())

    def _count(self, rows: Collection[tuple[int, int, int, int]]) -> None:
        """Take counts and times by topic."""
        self.counts = dict.fromkeys(self.topics, 0)
        for key, count, _, _ in rows:
            self.counts[self._streams[key]] += count
        if rows:
            self.start_ns, self.end_ns = min(row[2] for row in rows), max(row[3] for row in rows)

    def _is_indexed(self, rows: int) -> bool:
        """Whether the index by time, where there is one, names every row."""
        for _, index, *_ in self._query('PRAGMA index_list(messages)'):
            if [column for _, _, column in self._query(f'PRAGMA index_info("{index}")')][:1] == ['timestamp']:
                return bool(self._query(f'SELECT count(*) FROM messages INDEXED BY "{index}"') == [(rows,)])
        return True

    def _rows(self, wanted: Collection[int], start_ns: int, stop_ns: int) -> Iterator[tuple[int, int, Any]]:
        """Topic, time and data of each row, by time; where the file is damaged, in the order of their writing."""
        last = start_ns - 1
        if self._orderly:
            try:
                keys = ', '.join(str(int(key)) for key in wanted)
                self._steps = 0
                for row in self._connection.execute(
                    'SELECT topic_id, timestamp, data FROM messages WHERE timestamp >= ? AND timestamp < ? '
                    f'AND topic_id IN ({keys}) ORDER BY timestamp, id',
                    (start_ns, stop_ns),
                ):
                    self._steps = 0
                    if isinstance(row[1], int):
                        last = max(last, row[1])
                        yield row
                    else:
                        self._damage.setdefault('time', f'{self.name}: a message has no possible time')
                return
            except _DAMAGED as error:
                self._damage.setdefault('order', f'{self.name}: {error}')
        for key, log_ns, data in self._salvage():
            if key in wanted and last < log_ns < stop_ns:
                yield key, log_ns, data

    def _salvage(self) -> Iterator[tuple[int, int, Any]]:
        """Every row that can be read, in the order of their numbers: a damaged page costs its own rows alone."""
        at, count = -_LAST_ID - 1, _ROWS
        for _ in range(_MOST_GAPS):
            while (rows := self._look_up(at, count)) is not None:
                number = at
                for key, topic, log_ns, data in rows:
                    if key >= at and isinstance(log_ns, int):
                        at = key + 1
                        if topic in self._streams:
                            yield topic, log_ns, data
                if at == number:
                    return
                count = min(2 * count, _ROWS)
            if count > 1:
                count = 1
                continue
            found = self._next_readable(at)
            self._damage[at] = (
                f'{self.name}: the rows from number {max(at, 0)} {f"to {found - 1}" if found else "on"} are damaged'
            )
            if found is None:
                return
            at = found
        self._damage['more'] = f'{self.name}: the rest is too badly damaged to be searched'

    def _next_readable(self, at: int) -> int | None:
        """The least number after a row that cannot be read from which on there is one that can; None for no more."""
        start = bad = max(at, 0)  # rosbag2 counts from 1
        good = start + (at >= 0)
        while self._look_up(good, 1) is None:
            bad, good = good, good + 1 + (good - start) // 8  # a whole page between two damaged ones is found
            if good > _LAST_ID:
                return None
        while good - bad > 1:
            middle = (bad + good) // 2
            if self._look_up(middle, 1) is None:
                bad = middle
            else:
                good = middle
        return good

    def _look_up(self, number: int, count: int) -> list[Any] | None:
        """So many rows from this number on; None where one of them cannot be read."""
        try:
            return self._query(
                'SELECT id, topic_id, timestamp, data FROM messages WHERE id >= ? ORDER BY id LIMIT ?', (number, count)
            )
        except _DAMAGED:
            return None

    def _query(self, text: str, values: tuple[Any, ...] = ()) -> list[Any]:
        self._steps = 0
        return self._connection.execute(text, values).fetchall()

    def _tire(self) -> bool:
        """Whether a query has taken more steps than any honest one over a file of this size."""
        self._steps += _STEPS
        return self._steps > 10_000_000 + 10 * self._size


def _pages(header: bytes) -> tuple[int, int]:
    """The size of a page [bytes] and their number by the first of them; 0 where it does not tell of the last change."""
    size, count = int.from_bytes(header[16:18], 'big'), int.from_bytes(header[28:32], 'big')
    return 65536 if size == 1 else size, count if header[24:28] == header[92:96] else 0


def _journals(path: Path) -> list[Path]:
    return [journal for journal in (path.with_name(path.name + end) for end in JOURNALS) if journal.exists()]


def _copy(path: Path, target: Path) -> Path:
    """Copy a file with its journals, as they stand together.

    Raises:
        OSError: there is no room, say.

    """
    for _ in range(_MOST_COPIES):
        before = path.stat()
        try:
            shutil.copyfile(path, target)
            for journal in _journals(path):
                shutil.copyfile(journal, target.with_name(target.name + journal.name[len(path.name) :]))
        except OSError as error:
            raise OSError(
                error.errno,
                f'{error.strerror}: cannot be copied to {target.parent} (TMPDIR names another place)',
                str(path),
            ) from None
        after = path.stat()
        if (before.st_size, before.st_mtime_ns) == (after.st_size, after.st_mtime_ns):
            break
    return target

"""JointState messages as they came off the wire (CDR), decoded many at once: numpy alone, no ROS."""

import math
import struct
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.words import names_and_positions


class JointBatch(NamedTuple):
    """JointState messages that name the same joints; rows are messages, columns joints."""

    frame: str
    names: tuple[str, ...]
    stamp_ns: NDArray[np.int64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]
    """NaN where not given for each joint."""
    error: str = ''
    """Why these messages cannot be read; empty where they can."""
    log_ns: NDArray[np.int64] = np.empty(0, np.int64)
    """When the recorder got each; empty where that is not known."""
    run: NDArray[np.int64] = np.empty(0, np.int64)
    """The source's run of each; empty where it told none."""
    unstamped: int = 0
    """How many have the time of recording in the place of a stamp that told none."""
    pace: float = math.nan
    """How many times as fast time passes by the stamps as by the recording; NaN where that is not known."""

    @property
    def messages(self) -> int:
        """How many messages these are."""
        return len(self.stamp_ns)


def decode_joints(messages: list[bytes], log_ns: Sequence[int] = ()) -> Iterator[JointBatch]:
    """Decode serialized JointState messages of one length; `log_ns` tells when the recorder got each.

    All whose bytes agree in everything but stamp and numbers have the layout of the first, and are read at once.
    """
    rows = np.frombuffer(b''.join(messages), np.uint8).reshape(len(messages), -1)
    times = np.array(log_ns, np.int64)
    while len(rows):
        try:
            layout = _Layout(rows[0].tobytes())
        except (struct.error, UnicodeDecodeError, IndexError):
            yield _MALFORMED
            rows, times = rows[1:], times[1:]
            continue
        count = _alike(rows, layout.fixed)
        yield layout.read(rows[:count])._replace(log_ns=times[:count])
        rows, times = rows[count:], times[count:]


def _alike(rows: NDArray[np.uint8], fixed: NDArray[np.bool_]) -> int:
    """How many rows from the first on agree with it in these bytes; looks further the longer they do."""
    ahead = 8
    while True:
        differs = (rows[:ahead, fixed] != rows[0, fixed]).any(axis=1)
        if differs.any():
            return int(differs.argmax())
        if ahead >= len(rows):
            return len(rows)
        ahead *= 8


_NONE = np.empty((1, 0))
_MALFORMED = JointBatch('', (), np.zeros(1, np.int64), _NONE, _NONE, _NONE, 'the message is malformed')


class _Layout:
    """Where a serialized JointState has its numbers (CDR: aligned to their size, counted from the fifth byte)."""

    def __init__(self, data: bytes) -> None:
        self._order = '<' if data[1] & 1 else '>'
        self._data, self._at = data, 12  # after the encapsulation and the stamp
        self.fixed = np.zeros(len(data), bool)
        self.fixed[:4] = True
        self.frame = self._string()
        self.names = tuple(self._string() for _ in range(self._count()))
        self._columns = [self._doubles() for _ in range(3)]

    def read(self, rows: NDArray[np.uint8]) -> JointBatch:
        """The messages of this layout."""
        stamps = np.ascontiguousarray(rows[:, 4:12]).view(f'{self._order}i4').reshape(-1, 2).astype(np.int64)
        stamp_ns = stamps[:, 0] * 1_000_000_000 + (stamps[:, 1] & 0xFFFFFFFF)
        columns = []
        for begin, count in self._columns:
            numbers = np.ascontiguousarray(rows[:, begin : begin + 8 * count]).view(f'{self._order}f8')
            given = count == len(self.names)
            columns.append(
                numbers.astype(np.float64).reshape(len(rows), count)
                if given
                else np.full((len(rows), len(self.names)), np.nan)
            )
        positions = self._columns[0][1]
        error = '' if positions == len(self.names) else names_and_positions(len(self.names), positions)
        return JointBatch(self.frame, self.names, stamp_ns, columns[0], columns[1], columns[2], error)

    def _count(self) -> int:
        self._at += -self._at % 4
        (count,) = struct.unpack_from(f'{self._order}I', self._data, self._at)
        self.fixed[self._at : self._at + 4] = True
        self._at += 4
        return int(count)

    def _string(self) -> str:
        length = self._count()
        text = struct.unpack_from(f'{length}s', self._data, self._at)[0]
        self.fixed[self._at : self._at + length] = True
        self._at += length
        return str(text[:-1], 'utf-8')

    def _doubles(self) -> tuple[int, int]:
        """Where they begin, and how many there are."""
        count = self._count()
        begin = self._at + -(self._at - 4) % 8 if count else self._at
        self._at = begin + 8 * count
        if self._at > len(self._data):
            raise IndexError
        return begin, count

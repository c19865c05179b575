"""Decompression that stays within bounds, whatever the compressed bytes claim to hold."""

import shutil
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from dcdrw_msgs_py.words import counted

LARGEST = 256 * 2**20
"""Longest chunk, and longest message, that is read [bytes]."""
ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
_BLOCK = 2**17
_PIECE = 2**10
"""Compressed bytes of a file that are read at once: they never hold more than 32 MB."""
_HIGHEST_RATIO = 1000
_ALWAYS_ALLOWED = 256 * 2**20
_KEPT_FREE = 64 * 2**20
"""What a decompressed file leaves of its disk."""


def decompress(data: bytes, compression: str, size: int = LARGEST) -> bytes:
    """Decompress a chunk or a message.

    Args:
        data: the compressed bytes.
        compression: `zstd`, `lz4`, or empty for none.
        size: longest output.

    Returns:
        What could be decompressed: less than there should be where the data are damaged, never more than `size` and one
        byte, which tells that there would be more.

    """
    if not compression:
        return data[: size + 1]
    parts: list[bytes] = []
    left = size + 1
    with suppress(Exception):  # of any kind, for the content may be anything
        stream = _stream(data, compression)
        while left and (part := stream.read(min(left, _BLOCK))):
            parts.append(part)
            left -= len(part)
    return b''.join(parts)


class Unpacked(NamedTuple):
    """How a compressed file was decompressed."""

    trouble: str = ''
    """What is wrong with it; empty where nothing is."""
    unended: bool = False
    """Whether no more is wrong than that its last frame has no end.

    rosbag2 ends none whose content is a multiple of 128 KiB: whether anything is missing, the content alone can tell.
    """


def unpack_file(source: Path, target: Path) -> Unpacked:
    """Decompress a zstd file, and keep what comes before damage.

    Raises:
        OSError: the file cannot be read or there is no room for its content.
        ValueError: it grows out of all proportion.

    """
    most = max(_ALWAYS_ALLOWED, _HIGHEST_RATIO * source.stat().st_size)
    written = 0
    with source.open('rb') as packed, target.open('wb') as out:
        parts = _unpacked(packed)
        while True:
            try:
                part = next(parts, None)
            except OSError:
                raise
            except Exception as error:  # of any kind, for the content may be anything
                text = f'its compressed data end in damage after {counted(written, "byte")} ({error})'
                return Unpacked(text, isinstance(error, EOFError))
            if part is None:
                return Unpacked()
            written += len(part)
            if written > most:
                raise ValueError(f'{source} grows beyond {_HIGHEST_RATIO} times its size when it is decompressed')
            if shutil.disk_usage(target.parent).free < _KEPT_FREE:
                raise OSError(
                    28, f'no room to decompress {source.name} (TMPDIR names another place)', str(target.parent)
                )
            out.write(part)


def _unpacked(packed: BinaryIO) -> Iterator[bytes]:
    """The content of a zstd file, frame after frame; unlike `_stream`, it tells where the last one is cut off."""
    from zstandard import ZstdDecompressor

    frame: Any = None
    for piece in iter(partial(packed.read, _PIECE), b''):
        while piece:
            frame = frame or ZstdDecompressor().decompressobj()
            yield frame.decompress(piece)
            piece, frame = (frame.unused_data, None) if frame.eof else (b'', frame)
    if frame:
        raise EOFError('the file is cut off')


def _stream(data: bytes, compression: str) -> Any:
    if compression == 'zstd':
        from zstandard import ZstdDecompressor

        return ZstdDecompressor().stream_reader(data, read_across_frames=True)
    from io import BytesIO

    from lz4.frame import LZ4FrameFile

    return LZ4FrameFile(BytesIO(data))

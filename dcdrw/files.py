"""Files that are written whole or not at all, and never over others unasked."""

import argparse
import csv
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import datetime
from enum import Enum
from pathlib import Path
from typing import Any, TextIO


def add_force(parser: argparse.ArgumentParser) -> None:
    """Add the option that allows to overwrite."""
    parser.add_argument('--force', action='store_true', help='overwrite what exists')


def refuse_existing(paths: Iterable[Path], force: bool = False) -> None:
    """Refuse to overwrite; for the start of a command, before it works for long.

    Raises:
        ValueError: one of the paths exists, and force is not used.

    """
    for path in () if force else paths:
        if path.exists() and not _is_device(path):
            raise ValueError(f'{path} exists already, not overwriting (--force does)')


def free_folder(chosen: Path | None, parent: str = 'trials') -> Path:
    """A folder for new results: the chosen one, by default one within `parent` named for this second.

    Nothing is made yet.

    Raises:
        ValueError: it holds something already.

    """
    folder = chosen or Path(parent) / datetime.now().strftime('%Y%m%d-%H%M%S')
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ValueError(f'{folder} exists already, not overwriting; choose another --out')
    return folder


def _is_device(path: Path) -> bool:
    return path.exists() and not path.is_file() and not path.is_dir()


@contextmanager
def write_whole(path: Path, force: bool = False) -> Iterator[Path]:
    """A path beside `path`, with its ending, to write to; it gets its final name once all is on the disk.

    Where writing fails or is interrupted, nothing is left.

    Raises:
        ValueError: `path` exists by the end, and force is not used.
        OSError: the file cannot be written; the message names `path`.

    """
    device = _is_device(path)  # /dev/null, say: nothing takes its place
    unfinished = path if device else path.with_name(f'.{path.stem}.{os.getpid()}{path.suffix}')
    try:
        yield unfinished
        if device:
            return
        with unfinished.open('rb') as file:
            os.fsync(file.fileno())
        refuse_existing([path], force)
        unfinished.replace(path)
    except OSError as error:
        if error.filename not in (None, unfinished, str(unfinished)):
            raise  # of another file, which is named
        raise OSError(error.errno, error.strerror or str(error), str(path)) from None
    finally:
        with suppress(OSError):
            if not device:
                unfinished.unlink()


def write_text(path: Path, text: str, force: bool = False) -> None:
    """Write a text in UTF-8.

    Raises:
        ValueError, OSError: as `write_whole`.

    """
    with write_whole(path, force) as unfinished:
        unfinished.write_text(text, encoding='utf-8')


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]], force: bool = False) -> None:
    """Write a table.

    Raises:
        ValueError, OSError: as `write_whole`.

    """
    with table_file(path, header, force) as table:
        table.add(rows)


@contextmanager
def table_file(path: Path, header: Iterable[str], force: bool = False) -> Iterator['Table']:
    """A table that grows, and is written whole or not at all.

    Raises:
        ValueError, OSError: as `write_whole`.

    """
    with write_whole(path, force) as unfinished, unfinished.open('w', encoding='utf-8', newline='') as file:
        yield Table(file, header)


_FORMULA = ('=', '+', '-', '@', '\t', '\r')
"""What a spreadsheet that opens a CSV file takes for the beginning of a formula."""


class Table:
    """CSV as every command writes it: what is unknown is empty, and text is never a formula to a spreadsheet.

    Args:
        file: to write to, opened with newline=''.
        header: the columns' names.

    """

    def __init__(self, file: TextIO, header: Iterable[str]) -> None:
        self._file, self._writer, self._marked = file, csv.writer(file), 0
        self._writer.writerow(header)

    def add(self, rows: Iterable[Iterable[Any]]) -> None:
        """Add rows."""
        self._writer.writerows(map(_cell, row) for row in rows)

    def mark(self) -> None:
        """Keep what there is now."""
        self._marked = self._file.tell()

    def forget(self) -> None:
        """Take back the rows since the last mark."""
        self._file.seek(self._marked)
        self._file.truncate()


def _cell(value: Any) -> Any:
    if isinstance(value, float) and math.isnan(value):
        return ''
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


def to_json(content: object) -> str:
    """A result as every command writes it for a program: named tuples as objects, NaN as null, states by names."""
    return json.dumps(_plain(content), indent=1, ensure_ascii=False, allow_nan=False) + '\n'


def _plain(value: object) -> Any:
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, tuple) and hasattr(value, '_asdict'):
        return _plain(value._asdict())
    if isinstance(value, Mapping):
        return {str(name): _plain(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value

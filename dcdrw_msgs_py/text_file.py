"""Text files and tables of strangers: read within bounds, and every trouble told with the file's name."""

import csv
import os
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterator
from io import StringIO
from pathlib import Path

LARGEST_TEXT = 16 * 2**20
"""A larger text is none of ours [bytes]."""
LARGEST_TABLE = 256 * 2**20
"""A larger table is none of ours [bytes]."""
_DECIMAL_COMMA = re.compile(r'(?<=\d),(?=\d)')


def one_line(text: object) -> str:
    """A stranger's name for a message: what would break the line, or command a terminal, as an escape."""
    return ''.join(c if c.isprintable() else c.encode('unicode_escape').decode() for c in str(text))


def read_text(path: Path, largest: int = LARGEST_TEXT, windows: bool = False) -> str:
    """The content of a text file in UTF-8.

    Args:
        path: of the file.
        largest: that is read [bytes].
        windows: take what spreadsheets write there, too: UTF-16 that begins with its mark, and Windows-1252.

    Raises:
        ValueError: too large, or not UTF-8; names the file.
        OSError: the file cannot be read.

    """
    # A pipe that nobody writes to is empty: without waiting for a writer who may never come.
    with open(path, 'rb', opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
        os.set_blocking(file.fileno(), True)
        data = file.read(largest + 1)
    if len(data) > largest:
        raise ValueError(f'{path} is larger than {largest // 2**20} MB: is it the right file?')
    if windows and data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return data.decode('utf-16', errors='replace')
    try:
        return data.decode('utf-8-sig')
    except UnicodeDecodeError as error:
        if windows:
            return data.decode('cp1252', errors='replace')
        if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
            raise ValueError(f'{path} is UTF-16 text: save it as UTF-8') from None
        line = data.count(b'\n', 0, error.start) + 1
        raise ValueError(
            f'{path}, line {line}: byte 0x{data[error.start]:02x} is not UTF-8 text: save it as UTF-8'
        ) from None


def csv_rows(path: Path, text: str, separator: str = ',') -> Iterator[tuple[int, list[str]]]:
    """The rows of a table that hold something and are no remark (#), each with the number of its last line.

    Raises:
        ValueError: not CSV; names the file, `path`, and the line.

    """
    reader, begins = csv.reader(StringIO(text, newline=''), delimiter=separator, strict=True), 1
    try:
        for row in reader:
            if any(cell.strip() for cell in row) and not row[0].lstrip().startswith('#'):
                yield reader.line_num, row
            begins = reader.line_num + 1
    except csv.Error as error:
        what = 'a quotation mark is not closed' if 'end of data' in str(error) else error
        raise ValueError(f'{path}, line {begins}: {what}') from None


def read_rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """The rows of a CSV file as `csv_rows` has them.

    As the first row has them, tabs, semicolons or commas stand between columns; where it is no comma, numbers may have
    a decimal comma, which is a point in what is returned.

    Raises:
        ValueError: not CSV; names the file and the line.
        OSError: the file cannot be read.

    """
    text = read_text(path, LARGEST_TABLE, windows=True)
    begins = re.search(r'^[ \t]*[^#\s].*', text, re.MULTILINE)
    separator = next((sign for sign in '\t;' if begins and sign in begins[0]), ',')
    has_points = separator == ',' or re.search(r'\d\.\d', text)
    for line, row in csv_rows(path, text, separator):
        yield line, row if has_points else [_DECIMAL_COMMA.sub('.', cell) for cell in row]

"""The help of commands, fitted to the terminal's width."""

import argparse
import re
import shutil
from collections.abc import Iterator
from textwrap import wrap

WIDEST = 118
"""Columns beyond which lines are hard to read."""
_HANGS = 6
_GAP = re.compile(r'(?<=\S) {2,}(?=\S)')
"""Between the two columns of a row."""
_COMMAND = re.compile(r'(\w+=\S+ )*(dcdrw|ros2|eval) ')


class HelpFormatter(argparse.HelpFormatter):
    """Refills paragraphs; keeps rows, which are indented, and breaks those that are too long.

    A row is a text, or two with two blanks or more between them; lines that are indented as the second text belong to
    it. A command is broken so that it can still be pasted into a shell.
    """

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=min(shutil.get_terminal_size().columns - 2, WIDEST))

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return '\n'.join(indent + line if line else '' for line in _fitted(text, width - len(indent)))


def _fitted(text: str, width: int) -> Iterator[str]:
    for block in _blocks(text):
        if not block.startswith(' '):
            yield from wrap(block, width, break_on_hyphens=False) or ['']
            continue
        left, gap, right = _columns(block)
        if len(block) <= width:
            yield block
        elif not right:
            yield from _row(left, width)
        elif len(left + gap) <= width // 2 and not _COMMAND.match(left.strip()):
            yield from wrap(right, width, initial_indent=left + gap, subsequent_indent=' ' * len(left + gap))
        else:
            yield from _row(left, width)
            yield from wrap(right, width, initial_indent=' ' * _HANGS, subsequent_indent=' ' * _HANGS)


def _blocks(text: str) -> Iterator[str]:
    """Paragraphs and rows, a line each."""
    block = ''
    for line in text.splitlines():
        if block and _goes_on(block, line):
            block += ' ' + line.strip()
            continue
        if block:
            yield block
        block = line
        if not line:
            yield ''
    if block:
        yield block


def _goes_on(block: str, line: str) -> bool:
    indented = len(line) - len(line.lstrip())
    if not block.startswith(' '):
        return bool(line) and not indented
    left, gap, right = _columns(block)
    return bool(right) and indented == len(left + gap)


def _columns(row: str) -> tuple[str, str, str]:
    gap = _GAP.search(row)
    return (row[: gap.start()], gap[0], row[gap.end() :]) if gap else (row, '', '')


def _row(text: str, width: int) -> list[str]:
    words = text.strip()
    indent = text[: len(text) - len(text.lstrip())]
    last = ' \\' if _COMMAND.match(words) else ''
    lines = wrap(
        words,
        width - len(last),
        initial_indent=indent,
        subsequent_indent=' ' * _HANGS,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line + last for line in lines[:-1]] + lines[-1:]

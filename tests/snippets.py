"""The commands and examples that stand in README and docs, found as a reader of Markdown finds them."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from markdown_it import MarkdownIt

from tests import ROOT

PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').glob('**/*.md'))]

ELSEWHERE = {
    **dict.fromkeys(('.', 'cd', 'cp', 'mkdir'), 'the shell has it'),
    **dict.fromkeys(('git', 'colcon', 'rosdep', 'apt'), "needs the reader's own workspace"),
    **dict.fromkeys(('ssh', 'rviz2', 'v4l2-ctl'), 'needs hardware, a display or another machine'),
}
"""Programs that no test runs, and why."""
PROGRAMS = {'dcdrw', 'ros2', 'make', 'python', 'pip', 'share=$(ros2', *ELSEWHERE}


class Snippet(NamedTuple):
    """Code, and where it stands."""

    page: Path
    line: int
    code: str

    def __str__(self) -> str:
        return f'{self.page.relative_to(ROOT)}:{self.line}'


def blocks(language: str = '') -> Iterator[Snippet]:
    """Blocks of code in a language; without one, those that are indented."""
    for page in PAGES:
        for token in _tokens(page):
            if token.type in ('fence', 'code_block') and token.info == language:
                yield Snippet(page, token.map[0] + 1, token.content)


def commands() -> Iterator[tuple[Snippet, list[str]]]:
    """Every command that stands in a block, as the shell would split it."""
    for block in blocks():
        if block.code.split(maxsplit=1)[0] not in PROGRAMS:  # an equation, a file, what a command prints
            assert not re.search(r'^dcdrw ', block.code, re.MULTILINE), str(block)
            continue
        lines = block.code.replace('\\\n', ' ').splitlines()
        for number, line in enumerate(lines):
            words = shlex.split(line, comments=True)
            while words:
                end = words.index('&&') if '&&' in words else len(words)
                yield Snippet(block.page, block.line + number, line), words[:end]
                words = words[end + 1 :]


def inline() -> Iterator[Snippet]:
    """Every piece of code within a sentence or a table."""
    for page in PAGES:
        for token in _tokens(page):
            for child in token.children or ():
                if child.type == 'code_inline':
                    yield Snippet(page, token.map[0] + 1 if token.map else 0, child.content)


def targets() -> Iterator[Snippet]:
    """Where links and pictures lead that stay within the repository."""
    for page in PAGES:
        for token in _tokens(page):
            for child in token.children or ():
                target = str(child.attrs.get('href') or child.attrs.get('src') or '')
                if target and '://' not in target:
                    yield Snippet(page, token.map[0] + 1 if token.map else 0, target)


def _tokens(page: Path) -> list:
    return MarkdownIt('commonmark').enable('table').parse(page.read_text(encoding='utf-8'))

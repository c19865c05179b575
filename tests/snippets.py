"""The commands and examples that stand in README, docs and tutorials, found as a reader of Markdown finds them."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from markdown_it import MarkdownIt

from tests import ROOT

PAGES = [
    ROOT / 'README.md',
    ROOT / 'CONTRIBUTING.md',
    *sorted((ROOT / 'docs').glob('*.md')),
    *sorted((ROOT / 'docs' / 'tutorials').glob('*.py')),
]


class Snippet(NamedTuple):
    """Code, and where it stands."""

    page: Path
    line: int
    code: str

    def __str__(self) -> str:
        return f'{self.page.relative_to(ROOT)}:{self.line}'


class Command(NamedTuple):
    """A command, as the shell would split it, and what it needs beyond this package; empty where it needs nothing."""

    place: Snippet
    words: tuple[str, ...]
    needs: str


def blocks(language: str) -> list[Snippet]:
    """Blocks of code in a language."""
    return [snippet for info, snippet in fences() if info == language]


def fences() -> Iterator[tuple[str, Snippet]]:
    """Every block of code that is not indented, with what it says that it is."""
    for page in PAGES:
        for token in _tokens(page):
            if token.type == 'fence':
                yield token.info, Snippet(page, token.map[0] + 1, token.content)


def commands() -> Iterator[Command]:
    """Every command: blocks that are indented hold nothing else.

    A comment that begins with `needs` says what a command needs: at the end of its line, or on a line of its own for
    the rest of the block.
    """
    for page in PAGES:
        for token in _tokens(page):
            if token.type == 'code_block':
                yield from _commands(Snippet(page, token.map[0] + 1, token.content))


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


def _commands(block: Snippet) -> Iterator[Command]:
    needed = ''
    for number, line in enumerate(block.code.replace('\\\n', ' ').splitlines()):
        said = re.search(r'(?:^|\s)# (needs .*)', line)
        words = shlex.split(line, comments=True)
        if said and not words:
            needed = said[1]
        needs = f'{needed} {said[1] if said else ""}'.strip()
        while words:
            end = words.index('&&') if '&&' in words else len(words)
            yield Command(block._replace(line=block.line + number, code=line), tuple(words[:end]), needs)
            words = words[end + 1 :]


def _tokens(page: Path) -> list:
    text = page.read_text(encoding='utf-8')
    return MarkdownIt('commonmark').enable('table').parse(text if page.suffix == '.md' else _told(text))


def _told(script: str) -> str:
    """The Markdown of a tutorial, each line where it stands; what is code is empty lines."""
    lines, told = [], False
    for line in script.splitlines():
        if line.startswith('# %%'):
            told = '[markdown]' in line
            lines.append('')
        else:
            lines.append(line.removeprefix('#').removeprefix(' ') if told else '')
    return '\n'.join(lines)

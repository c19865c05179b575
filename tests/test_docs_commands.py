"""What the docs tell to type is so: every command is run, or says what it needs that is not here."""

import re
import shlex
import subprocess
from configparser import ConfigParser
from contextlib import suppress
from itertools import pairwise

import pytest

from dcdrw.cli import COMMANDS, main
from dcdrw.command_line import CommandLine
from dcdrw.suite.executables import EXECUTABLES
from dcdrw_msgs_py.quantity import fields
from tests import ROOT
from tests.reader import FEWER, Reader
from tests.snippets import PAGES, Command, blocks, commands, inline

NODES = {node.name: {field.name for params in node.parameters for field in fields(params)} for node in EXECUTABLES}
TOPICS = {topic.name.lstrip('/'): topic.type for node in EXECUTABLES for topic in (*node.subscribes, *node.publishes)}
SERVICES = {
    f'/{node.name}/{name}': type_.rstrip(')')
    for node in EXECUTABLES
    for name, type_ in (service.removeprefix('~/').split(' (') for service in node.services)
}
HARDWARE = ('camera:=/dev/', 'camera:=0')
STANDING = list(commands())


def is_run(command: Command) -> bool:
    match command.words:
        case ['dcdrw' | 'cp', *_] | ['ros2', 'run', 'dcdrw', *_]:
            return True
    return False


def dcdrw(words: list[str]) -> None:
    _, unknown = CommandLine(COMMANDS, '', '').parser.parse_known_args(words)
    assert not unknown


def ros2(words: list[str]) -> None:
    match words:
        case ['run', 'dcdrw', 'dcdrw', *rest]:
            dcdrw(rest)
        case ['run', 'dcdrw', node, *rest]:
            assert node in {*NODES, 'suite'}
            for before, assignment in pairwise(rest):
                if before == '-p':
                    assert assignment.split(':=')[0] in NODES[node]
        case ['launch', 'dcdrw', file, *rest]:
            assert (ROOT / 'launch' / file).exists()
            text = (ROOT / 'launch' / 'dcdrw.launch.py').read_text(encoding='utf-8')
            for argument in rest:
                assert argument == '--show-args' or f"    '{argument.split(':=')[0]}': (" in text
        case ['topic', *_]:
            (topic,) = (word for word in words if word.startswith('/'))
            kind = [word for word in words if '/msg/' in word]
            assert kind in ([], [TOPICS[topic.lstrip('/')]])
        case ['service', 'call', service, kind, *_]:
            assert SERVICES[service] == kind
        case ['param', 'set', node, name, _]:
            assert name in NODES[node.lstrip('/')]
        case [('run' | 'pkg' | 'security'), *_]:  # another package's, which is not here
            pass
        case _:
            raise AssertionError('what does ros2 do with this?')


def make(words: list[str]) -> None:
    subprocess.run(['make', '--dry-run', *words], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)


def pip(words: list[str]) -> None:
    setup = ConfigParser()
    setup.read(ROOT / 'setup.cfg')
    for extras in re.findall(r'\[(.*?)\]', ' '.join(words)):
        known = {'distributed', *setup['options.extras_require']}
        assert set(extras.split(',')) <= known


def python(words: list[str]) -> None:
    path = f'{words[1].replace(".", "/")}.py' if words[0] == '-m' else words[0]
    script = (ROOT / path).read_text(encoding='utf-8')
    for word in words[1:]:
        assert not word.startswith('--') or f"'{word}'" in script


READERS = {'dcdrw': dcdrw, 'ros2': ros2, 'make': make, 'pip': pip, 'python': python}
SETS_UP = {'make', 'pip', '.venv/bin/pre-commit', '.', 'export'}
"""What makes a place where the others can be run; `.ci/run` does so on a clean checkout."""


@pytest.mark.parametrize('command', STANDING, ids=[str(command.place) for command in STANDING])
def test_every_command_is_run_or_says_what_it_needs(command):
    program, *_ = command.words
    if not is_run(command) and program not in SETS_UP:
        assert command.needs, 'say so: # needs ...'
    assert program != 'ros2' or 'a ROS 2' in command.needs
    assert not any(word.startswith(HARDWARE) for word in command.words) or 'camera' in command.needs


def read(words: list[str]) -> object:
    """Read the arguments of a command; the status with which its parser ends it, if it does."""
    try:
        READERS[words[0]](words[1:])
    except SystemExit as end:  # by --help, or by what the parser refuses
        return end.code
    return None


@pytest.mark.parametrize('command', STANDING, ids=[str(command.place) for command in STANDING])
def test_every_command_takes_its_arguments(command, capsys):
    if command.words[0] in READERS:
        assert not read([*command.words]), capsys.readouterr().err


def test_every_example_of_a_help_takes_its_arguments(capsys, monkeypatch):
    monkeypatch.setenv('COLUMNS', '200')
    for words in (['--help'], *([name, '--help'] for name in COMMANDS)):
        with suppress(SystemExit):
            main(words)
    examples = re.findall(r'^  (dcdrw .*?)(?:  .*)?$', capsys.readouterr().out, re.MULTILINE)
    assert len(examples) > 25
    for example in examples:
        assert not read(shlex.split(example)), (example, capsys.readouterr().err)


def test_commands_within_sentences_exist():
    known = CommandLine(COMMANDS, '', '').commands
    for snippet in inline():
        words = snippet.code.split()
        match words:
            case ['dcdrw', name, *rest] if not name.startswith('--'):
                assert name in known, str(snippet)
                known[name].load()
                options = {word.split('=')[0] for word in rest if word.startswith('--')}
                assert options <= set(known[name].option_strings), str(snippet)
            case ['ros2', _, _, _, *_] | [('make' | 'pip' | 'python'), _, *_]:
                assert not read(words), str(snippet)


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_no_command_of_a_page_finds_its_place_taken(page):
    taken = [
        words[words.index('--out') + 1]
        for place, words, _ in STANDING
        if place.page == page and '--out' in words and '--force' not in words
    ]
    assert len(taken) == len(set(taken)), taken


@pytest.mark.processes
@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_commands_of_a_page_run(page, tmp_path, monkeypatch, request, capsys):
    """In the order of the page; what stands on several pages is run on the first."""
    monkeypatch.chdir(tmp_path)
    for name, few in FEWER.items():
        monkeypatch.setattr(name, few)
    reader = Reader(tmp_path, request)
    first = {command.words: command for command in reversed(STANDING)}
    for command in STANDING:
        if command == first[command.words] and command.place.page == page and is_run(command):
            reader.type(command.words)
    told = capsys.readouterr().out
    for block in blocks('text'):
        if block.page == page and 'configured' in block.code:  # what `dcdrw calibrate` prints
            rows = [re.split('  +', line)[0] for line in block.code.splitlines()]
            assert [row for row in rows if row not in told] == ['...']

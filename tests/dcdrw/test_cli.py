"""The command line answers at once: a command's module is imported when the command is chosen."""

import os
import subprocess
import sys
from importlib import import_module

import pytest

from dcdrw.cli import COMMANDS, main
from tests import ROOT

HEAVY = {
    'numpy',
    'scipy',
    'numba',
    'rclpy',
    'matplotlib',
    'cv2',
    'yaml',
    'xarray',
    'dask',
    'aiohttp',
    'mcap',
    'rosbags',
}


def imported(*arguments: str) -> set[str]:
    """The modules that a command line has imported by its end."""
    code = (
        'import atexit, sys; from dcdrw.cli import main; '
        'atexit.register(lambda: print("\\0", *sys.modules)); sys.exit(main(sys.argv[1:]))'
    )
    done = subprocess.run(
        [sys.executable, '-c', code, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    return set(done.stdout.rpartition('\0')[2].split())


@pytest.mark.parametrize('arguments', [(), ('--help',), ('--version',), ('trail',)], ids=' '.join)
def test_nothing_heavy_is_imported_before_a_command_is_chosen(arguments):
    modules = imported(*arguments)
    assert 'dcdrw.cli' in modules
    assert not HEAVY & modules
    assert not {name for name in modules if name.startswith(('dcdrw_', 'dcdrw.commands.'))}


def test_a_command_imports_itself_alone():
    modules = imported('map', '--help')
    assert {name for name in modules if name.startswith('dcdrw.commands.')} == {'dcdrw.commands.return_map'}


def test_no_arguments_bring_the_help(capsys):
    assert main([]) == 0
    told = capsys.readouterr().out
    assert all(f' {name} ' in told for name in COMMANDS)


def test_help_is_what_the_table_says(capsys):
    with pytest.raises(SystemExit) as end:
        main(['--help'])
    assert end.value.code == 0
    told = ' '.join(capsys.readouterr().out.split())
    assert all(f'{name} {command.help}' in told for name, command in COMMANDS.items())


@pytest.mark.parametrize('columns', [60, 80, 120])
@pytest.mark.parametrize('arguments', [(), *((name,) for name in COMMANDS)], ids=['all', *COMMANDS])
def test_help_fits_the_terminal(arguments, columns, capsys, monkeypatch):
    monkeypatch.setenv('COLUMNS', str(columns))
    with pytest.raises(SystemExit):
        main([*arguments, '--help'])
    assert max(map(len, capsys.readouterr().out.splitlines())) < columns


def test_help_keeps_its_rows_and_commands_that_can_be_pasted(capsys, monkeypatch):
    monkeypatch.setenv('COLUMNS', '60')
    with pytest.raises(SystemExit):
        main(['figures', '--help'])
    told = capsys.readouterr().out
    assert '  pair          Mean speed and energy lost per metre\n                against the phase, of' in told
    assert '  dcdrw figures --out figures --only regimes basin \\\n      --format png,pdf\n' in told
    assert '  dcdrw figures --out figures\n      all of them\n' in told


@pytest.mark.parametrize('command', COMMANDS.values(), ids=COMMANDS)
def test_every_command_has_what_the_command_line_asks_of_it(command):
    module = import_module(f'dcdrw.commands.{command.module}')
    assert module.__doc__
    assert callable(module.add_arguments)
    assert callable(module.run)


@pytest.mark.parametrize(('word', 'meant'), [('trail', 'trial'), ('analyse', 'analyze'), ('repley', 'replay')])
def test_a_misspelt_command_is_asked_about(capsys, word, meant):
    assert main([word]) == 2
    assert capsys.readouterr().err == f'dcdrw: there is no command {word!r}; did you mean {meant}?\n'


def test_a_word_that_resembles_nothing_gets_no_suggestion(capsys):
    assert main(['xyzzy']) == 2
    assert capsys.readouterr().err == "dcdrw: there is no command 'xyzzy'; dcdrw --help lists them\n"


def test_a_misspelt_option_is_asked_about(capsys):
    assert main(['map', '--stpes', '3']) == 2
    assert capsys.readouterr().err == "dcdrw map: there is no argument '--stpes'; did you mean --steps?\n"


def test_a_wrong_option_gets_one_line(capsys):
    with pytest.raises(SystemExit) as end:
        main(['map', '--steps', 'many'])
    assert end.value.code == 2
    assert capsys.readouterr().err.count('\n') == 1


@pytest.mark.parametrize(
    ('line', 'words'),
    [
        ('dcdrw tr', {'trial', 'track'}),
        ('dcdrw map --sp', {'--spokes'}),
        ('dcdrw urdf --preset ', {'paper', 'paper-sweep'}),
        ('dcdrw analyze --expect sy', {'synchronized'}),
    ],
)
def test_the_shell_completes(line, words, tmp_path):
    """By the protocol of argcomplete, whose answer goes to file descriptor 8."""
    answer = tmp_path / 'answer'
    script = f'exec {sys.executable} -m dcdrw.cli 8>{answer} 9>/dev/null'
    environment = {'_ARGCOMPLETE': '1', '_ARGCOMPLETE_IFS': '\n', 'COMP_LINE': line, 'COMP_POINT': str(len(line))}
    subprocess.run(['sh', '-c', script], cwd=ROOT, env={**os.environ, **environment, 'COMP_TYPE': '9'}, check=True)
    assert {word.strip() for word in answer.read_text().split('\n')} == words


def test_an_option_without_a_command_is_asked_about(capsys):
    assert main(['--verison']) == 2
    assert capsys.readouterr().err == "dcdrw: there is no argument '--verison'; did you mean --version?\n"


@pytest.mark.parametrize('words', [['--version'], ['urdf']])
def test_a_reader_that_has_gone_ends_the_command_without_a_word(words):
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([sys.executable, '-m', 'dcdrw', *words], cwd=ROOT, stdout=writer, stderr=subprocess.PIPE)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, b'')


def test_a_full_disk_is_told_in_one_line():
    with open('/dev/full', 'w') as full:
        done = subprocess.run([sys.executable, '-m', 'dcdrw', 'urdf'], cwd=ROOT, stdout=full, stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (2, b'dcdrw urdf: no space left on device\n')

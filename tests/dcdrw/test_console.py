"""What commands share at a terminal."""

import argparse
import os
import pty
import re
import signal
import subprocess
import sys
import termios

import pytest

from dcdrw.console import LONGEST_LINE, add_json, degrees, in_words, interruptible, need, phase_percent, tell
from dcdrw.files import add_force
from tests import ROOT

LINE = """
import time
from dcdrw.console import Bar, LiveLine
with LiveLine() as line:
    line.EVERY = 0.0
    for k in range(3):
        line.show(f'{k} ' + 300 * 'x', 'green')
with Bar('counting', 'sheep') as bar:
    bar.begin(2)
    bar.more(2)
"""


def seen(columns: int, code: str = LINE, **environment: str) -> str:
    """What a terminal of so many columns is sent."""
    parent, child = pty.openpty()
    termios.tcsetwinsize(child, (24, columns)) if hasattr(termios, 'tcsetwinsize') else None
    process = subprocess.Popen(
        [sys.executable, '-c', code],
        stderr=child,
        stdout=child,
        cwd=ROOT,
        env={**os.environ, 'COLUMNS': str(columns), 'TERM': 'xterm-256color', **environment},
    )
    os.close(child)
    text = b''
    try:
        while part := os.read(parent, 65536):
            text += part
    except OSError:  # the last process has closed it
        pass
    os.close(parent)
    assert process.wait() == 0
    return text.decode()


@pytest.mark.parametrize('columns', [20, 60, 130])
def test_the_live_line_fits_into_the_terminal(columns):
    shown = seen(columns)
    plain = re.sub(r'\x1b\[[0-9;?]*[A-Za-z]', '', shown)
    lines = re.split(r'[\r\n]+', plain)
    assert any(line.startswith('2 x') and line.rstrip().endswith('…') for line in lines)
    assert max(map(len, lines)) <= columns


START = """
from unittest.mock import patch
from rich.console import Console
from dcdrw.console import Bar, LiveLine
show = Console.show_cursor
def interrupted(console, shown=True):
    done = show(console, shown)
    if not shown:
        raise KeyboardInterrupt
    return done
with patch.object(Console, 'show_cursor', interrupted):
    for line in LiveLine(), Bar('counting', 'sheep'):
        try:
            line.__enter__()
        except KeyboardInterrupt:
            print('interrupted')
"""


def test_a_signal_while_a_line_starts_leaves_the_cursor():
    shown = seen(80, START)
    assert shown.count('interrupted') == 2
    assert shown.rindex('\x1b[?25h') > shown.rindex('\x1b[?25l')


def test_colours_are_shown_but_where_nobody_wants_them():
    coloured = re.compile(r'\x1b\[[0-9;]*3[0-9]')
    assert coloured.search(seen(80))
    assert not coloured.search(seen(80, NO_COLOR='1'))


def test_without_a_terminal_nothing_is_shown():
    done = subprocess.run([sys.executable, '-c', LINE], cwd=ROOT, capture_output=True, check=True)
    assert done.stdout == done.stderr == b''


def test_what_is_missing_is_told_with_its_mend(monkeypatch):
    monkeypatch.setitem(sys.modules, 'aiohttp', None)
    with pytest.raises(ValueError, match='the live page needs aiohttp: pip install aiohttp'):
        need('the live page', 'argparse', 'aiohttp')


def test_an_error_is_one_line_that_commands_no_terminal_whatever_it_quotes():
    assert in_words(ValueError('a\nb\x1b[31m is no key (x.yaml)')) == 'a\\nb\\x1b[31m is no key (x.yaml)'
    told = in_words(ValueError(f'k must be a number, got {[1] * 10_000} (x.yaml)'))
    assert len(told) < LONGEST_LINE + 10
    assert told.startswith('k must be a number')
    assert told.endswith('(x.yaml)')


def test_a_phase_below_one_percent_is_asked_about():
    assert phase_percent('21.6') == 21.6
    assert phase_percent('0.216%') == 0.216
    assert phase_percent('0') == 0.0
    with pytest.raises(argparse.ArgumentTypeError, match=r'0\.216 means 21\.6 %\? Then give 21\.6, else 0\.216%'):
        phase_percent('0.216')


def test_an_angle_that_looks_like_radians_is_asked_about():
    assert degrees('2') == 2.0
    assert degrees('0.1°') == 0.1
    with pytest.raises(argparse.ArgumentTypeError, match=r'0\.035 means 0\.035 rad, which is 2\.005°\?'):
        degrees('0.035')


def options(*arguments: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser(exit_on_error=False)
    add_json(parser)
    add_force(parser)
    return parser.parse_args(arguments)


def test_a_result_is_told_to_a_person_or_to_a_program(capsys, tmp_path):
    tell(options(), ['five'], {'steps': 5})
    assert capsys.readouterr().out == 'five\n'
    tell(options('--json'), ['five'], {'steps': 5})
    assert capsys.readouterr().out == '{\n "steps": 5\n}\n'
    tell(options('--json', str(tmp_path / 'a.json')), ['five'], {'steps': 5})
    assert capsys.readouterr().out == 'five\n'
    assert (tmp_path / 'a.json').read_text() == '{\n "steps": 5\n}\n'
    with pytest.raises(ValueError, match=r'a\.json exists already'):
        tell(options('--json', str(tmp_path / 'a.json')), ['six'], {'steps': 6})


def test_an_argument_after_json_is_not_taken_for_its_file():
    with pytest.raises(argparse.ArgumentError, match=r'must end in \.json, got trials/first'):
        options('--json', 'trials/first')


def test_signals_are_noted_and_handlers_put_back():
    before = signal.getsignal(signal.SIGTERM)
    with interruptible() as noted:
        os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGINT)
        assert noted == [signal.SIGTERM, signal.SIGINT]
    assert signal.getsignal(signal.SIGTERM) == before

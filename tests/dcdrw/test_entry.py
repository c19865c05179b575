"""A signal ends every executable at once and in silence, from its first line on."""

import ctypes
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from dcdrw import entry
from dcdrw.command_line import _raised_signals
from dcdrw.console import Interrupted
from tests import ROOT
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

DELAYS = (50, 100, 200, 400, 800)
"""Processor time after which the signal comes [ms]: on a busy machine, too, a process is then equally far."""
COMMANDS = (
    'regimes',
    'sweep --out sweep.nc',
    'trial --out trial',
    'live --trial --port 0',
    'design',
    'record --out record',
)
NODES = [name for name in entry.EXECUTABLES if name != 'dcdrw']


def processor_time(process: subprocess.Popen[str]) -> float:
    """How long the main thread of a process has run [ms]."""
    return int(Path(f'/proc/{process.pid}/schedstat').read_text().split()[0]) / 1e6


def waits(process: subprocess.Popen[str]) -> bool:
    """Whether it needs almost no processor time any more: a node that has started and hears nothing."""
    before = processor_time(process)
    time.sleep(0.25)
    return process.poll() is None and processor_time(process) - before < 5.0


def answers_signals(process: subprocess.Popen[str]) -> bool:
    """Whether a process handles SIGTERM: the interpreter, whose own start nobody can change, has come to our code."""
    status = Path(f'/proc/{process.pid}/status').read_text()
    caught = next(int(line.split()[1], 16) for line in status.splitlines() if line.startswith('SigCgt'))
    return bool(caught >> (signal.SIGTERM - 1) & 1)


def with_mark(mark: str) -> list[str]:
    """The processes that inherited an environment."""
    found = []
    for folder in Path('/proc').glob('[0-9]*'):
        try:
            if mark.encode() in (folder / 'environ').read_bytes():
                found.append((folder / 'cmdline').read_text())
        except OSError:  # ended meanwhile, or somebody else's
            continue
    return found


def ended(arguments: list[str], number: int, delay: float, folder: Path) -> tuple[int, str]:
    """Exit status and error output of an executable that gets a signal; no process of it may be left."""
    mark = f'DCDRW_TEST_{os.getpid()}_{time.monotonic_ns()}'
    process = subprocess.Popen(
        [sys.executable, '-m', 'dcdrw.entry', *arguments],
        cwd=folder,
        env={**os.environ, 'PYTHONPATH': str(ROOT), 'MARK': mark},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    end = time.monotonic() + PATIENCE
    while process.poll() is None and not (processor_time(process) >= delay and answers_signals(process)):
        assert time.monotonic() < end, 'it neither works nor ends'
        time.sleep(1e-3)
        if answers_signals(process) and time.monotonic() > end - PATIENCE + 2.0 and waits(process):
            break
    process.send_signal(number)
    _, errors = process.communicate(timeout=PATIENCE)
    while left := with_mark(mark):
        assert time.monotonic() < end + PATIENCE, left
        time.sleep(0.05)
    return process.returncode, errors


@pytest.mark.parametrize('delay', DELAYS)
@pytest.mark.parametrize('command', COMMANDS)
def test_a_signal_ends_a_command(command, delay, tmp_path):
    number = (signal.SIGINT, signal.SIGTERM)[(COMMANDS.index(command) + DELAYS.index(delay)) % 2]
    status, errors = ended(['dcdrw', *command.split()], number, delay, tmp_path)
    assert 'Traceback' not in errors
    if command.startswith(('live', 'record')) and status == 0:
        return  # it was at work, and a signal is its regular end
    assert status == 128 + number, errors
    assert errors.count('\n') <= 1, errors


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('name', NODES)
def test_a_signal_ends_a_node(name, number, tmp_path):
    delay = DELAYS[(2 * NODES.index(name) + number) % len(DELAYS)]
    status, errors = ended([name], number, delay, tmp_path)
    assert 'Traceback' not in errors
    assert status in (0, 128 + number), errors  # 0 once it runs


def test_there_is_a_function_for_every_executable():
    assert all(callable(getattr(entry, name)) for name in entry.EXECUTABLES)
    with pytest.raises(AttributeError, match='no attribute'):
        getattr(entry, 'trial')  # noqa: B009


@pytest.mark.parametrize('name', NODES)
def test_a_node_imports_no_library_that_few_parameters_need(name):
    code = f'import sys, {entry.EXECUTABLES[name]}; print(*sys.modules)'
    done = subprocess.run([sys.executable, '-c', code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not {'scipy', 'numba', 'cv2', 'matplotlib', 'xarray', 'aiohttp', 'rich'} & set(done.stdout.split())


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_that_a_callback_of_c_drops_comes_again(number, capsys):
    callback = ctypes.CFUNCTYPE(None)(lambda: os.kill(os.getpid(), number))

    def work():
        callback()
        time.sleep(PATIENCE)

    with pytest.raises(Interrupted) as interrupted, _raised_signals():
        work()
    assert interrupted.value.number == number
    assert not capsys.readouterr().err


def test_an_interrupt_that_a_library_takes_for_an_error_of_its_own_is_an_interrupt():
    def broken_import():
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError('initialization failed') from None

    with pytest.raises(Interrupted), _raised_signals():
        broken_import()

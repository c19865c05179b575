"""What commands share at a terminal: types of arguments, live lines and bars, JSON, and what must be installed."""

import argparse
import errno
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from dcdrw.files import refuse_existing, to_json, write_text

MENDS = {
    'aiohttp': 'pip install aiohttp',
    'distributed': "pip install 'dask[distributed]'",
    'matplotlib': 'pip install matplotlib',
    'netCDF4': 'pip install netCDF4',
    'rclpy': "source a ROS 2, or pip install 'ros-jazzy-rclpy[fastrtps]' ros-jazzy-common-interfaces",
    'xarray': 'pip install xarray',
}
"""Modules that only some commands need, and what brings each."""
STDOUT = Path('-')
LONGEST_LINE = 1000
"""Signs of an error that are told."""
Line = TypeVar('Line', bound='LiveLine')


def need(what: str, *modules: str) -> None:
    """Make sure that modules are there.

    Args:
        what: needs them: 'a trial', say.
        modules: their names.

    Raises:
        ValueError: one is missing; the message says what to install.

    """
    for module in modules:
        try:
            import_module(module)
        except ImportError:
            raise ValueError(f'{what} needs {module}: {MENDS[module]}') from None


def cores() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count() or 1


def positive(text: str) -> float:
    """Parse a number > 0."""
    value = number(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f'must be > 0, got {text}')
    return value


def number(text: str) -> float:
    """Parse a finite number."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'must be a number, got {text!r}') from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f'must be finite, got {text}')
    return value


def count(text: str) -> int:
    """Parse a whole number ≥ 1."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'must be a whole number, got {text!r}') from None
    if value < 1:
        raise argparse.ArgumentTypeError(f'must be at least 1, got {text}')
    return value


def domain(text: str) -> int:
    """Parse a ROS domain; above 101 its ports would be those that Linux gives to anybody."""
    if not text.isdecimal() or int(text) > 101:
        raise argparse.ArgumentTypeError(f'must be a whole number from 0 to 101, got {text!r}')
    return int(text)


def phase_percent(text: str) -> float:
    """Parse a phase in percent of a step; a part of one, as 0.216, is asked about unless it ends in %."""
    value = number(text.removesuffix('%'))
    if question := part_of_one(value, text):
        raise argparse.ArgumentTypeError(question)
    return value


def part_of_one(percent: float, text: str) -> str:
    """What is asked about percents of a step that look like a part of one, as 0.216; empty where they do not."""
    if text.endswith('%') or not 0.0 < abs(percent) < 1.0:
        return ''
    return f'is in percent of a step: {text} means {100.0 * percent:g} %? Then give {100.0 * percent:g}, else {text}%'


def degrees(text: str) -> float:
    """Parse an angle in degrees; what looks like radians is asked about unless it ends in °."""
    value = number(text.removesuffix('°'))
    if 0.0 < abs(value) < 0.2 and not text.endswith('°'):
        turned = math.degrees(value)
        raise argparse.ArgumentTypeError(
            f'is in degrees: {text} means {text} rad, which is {turned:.4g}°? Then give {turned:.4g}, else {text}°'
        )
    return value


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add the option that asks for a program's form of the result."""
    parser.add_argument(
        '--json',
        type=_json_file,
        nargs='?',
        const=STDOUT,
        metavar='OUT.json',
        help='write the result here in SI units and radians, too; without a name, print it in the place of the text',
    )


def _json_file(text: str) -> Path:
    if text != str(STDOUT) and not text.endswith('.json'):
        raise argparse.ArgumentTypeError(f'must end in .json, got {text}; where another argument follows, --json=-')
    return Path(text)


def in_words(error: ValueError | OSError) -> str:
    """An error in one line without the system's numbers; of one that quotes half a file, the beginning and the end."""
    from dcdrw_msgs_py.text_file import one_line  # only where something went wrong

    text = one_line(_words(error))
    return text if len(text) <= LONGEST_LINE else f'{text[: LONGEST_LINE // 2]} … {text[-LONGEST_LINE // 2 :]}'


def _words(error: ValueError | OSError) -> str:
    if not isinstance(error, OSError) or not error.strerror:
        return str(error)
    reason = 'there is no such file or folder' if error.errno == errno.ENOENT else error.strerror.lower()
    return f'{error.filename}: {reason}' if error.filename else reason


def tell(options: argparse.Namespace, lines: Iterable[str], result: Any) -> None:
    """Print a result for a person, or for a program as `add_json` and `add_force` have it.

    Raises:
        ValueError, OSError: as `write_whole`.

    """
    if options.json == STDOUT:
        print(to_json(result), end='')
        return
    if options.json:
        write_text(options.json, to_json(result), getattr(options, 'force', False))
    for line in lines:
        print(line)


def tell_where(options: argparse.Namespace, text: str) -> None:
    """Print where results were written; where a program reads the output, beside it."""
    print(text, file=sys.stderr if options.json == STDOUT else sys.stdout)


def check_json(options: argparse.Namespace) -> None:
    """Refuse a file of --json that exists, before the work begins.

    Raises:
        ValueError: it does, and --force is not given.

    """
    if options.json and options.json != STDOUT:
        refuse_existing([options.json], getattr(options, 'force', False))


@contextmanager
def _stopped_on_error(shown: Any) -> Iterator[None]:
    """Where a signal comes while it starts, the terminal gets its cursor back."""
    try:
        yield
    except BaseException:
        with suppress(IndexError):  # of rich, where it is half begun
            shown.stop()
        shown.console.show_cursor(True)
        raise


class LiveLine:
    """One line on a terminal that is written over, fitted to its width; elsewhere nothing."""

    EVERY = 0.1
    """Seconds between two looks; what comes sooner is not shown."""

    def __init__(self, quiet: bool = False) -> None:
        self._live: Any = None
        self.on = sys.stderr.isatty() and not quiet
        self._shown = -math.inf

    def __enter__(self: Line) -> Line:
        if self.on:
            from rich.console import Console
            from rich.live import Live

            self._live = Live(console=Console(stderr=True), auto_refresh=False)
            with _stopped_on_error(self._live):
                self._live.start()
        return self

    def show(self, text: str, style: str = '') -> None:
        """Show a line; `style` as rich has it."""
        if self._live is None or time.monotonic() - self._shown < self.EVERY:
            return
        from rich.text import Text

        self._shown = time.monotonic()
        self._live.update(Text(text, style=style, no_wrap=True, overflow='ellipsis'), refresh=True)

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()


class Bar:
    """A bar with the pace and the time that is left, on a terminal only.

    Args:
        what: is done: 'tracking', say.
        unit: what is counted, in the plural.
        quiet: show nothing.

    """

    def __init__(self, what: str, unit: str, quiet: bool = False) -> None:
        self._what, self._unit = what, unit
        self._on = sys.stderr.isatty() and not quiet
        self._progress: Any = None
        self._begun = 0.0

    def __enter__(self) -> 'Bar':
        if self._on:
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            self._progress = Progress(
                TextColumn('{task.description}'),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn(self._unit),
                TextColumn('{task.fields[pace]}'),
                TimeRemainingColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            with _stopped_on_error(self._progress):
                self._progress.start()
                self._task = self._progress.add_task(self._what, total=None, pace='')
        return self

    def begin(self, total: int | None, done: int = 0) -> None:
        """Begin a part of the work, of which some may be done already; None: nobody knows how much it is."""
        self._done, self._before, self._begun = done, done, time.monotonic()
        if self._progress is not None:
            self._progress.reset(self._task, total=total, completed=done, pace='')

    def more(self, number: int) -> None:
        """So many more are done."""
        self.reach(self._done + number)

    def reach(self, done: int, total: int | None = None) -> None:
        """So many are done in all; where a total is given, the first call begins."""
        if total is not None and not self._begun:
            self.begin(total, done)
        self._done = done
        if self._progress is not None:
            pace = (done - self._before) / max(time.monotonic() - self._begun, 1e-3)
            self._progress.update(self._task, completed=done, pace=f'{pace:.3g} per s')

    def __exit__(self, *_: object) -> None:
        if self._progress is not None:
            self._progress.stop()


class Interrupted(KeyboardInterrupt):
    """A signal asked for an end."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


@contextmanager
def end_signals(handler: Callable[[int, Any], None]) -> Iterator[None]:
    """Signals that ask for an end go to this handler; afterwards to whoever had them before."""
    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as nohup has it
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


@contextmanager
def interruptible() -> Iterator[list[int]]:
    """Signals that ask for an end are noted in the list, so that the work ends between two parts of it."""
    noted: list[int] = []
    with end_signals(lambda number, _: noted.append(number)):
        yield noted


def interrupted_status(noted: list[int]) -> int:
    """The exit status after a signal."""
    return 128 + noted[0]

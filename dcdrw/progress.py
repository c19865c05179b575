"""What long work on frames shows meanwhile, and how it is asked to end."""

import math
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

WIDTH = 30
"""Of the bar, in characters."""


class Progress:
    """One line on a terminal, with the pace and the time that is left; elsewhere nothing."""

    def __init__(self, count: int, quiet: bool = False) -> None:
        """Start with `count` frames ahead; 0: nobody knows how many."""
        self._count, self._on = count, sys.stderr.isatty() and not quiet
        self._start, self._shown = time.monotonic(), -math.inf

    def show(self, done: int) -> None:
        """Tell how many frames are done."""
        now = time.monotonic()
        if not self._on or (now - self._shown < 0.1 and done != self._count):
            return
        rate, bar, of, left = done / max(now - self._start, 1e-3), '', '', ''
        if self._count:
            bar = f'{"█" * min(WIDTH * done // self._count, WIDTH):░<{WIDTH}} '
            of, left = f'/{self._count}', f', {max(self._count - done, 0) / rate:.0f} s to go'
        print(f'\r\x1b[K{bar}{done}{of} frames, {rate:.0f} per second{left}', end='', file=sys.stderr, flush=True)
        self._shown = now

    def end(self) -> None:
        """Leave the line as it is."""
        if self._on:
            print(file=sys.stderr)


@contextmanager
def interruptible() -> Iterator[list[int]]:
    """Signals that ask for an end are noted in the list, so that the work ends between two frames."""
    noted: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda n, _: noted.append(n)) for number in numbers]
    try:
        yield noted
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)

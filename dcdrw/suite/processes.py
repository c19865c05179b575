"""The nodes of a trial as processes of their own, on a domain of their own."""

import ctypes
import os
import random
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_STOP_SECONDS = 5.0
_PR_SET_PDEATHSIG = 1
_DOMAINS = range(1, 102)
"""Domains whose ports lie below Linux's ephemeral ones."""


@contextmanager
def free_domain() -> Iterator[int]:
    """A ROS domain that no participant on this machine uses, kept from other trials for as long as it is entered.

    Raises:
        OSError: every domain is in use.

    """
    for domain in random.sample(_DOMAINS, len(_DOMAINS)):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as claim:
            try:
                claim.bind(f'\0dcdrw/domain/{domain}')  # an abstract name, which goes with the process
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                    probe.bind(('', 7410 + 250 * domain))  # a domain's first participant (DDSI-RTPS 9.6.1)
            except OSError:
                continue
            yield domain
            return
    raise OSError('no free ROS domain on this machine; name one with --domain')


def _end_with_parent() -> None:
    """Have Linux end this process when its parent dies, however that comes about (prctl(2))."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


class NodeProcess:
    """One node: `python -m MODULE`, what it prints kept in a log file."""

    def __init__(self, name: str, module: str, arguments: list[str], environment: dict[str, str], log: Path) -> None:
        self.name = name
        self.log = log
        with log.open('wb') as file:
            self._process = subprocess.Popen(
                [sys.executable, '-m', module, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                env={**os.environ, **environment},
                start_new_session=True,  # Ctrl-C reaches the trial alone, which then stops its nodes in order
                preexec_fn=_end_with_parent,
            )

    @property
    def failure(self) -> str | None:
        """Why the node is not running, with the last line that it printed; None while it runs."""
        status = self._process.poll()
        if status is None:
            return None
        lines = self.log.read_text(encoding='utf-8', errors='replace').strip().splitlines()
        how = f'was killed by {signal.Signals(-status).name}' if status < 0 else f'ended with status {status}'
        return f'{self.name} {how}{": " + lines[-1] if lines else ""} (its output: {self.log})'

    def interrupt(self) -> None:
        """Ask the node to end."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)

    def wait(self) -> None:
        """Wait until the node has ended; kill it where it does not."""
        try:
            self._process.wait(_STOP_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

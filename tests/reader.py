"""A reader of the docs, who types the commands of a page one after the other, in one folder."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from dcdrw.cli import main
from dcdrw_msgs_py.topics import DIAGNOSTICS, JOINT_STATES
from tests import ROOT
from tests.patience import PATIENCE
from tests.trials import FIRST, STIFF

if TYPE_CHECKING:
    from tests.bench import Bench

ADDED = {
    'dcdrw design': '--seconds 3',
    'dcdrw figures': '--cache cache',
    'dcdrw film': '--fps 30',
    'dcdrw film --out film.mp4': '--seconds 3',
    'dcdrw identify': '--to 3 --fix mass,slope,b,D0,coupler_friction,rolling_resistance',
    'dcdrw live': '--port 0',
    'dcdrw sweep': '--starts 1 --seconds 2',
    'dcdrw trial': '--seconds 1 --quiet',
}
"""What is added to commands that begin so; all others are run as they stand."""
FEWER = {
    'dcdrw.commands.figures.Book.points': lambda book, full: 5,
    'dcdrw.commands.figures.LONG': 40.0,
    'dcdrw_sim.figures.regime_figures.CURVE_POINTS': 3,
    'dcdrw_sim.figures.sweep_figures.SAMPLES': 100,
    'dcdrw_sim.study.riddle.RATE': 100,
}
"""Of how many points a grid or a curve is made meanwhile."""
JUDGES = {'analyze', 'report', 'track', 'trial'}
"""Their exit status may be 1: so short a trial is too little for a verdict."""
ENDLESS = {
    'live': lambda out, folder: 'Live at' in out,
    'record': lambda out, folder: list(folder.glob('*/third/*.mcap')),
}
"""Commands that go on until Ctrl-C, and what shows that they are at work."""


class Reader:
    """Has what the docs take for granted: a checkout, a rig file, a film, trials that were run before."""

    def __init__(self, folder: Path, request: pytest.FixtureRequest) -> None:
        self._folder, self._request = folder, request
        for name in ('config', 'tests'):
            (folder / name).symlink_to(ROOT / name)

    def type(self, words: Sequence[str]) -> None:
        """Run a command; it ends well, and what it is told to write is there."""
        line = ' '.join(words)
        for before, word in pairwise(words):
            if before != '--out':
                self._bring(word)
        match words:
            case ['ros2', 'run', 'dcdrw', node, *arguments]:
                self._run_node(node, arguments)
            case ['dcdrw', command, *_] if line == FIRST:
                shutil.copytree(self._trial, 'trials/first')
            case ['dcdrw', command, *arguments]:
                added = ' '.join(more for begin, more in ADDED.items() if line.startswith(begin)).split()
                paths = [path for word in arguments for path in self._expanded(word)]
                self._run(command, [*paths, *added])
            case _:
                subprocess.run(words, check=True)
        if '--out' in words:
            assert Path(words[words.index('--out') + 1]).exists()

    def _run(self, command: str, arguments: list[str]) -> None:
        if command == 'trial' and '--help' not in arguments:
            assert self._start(command, arguments).wait(PATIENCE) in (0, 1), self._said
            assert 'Written: ' in self._said
        elif command in ENDLESS:
            process = self._start(command, arguments)
            self._wait(process, lambda: ENDLESS[command](self._said, self._folder), f'dcdrw {command} at work')
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE) == 0, self._said
        elif command == 'replay':
            self._bench.hear(JOINT_STATES)
            process = self._start(command, arguments)
            self._wait(process, lambda: process.poll() is not None, 'the end of a replay')
            assert process.returncode == 0, self._said
        else:
            try:
                status: object = main([command, *arguments])
            except SystemExit as end:  # by --help
                status = end.code
            assert status == 0 or (status == 1 and command in JUDGES), (command, arguments)

    def _run_node(self, node: str, arguments: list[str]) -> None:
        heard = self._bench.hear(DIAGNOSTICS)
        process = self._bench.start(node, *arguments)
        self._wait(process, lambda: node in {status.name for each in heard for status in each.status}, node)
        assert self._bench.end(process) == 0, self._bench.output(node)

    def _start(self, command: str, arguments: list[str]) -> 'subprocess.Popen[bytes]':
        environment = {'PYTHONPATH': str(ROOT), 'BROWSER': 'true', 'ROS_DOMAIN_ID': str(self._bench.domain)}
        with Path('said').open('wb') as said:
            process = subprocess.Popen(
                [sys.executable, '-m', 'dcdrw.cli', command, *arguments],
                env={**os.environ, **environment},
                stdout=said,
                stderr=subprocess.STDOUT,
            )
        self._bench.processes.append(process)
        return process

    def _wait(self, process: 'subprocess.Popen[bytes]', condition: Callable[[], Any], what: str) -> None:
        self._bench.wait(lambda: condition() or process.poll() is not None, what)
        assert condition(), self._said

    @property
    def _bench(self) -> 'Bench':
        bench: Bench = self._request.getfixturevalue('bench')
        return bench

    @property
    def _trial(self) -> Path:
        trial: Path = self._request.getfixturevalue('live_trial')
        return trial

    @property
    def _said(self) -> str:
        return Path('said').read_text(encoding='utf-8')

    def _expanded(self, word: str) -> list[str]:
        return [str(path) for path in sorted(Path().glob(word))] if '*' in word else [word]

    def _bring(self, word: str) -> None:
        """Lay there what a command reads, and no command of the page has made."""
        if self._expanded(word) and Path(self._expanded(word)[0]).exists():
            return
        match word:
            case 'my_rig.yaml':
                Path(word).write_text(STIFF)
            case 'calibrated.yaml':
                shutil.copy(ROOT / 'config' / 'rig.yaml', word)
            case 'case.json':
                shutil.copy(ROOT / 'tests' / 'data' / 'strikes.json', word)
            case 'trials/first' | 'trials/*':
                for name in ('first', 'second') if '*' in word else ('first',):
                    shutil.copytree(self._trial, Path('trials', name))
            case 'my_bag' | 'killed_bag':
                shutil.copytree(self._trial / 'recording', word)
            case 'roll.mp4' | 'trial.mp4':
                film = ['film', '--out', word, '--seconds', '6', '--no-follow', '--fps', '30']
                assert main([*film, '--image-width', '640', '--image-height', '360']) == 0
                stem = word.removesuffix('.mp4')
                shutil.copy(f'{stem}.camera.yaml', 'camera.yaml')

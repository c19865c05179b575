"""Run a sweep so that little is ever lost: finished blocks lie in a folder beside the file until all are there."""

import fcntl
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, wait
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dcdrw_sim.study.sweep import Block, Sweep, block_size, blocks, check_sweep, compute
from dcdrw_sim.study.sweep_dataset import Arrays, open_sweep, require_extra, sweep_of, write

_SPECIFICATION, _LOCK = 'sweep.json', 'lock'


class Progress(NamedTuple):
    """How far a sweep is."""

    points: int
    """Done, those of earlier runs among them."""
    total: int


def is_complete(path: Path, sweep: Sweep) -> bool:
    """Whether a file holds a sweep already.

    Raises:
        ValueError: it holds something else.
        OSError: it cannot be read.

    """
    if not path.exists():
        return False
    with open_sweep(path) as dataset:
        _require_same(path, sweep_of(dataset), sweep, 'choose another file (--force overwrites this one)')
    return True


def run_sweep(
    sweep: Sweep,
    path: Path,
    executor: Executor,
    at_once: int,
    report: Callable[[Progress], None] = lambda progress: None,
    force: bool = False,
) -> None:
    """Compute a sweep into a netCDF file; one that was interrupted goes on where it was.

    Blocks that are done lie in the folder PATH.parts until the file is written; each is written whole or not at all,
    so that nothing but blocks under way is lost, whatever happens. The result does not depend on the executor.

    Args:
        sweep: what to compute.
        path: the file to make.
        executor: threads (the kernels let go of Python's lock), processes, or a Dask cluster's.
        at_once: how many blocks it may have to do at any time.
        report: called at the start and after every block.
        force: overwrite a file that holds another sweep, or none.

    Raises:
        ValueError: an impossible sweep, another one at `path` or in its folder, or a library is missing.
        OSError: a file cannot be written, or another process is at work there.

    """
    require_extra('xarray', 'netCDF4', 'dask.array')
    check_sweep(sweep)
    if not force and is_complete(path, sweep):
        report(Progress(sweep.shape[0] * sweep.shape[1], sweep.shape[0] * sweep.shape[1]))
        return
    with _Parts.opened(path, sweep) as parts:
        for progress in parts.fill(executor, at_once):
            report(progress)
        unfinished = parts.folder / 'sweep.nc'
        write(unfinished, sweep, ((block, parts.load(block)) for block in parts.blocks), parts.steps())
        os.replace(unfinished, path)
        parts.remove()


class _Parts:
    """The finished blocks of a sweep, each a file."""

    def __init__(self, folder: Path, sweep: Sweep, size: int) -> None:
        self.folder, self.sweep = folder, sweep
        self.blocks = blocks(sweep, size)

    @classmethod
    @contextmanager
    def opened(cls, path: Path, sweep: Sweep) -> Iterator['_Parts']:
        """The folder of a sweep, new or as it was left, and nobody else's meanwhile."""
        folder = path.with_name(path.name + '.parts')
        specification = folder / _SPECIFICATION
        if not specification.exists():
            if folder.exists():
                raise ValueError(f'{folder} exists already and holds no unfinished sweep; choose another file')
            _make_folder(folder, json.dumps({'sweep': sweep.to_json(), 'block_size': block_size(sweep)}))
        with open(folder / _LOCK, 'w') as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise OSError(f'another process is at work in {folder}') from None
            content = json.loads(specification.read_bytes())
            _require_same(folder, Sweep.from_json(content['sweep']), sweep, 'choose another file, or remove it')
            yield cls(folder, sweep, content['block_size'])

    def fill(self, executor: Executor, at_once: int) -> Iterator[Progress]:
        """Compute every block that is not there yet."""
        missing = [block for block in self.blocks if not self._file(block).exists()]
        total = self.sweep.shape[0] * self.sweep.shape[1]
        points = total - sum(map(_points, missing))
        waiting, running = iter(missing), {}  # type: Iterator[Block], dict[Any, Block]
        yield Progress(points, total)
        try:
            while len(running) < at_once and (block := next(waiting, None)):
                running[executor.submit(compute, self.sweep, block)] = block
            while running:
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    block = running.pop(future)
                    self._save(block, future.result())
                    points += _points(block)
                    if following := next(waiting, None):
                        running[executor.submit(compute, self.sweep, following)] = following
                    yield Progress(points, total)
        finally:
            for future in running:
                future.cancel()

    def load(self, block: Block) -> Arrays:
        """The arrays of a block."""
        with np.load(self._file(block)) as arrays:
            return dict(arrays)

    def steps(self) -> int:
        """The most sections of any motion that are kept."""
        longest = 0
        for block in self.blocks if self.sweep.trajectories else ():
            with np.load(self._file(block)) as arrays:
                longest = max(longest, int(arrays['section_time'].shape[-1]))
        return longest

    def remove(self) -> None:
        """Remove the folder; what somebody else has put into it stays, and so does the folder then."""
        for file in (*map(self._file, self.blocks), self.folder / _SPECIFICATION, self.folder / _LOCK):
            file.unlink(missing_ok=True)
            file.with_suffix('.tmp').unlink(missing_ok=True)  # of a process that was killed
        with suppress(OSError):
            self.folder.rmdir()

    def _save(self, block: Block, arrays: Arrays) -> None:
        _write_whole(self._file(block), lambda file: np.savez(file, **arrays))  # type: ignore[arg-type]

    def _file(self, block: Block) -> Path:
        return self.folder / f'{block[0].start}-{block[1].start}.npz'


def _make_folder(folder: Path, specification: str) -> None:
    """Make a folder of parts that holds its specification from the first instant on."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    new = Path(tempfile.mkdtemp(prefix=f'.{folder.name}.', dir=folder.parent))
    (new / _SPECIFICATION).write_text(specification, encoding='utf-8')
    try:
        new.rename(folder)
    except OSError:  # another process was quicker
        shutil.rmtree(new)


def _points(block: Block) -> int:
    along_x, along_y = (int(part.stop - part.start) for part in block)
    return along_x * along_y


def _write_whole(path: Path, write_to: Callable[[Any], object]) -> None:
    """Write a file that is never seen half written."""
    unfinished = path.with_suffix('.tmp')
    with open(unfinished, 'wb') as file:
        write_to(file)
    os.replace(unfinished, path)


def _require_same(where: Path, there: Sweep, here: Sweep, mend: str) -> None:
    """Refuse to mix two sweeps.

    Raises:
        ValueError: they differ.

    """
    if there.to_json() != here.to_json():
        names = [name for name, a, b in zip(Sweep._fields, there, here, strict=True) if repr(a) != repr(b)]
        raise ValueError(f'{where} holds a sweep that differs in {", ".join(names)}; {mend}')

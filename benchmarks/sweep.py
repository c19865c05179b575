"""The sweep's speed beside the bare kernel and SciPy, and its memory, all in one run.

    python benchmarks/sweep.py [--rounds 5] [--scipy 12]

The workload is the paper's sweep, as `dcdrw sweep` computes it: k̂ × b̂ on 50 × 50 logarithmic steps, nine starts,
200 time units; 22 500 trajectories. The programs take turns, and the best round of each counts:

- bare kernel: the compiled loop alone, parameters, starts and memory ready; one call on each core;
- trajectories: as the sweep makes them, block by block on a pool of threads, parameters and starts included;
- whole sweep: with verdicts, limit cycles, multipliers and both regressions of every point;
- SciPy's DOP853 at the kernel's accuracy, on some of those trajectories that keep rolling, on one core.

Each has two times: by the clock, and of the processors, which holds on a busy machine as well. Ratios to SciPy are per
core.
Memory is the peak of a process that computes a sweep into a file, all trajectories kept, 50 time units.
Goals: trajectories at 90 % of the bare kernel on all cores, and each core 500 times SciPy; the whole sweep in seconds;
memory that does not grow with the points.
"""

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import trajectories

from dcdrw_sim.model.rigs import take
from dcdrw_sim.motion import ensemble
from dcdrw_sim.study.points import run_starts
from dcdrw_sim.study.sweep import Axis, block_size, blocks, compute, papers_sweep, rigs_of, room
from dcdrw_sim.study.sweep_run import run_sweep
from dcdrw_sim.study.verdict import Verdict, judge

SWEEP = papers_sweep()
CORES = len(os.sched_getaffinity(0))
BLOCKS = blocks(SWEEP, block_size(SWEEP))
WHOLE = (slice(0, SWEEP.shape[0]), slice(0, SWEEP.shape[1]))
COUNT = math.prod(SWEEP.shape) * len(SWEEP.phases)
SIZES = ((50, 50), (400, 50))
"""Points along x and y of the two sweeps whose memory is measured."""


def bare_kernel() -> Callable[[int], None]:
    """The compiled loop on all trajectories, in as many calls as there are cores."""
    pairs, motions = run_starts(rigs_of(SWEEP, WHOLE), SWEEP.seconds, SWEEP.phases, room(SWEEP))
    starts, capacity = motions.strikes['state'][:, 0].copy(), int(motions.counts.max()) + 1
    del motions
    jobs = []
    for part in np.array_split(np.arange(COUNT), CORES):
        work, parameters = ensemble._aligned(ensemble.SIZE), ensemble._parameters(take(pairs, part))
        motion = ensemble._blank(len(part), capacity, extremes=True)
        limits = SWEEP.seconds, ensemble.ENSEMBLE_TOLERANCE
        jobs.append((work, parameters, starts[part], *limits, None, True, None, None, *motion))

    def program(cores: int) -> None:
        for job in jobs:
            job[10][:] = 0  # the counts
        on_threads(cores, lambda job: ensemble._run(*job), jobs)

    return program


def on_threads(cores: int, function: Callable[..., object], arguments: Sequence[Any]) -> None:
    """Call a function on every argument, and forget what it returns."""
    with ThreadPoolExecutor(cores) as pool:
        for future in [pool.submit(lambda one: function(one) and None, one) for one in arguments]:
            future.result()


def make_trajectories(cores: int) -> None:
    on_threads(cores, lambda block: run_starts(rigs_of(SWEEP, block), SWEEP.seconds, SWEEP.phases, room(SWEEP)), BLOCKS)


def whole_sweep(cores: int) -> None:
    on_threads(cores, lambda block: compute(SWEEP, block), BLOCKS)


def rolling_with_scipy(count: int) -> Callable[[], None]:
    """Some of those trajectories that keep rolling."""
    pairs, motions = run_starts(rigs_of(SWEEP, WHOLE), SWEEP.seconds, SWEEP.phases, room(SWEEP))
    rolling = np.flatnonzero(judge(motions, pairs, 1)[0].verdict <= Verdict.ELSEWHERE)
    which = np.random.default_rng(1).permutation(rolling)[:count]
    # Its start is just after the strike with which ours begins.
    trajectories.SECONDS = SWEEP.seconds
    trajectories.RIG = trajectories.RIG._replace(S0=trajectories.RIG.S0 + trajectories.STRIDE)
    starts = motions.strikes['state'][which, 0] * (-1.0, trajectories.RESTITUTION, 1.0, 1.0)

    def program() -> None:
        for start, pair in zip(starts, which, strict=True):
            found = trajectories.scipy_strikes(start.tolist(), float(pairs.k[pair]), float(pairs.b[pair]))
            assert abs(len(found) + 1 - motions.counts[pair]) <= 1, 'SciPy sees other strikes'

    return program


def timed(program: Callable[[], None]) -> tuple[float, float]:
    """What a program takes by the clock, and of the processors [s]."""
    clock, processors = time.perf_counter(), time.process_time()
    program()
    return time.perf_counter() - clock, time.process_time() - processors


def memory(shape: tuple[int, int]) -> float:
    """Peak of a process that computes a sweep of this shape [MB]."""
    done = subprocess.run(
        [sys.executable, __file__, '--memory', *map(str, shape)], check=True, capture_output=True, text=True
    )
    return float(done.stdout)


def print_own_memory(shape: tuple[int, int]) -> None:
    x, y = (
        Axis(axis.name, tuple(np.geomspace(axis.values[0], axis.values[-1], count).tolist()))
        for axis, count in zip((SWEEP.x, SWEEP.y), shape, strict=True)
    )
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(CORES) as pool:
        run_sweep(SWEEP._replace(x=x, y=y, seconds=50.0), Path(folder) / 'sweep.nc', pool, CORES + 1)
    status = dict(line.split(':', 1) for line in Path('/proc/self/status').read_text().splitlines())
    print(int(status['VmHWM'].split()[0]) / 1024)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition('\n')[0])
    parser.add_argument('--rounds', type=int, default=5, help='how often each program runs (default 5)')
    parser.add_argument('--scipy', type=int, default=12, help='trajectories that SciPy makes (default 12)')
    parser.add_argument('--memory', type=int, nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.memory:
        print_own_memory(tuple(options.memory))
        return
    programs = {'bare kernel': bare_kernel(), 'trajectories': make_trajectories, 'whole sweep': whole_sweep}
    best = {(name, cores): (math.inf, math.inf) for cores in sorted({1, CORES}) for name in programs}
    for turn in range(1 + options.rounds):  # the first compiles, and touches all memory
        for name, cores in best:
            print(f'round {turn}: {name}, {cores} cores …    ', end='\r', file=sys.stderr)
            taken = timed(lambda name=name, cores=cores: programs[name](cores))
            if turn:
                best[name, cores] = tuple(map(min, taken, best[name, cores]))
    scipy = timed(rolling_with_scipy(options.scipy))
    print(f'{COUNT} trajectories{"":12}{"s":>8}{"of bare":>9}{"× SciPy":>9}{"CPU s":>9}{"of bare":>9}{"× SciPy":>9}')
    one = tuple(taken * COUNT / options.scipy for taken in scipy)
    for (name, cores), taken in best.items():
        ratios = [
            (bare / mine, reference / mine / spread)
            for bare, mine, reference, spread in zip(best['bare kernel', cores], taken, one, (cores, 1), strict=True)
        ]
        print(
            f'{name + f", {cores} core" + "s" * (cores > 1):30}'
            + ''.join(
                f'{mine:{width}.2f}{100 * part:8.0f}%{times:9.0f}'
                for mine, (part, times), width in zip(taken, ratios, (8, 9), strict=True)
            )
        )
    print(f'{"SciPy DOP853, 1 core":30}{one[0]:8.0f}{"":18}{one[1]:9.0f}')
    small, large = map(memory, SIZES)
    print(f'\npeak memory: {small:.0f} MB for {math.prod(SIZES[0])} points, {large:.0f} MB for {math.prod(SIZES[1])}')


if __name__ == '__main__':
    main()

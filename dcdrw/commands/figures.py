"""`dcdrw figures`: draw every simulated figure of the paper, and what explains them, from sweeps that are kept."""

import argparse
import hashlib
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dcdrw.console import Bar, cores
from dcdrw.drawings.figure_files import add_formats, figure_files, write_figure
from dcdrw.files import add_force, refuse_existing
from dcdrw_msgs_py.in_step import BAND_PERCENT
from dcdrw_sim.figures import model_figures, regime_figures, sweep_figures
from dcdrw_sim.figures.riddle_figure import draw_riddle
from dcdrw_sim.figures.style import COLUMN, PAGE, for_print, new_figure
from dcdrw_sim.map.return_map import ReturnMap
from dcdrw_sim.model.presets import preset
from dcdrw_sim.rig.simulator import SimulatorParams
from dcdrw_sim.source import fingerprint
from dcdrw_sim.study.regimes import BASIN_SECONDS, basin, least_speeds
from dcdrw_sim.study.sweep import POINTS, RANGES, Axis, Sweep, papers_sweep
from dcdrw_sim.study.sweep_dataset import open_sweep, require_extra
from dcdrw_sim.study.sweep_run import is_complete, run_sweep

PAPERS_RIG, PAPERS_SWEEP = preset('paper'), preset('paper-sweep')
PRELOADED = PAPERS_SWEEP._replace(D0=PAPERS_SWEEP.resolved().S0)
"""The other natural reading of the paper's D0: the spring at rest where both wheels stand alike."""
BASINS = ((5e-3, 0.15), (5e-3, 3.0))
"""k̂ and b̂ of couplers on either side of the stall band."""
LONG, LONG_POINTS = 1000.0, 40
"""Time units in which all that walks is decided, but the slowest, and points along each axis there."""
SLOPES, DAMPINGS = (1.1, 2.6), (1e-2, 1e2)
COMPUTES = ('dcdrw_msgs_py', *(f'dcdrw_sim.{room}' for room in ('model', 'motion', 'map', 'relatives', 'study')))
"""Packages on which a sweep depends."""
EXPERIMENT_SECONDS = 5.0

_EPILOG = """\
figures:
{figures}
Sweeps are kept in the cache, each under a name that tells its exact parameters and the code's version, and are used
again; one that was interrupted goes on where it was.

examples:
  dcdrw figures --out figures                          all of them
  dcdrw figures --out figures --only regimes basin --format png,pdf
  dcdrw figures --out figures --quick                  coarse, in some seconds
"""


class Book(NamedTuple):
    """Where figures get their sweeps."""

    cache: Path
    quick: bool

    def sweep(self, name: str, sweep: Sweep) -> Any:
        """The Dataset of a sweep, computed unless it is kept already."""
        path = self.cache / f'{name}-{_key(sweep)}.nc'
        if not is_complete(path, sweep):
            with ThreadPoolExecutor(cores()) as executor, Bar(name, 'points') as bar:
                try:
                    run_sweep(sweep, path, executor, cores() + 1, lambda progress: bar.reach(*progress))
                except KeyboardInterrupt:
                    executor.shutdown(cancel_futures=True)
                    raise
        return open_sweep(path)

    def points(self, full: int) -> int:
        """How many points to draw."""
        return max(full // 5, 8) if self.quick else full


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    listed = ''.join(f'  {name:<14}{(draw.__doc__ or "").splitlines()[0]}\n' for name, draw in FIGURES.items())
    parser.description = 'Draw every simulated figure of the paper, its method mended, from sweeps that are kept.'
    parser.epilog = _EPILOG.format(figures=listed)
    parser.add_argument('--out', type=Path, required=True, metavar='DIR', help='where to put them')
    add_force(parser)
    parser.add_argument(
        '--only', nargs='+', choices=FIGURES, metavar='NAME', default=list(FIGURES), help='some of them only'
    )
    add_formats(parser)
    parser.add_argument('--quick', action='store_true', help='coarse sweeps: to look, not to print')
    parser.add_argument('--cache', type=Path, metavar='DIR', help='where to keep sweeps (default: ~/.cache/dcdrw)')


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    require_extra('xarray', 'netCDF4', 'dask.array')
    new_figure(1, 1, 'a figure')
    names = dict.fromkeys(options.only)
    refuse_existing(figure_files(options.out, names, options.formats), options.force)
    book = Book(options.cache or _default_cache(), options.quick)
    book.cache.mkdir(parents=True, exist_ok=True)
    for name in names:
        with for_print():
            paths = write_figure(FIGURES[name](book), options.out, name, options.formats, options.force)
        print(*paths, sep='\n')
    return 0


def _trajectories(book: Book) -> Any:
    """θ2 at the section of every start of every coupler that converges."""
    figure = new_figure(COLUMN, 2.6)
    with book.sweep('paper', _paper(book)) as dataset:
        sweep_figures.draw_trajectories(figure.subplots(), dataset)
    return figure


def _eigenvalues(book: Book) -> Any:
    """Couplers that converge, with the largest eigenvalue: the paper's way, mended, and exact."""
    from matplotlib.colors import Normalize

    figure = new_figure(PAGE, 5.4)
    rows = (('paper', PAPERS_SWEEP, 'D0 = S0 + ℓ sin α'), ('preloaded', PRELOADED, 'D0 = S0'))
    for line, (name, rig, title) in zip(figure.subplots(2, 3, sharex=True, sharey=True), rows, strict=True):
        with book.sweep(name, _paper(book)._replace(rig=rig)) as dataset:
            for axes, variable in zip(line, sweep_figures.EIGENVALUES, strict=True):
                mesh = sweep_figures.draw_eigenvalues(axes, dataset, variable, Normalize(0.75, 1.0))
                axes.label_outer()
            line[0].set_ylabel(f'{title}\n\n{line[0].get_ylabel()}')
        figure.colorbar(mesh, ax=line, label='largest modulus')
    return figure


def _best(book: Book) -> Any:
    """The best coupler's motions, and what the regressions predict."""
    figure = new_figure(PAGE, 3.0)
    with book.sweep('paper', _paper(book)) as dataset:
        for axes, form in zip(figure.subplots(1, 2, sharex=True, sharey=True), ('raw', 'affine'), strict=True):
            sweep_figures.draw_best(axes, dataset, form)
            axes.label_outer()
    return figure


def _experiment(book: Book) -> Any:
    """The paper's experiment in simulation: 5 s from 21.6 %."""
    figure = new_figure(COLUMN, 3.6)
    rig, start = SimulatorParams().start(PAPERS_RIG)
    angles, phase = figure.subplots(2, 1, sharex=True)
    sweep_figures.draw_experiment(angles, phase, rig, start, EXPERIMENT_SECONDS, BAND_PERCENT)
    angles.label_outer()
    return figure


def _regimes(book: Book) -> Any:
    """What becomes of a pair over stiffness and damping, and over slope and damping."""
    figure = new_figure(PAGE, 4.7)
    (coupler, preloaded, slope), rooms = figure.subplots(2, 3, height_ratios=(3.0, 2.3))
    for axes, name, rig, title in (
        (coupler, 'paper-long', PAPERS_SWEEP, 'D0 = S0 + ℓ sin α: no preload'),
        (preloaded, 'preloaded-long', PRELOADED, 'D0 = S0: preloaded'),
    ):
        sweep = _paper(book, LONG_POINTS)._replace(rig=rig, seconds=LONG, trajectories=False)
        with book.sweep(name, sweep) as dataset:
            regime_figures.draw_coupler_regimes(axes, dataset, papers_sweep().seconds)
        axes.set_title(title)
    points = book.points(LONG_POINTS)
    sweep = papers_sweep()._replace(
        x=Axis('slope_deg', tuple(np.linspace(*SLOPES, points).tolist())),
        y=Axis('b', tuple(np.geomspace(*DAMPINGS, points).tolist())),
        seconds=LONG,
        trajectories=False,
    )
    with book.sweep('slopes', sweep) as dataset:
        regime_figures.draw_slope_regimes(slope, dataset)
    slope.set_title(f'k̂ = {PAPERS_SWEEP.k:g}')
    for room in rooms:
        room.set_axis_off()
    regime_figures.label_regimes(preloaded, rooms[0], loc='upper left', frameon=False)
    regime_figures.label_regimes(slope, rooms[2], loc='upper right', frameon=False)
    for room in (rooms[0], rooms[2]):
        room.get_legend().set_in_layout(False)  # wider than its axes, beside which there is room
    return figure


def _basin(book: Book) -> Any:
    """From which phases and speeds a pair comes into step, with a coupler on either side of the stall band."""
    figure = new_figure(PAGE, 3.2)
    points = book.points(100)
    for axes, (k, b) in zip(figure.subplots(1, 2, sharey=True), BASINS, strict=True):
        rig = PAPERS_SWEEP._replace(k=k, b=b)
        phases = np.linspace(0.0, 1.0, points, endpoint=False)
        found = basin(rig, phases, np.linspace(0.3, 2.0, points), BASIN_SECONDS)
        mesh = regime_figures.draw_basin(axes, rig, found, (phases, least_speeds(rig, phases, BASIN_SECONDS)))
        in_step = np.isfinite(found.steps).any()
        figure.colorbar(mesh, ax=axes, label='steps to synchronization' if in_step else 'strike steps: never in step')
        axes.label_outer()
    return figure


def _pair(book: Book) -> Any:
    """Mean speed and energy lost per metre against the phase, of the pair with a rigid bar."""
    figure = new_figure(PAGE, 3.2)
    speed, energy = figure.subplots(1, 2)
    rig, cycle = PAPERS_RIG.resolved(), ReturnMap(PAPERS_RIG)
    fixed = cycle.fixed_point()
    coupled = float(cycle.phase(fixed.state)), rig.front.step_length / fixed.period
    model_figures.draw_speed(speed, rig, coupled, book.points(81))
    model_figures.draw_energy(energy, rig, book.points(33))
    return figure


def _riddle(book: Book) -> Any:
    """What would explain the paper's 7 steps, and what a longer trial would show."""
    figure = new_figure(PAGE, 3.2)
    draw_riddle(*figure.subplots(1, 2, sharey=True))
    return figure


FIGURES: dict[str, Callable[[Book], Any]] = {
    'trajectories': _trajectories,
    'eigenvalues': _eigenvalues,
    'best': _best,
    'experiment': _experiment,
    'regimes': _regimes,
    'basin': _basin,
    'pair': _pair,
    'riddle': _riddle,
}


def _paper(book: Book, points: int = POINTS) -> Sweep:
    """The paper's sweep, on so many points along each axis, or on fewer to be quick."""
    x, y = (Axis(name, tuple(np.geomspace(*RANGES[name], book.points(points)).tolist())) for name in ('k', 'b'))
    return papers_sweep()._replace(x=x, y=y)


def _key(sweep: Sweep) -> str:
    """What tells a sweep from every other: its exact parameters, and the code that computes it."""
    return hashlib.sha256((sweep.to_json() + fingerprint(*COMPUTES)).encode()).hexdigest()[:16]


def _default_cache() -> Path:
    return Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache') / 'dcdrw'

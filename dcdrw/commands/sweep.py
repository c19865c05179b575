"""`dcdrw sweep`: judge a rig over any two of its parameters, by default the paper's k̂ and b̂, into a netCDF file."""

import argparse
import math
from collections.abc import Iterator
from concurrent.futures import CancelledError, Executor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from dcdrw.console import Bar, add_json, check_json, cores, count, positive, tell
from dcdrw.files import add_force
from dcdrw.suite.parameter_file import add_rig_options, chosen_params
from dcdrw_msgs_py.in_step import BAND_PERCENT
from dcdrw_msgs_py.words import counted
from dcdrw_sim.map.regression import TRIAL_PHASES
from dcdrw_sim.study.sweep import Axis, Sweep, default_axis, default_seconds
from dcdrw_sim.study.sweep_dataset import open_sweep, require_extra
from dcdrw_sim.study.sweep_run import run_sweep
from dcdrw_sim.study.verdict import BAND, Verdict

CONNECT_SECONDS = 10.0
"""Limit for a Dask scheduler to answer."""

_EPILOG = """\
AXIS is NAME:LOW:HIGH:COUNT, evenly spaced, or NAME:LOW:HIGH:COUNT:log. NAME is any parameter of a rig (k, b, D0, S0,
slope, gravity, front.mass, rear.length ...), slope_deg, or mass, length or spokes of both wheels at once.

Ctrl-C or a crash loses a second of work: what is done lies in OUT.nc.parts, and the same command goes on from there.
Read the file with xarray: every variable tells its unit and meaning.

examples:
  dcdrw sweep --out paper.nc                               the paper's: 50 × 50 couplers, nine starts
  dcdrw sweep --out mine.nc --rig my_rig.yaml              the same couplers in the units of a rig
  dcdrw sweep --out slope.nc --x slope_deg:1.5:4:60 --y b:0.1:10:60:log
  dcdrw sweep --out paper.nc --scheduler tcp://head:8786   on a Dask cluster, to the same result
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Simulate, judge and measure a rig over any two of its parameters.'
    parser.epilog = _EPILOG
    parser.add_argument('--out', type=Path, required=True, metavar='OUT.nc', help='the netCDF file to make')
    add_rig_options(parser)
    parser.add_argument('--x', type=axis, metavar='AXIS', help="(default: k over the paper's range)")
    parser.add_argument('--y', type=axis, metavar='AXIS', help="(default: b over the paper's range)")
    parser.add_argument('--seconds', type=positive, help="how long to simulate (default: 200 √(ℓ/g), the paper's)")
    parser.add_argument(
        '--starts',
        type=count,
        default=len(TRIAL_PHASES),
        metavar='N',
        help='initial phases, evenly spaced between 0 and 100 %% (default: %(default)s)',
    )
    parser.add_argument(
        '--band',
        type=positive,
        default=BAND_PERCENT,
        metavar='PERCENT',
        help='in step is within ± this of 50 %% of a step at every instant (default: %(default)g)',
    )
    parser.add_argument(
        '--band-deg',
        type=positive,
        default=math.degrees(BAND),
        metavar='DEG',
        help="the paper's condition: |θ2| at the section is to be within this (default: %(default)g)",
    )
    parser.add_argument(
        '--no-trajectories',
        dest='trajectories',
        action='store_false',
        help='leave out the states at each section, which make up most of the file',
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument('--workers', type=count, metavar='N', help='cores to use (default: all)')
    where.add_argument('--scheduler', metavar='ADDRESS', help='run on the Dask cluster of this scheduler')
    add_json(parser)
    add_force(parser)
    parser.set_defaults(preset='paper-sweep')


def axis(text: str) -> Axis:
    """Parse an axis."""
    try:
        return Axis.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    require_extra('xarray', 'netCDF4', 'dask.array')
    check_json(options)
    sweep = chosen_sweep(options)
    with _executor(options) as (executor, at_once), Bar('judging', 'points') as bar:
        run_sweep(sweep, options.out, executor, at_once, lambda progress: bar.reach(*progress), options.force)
    verdicts = summary(options.out)
    told = ', '.join(f'{number} {name}' for name, number in verdicts.items() if number)
    tell(
        options,
        [f'{options.out}: {counted(sum(verdicts.values()), "point")}: {told}'],
        {'file': str(options.out), 'points': verdicts},
    )
    return 0


def chosen_sweep(options: argparse.Namespace) -> Sweep:
    """The sweep that the options describe."""
    rig = chosen_params(options).rig
    phases = tuple((j + 1) / (options.starts + 1) for j in range(options.starts))
    return Sweep(
        rig,
        options.x or default_axis('k', rig),
        options.y or default_axis('b', rig),
        options.seconds or default_seconds(rig),
        phases,
        options.band,
        math.radians(options.band_deg),
        options.trajectories,
    )


def summary(path: Path) -> dict[str, int]:
    """How many points got each verdict."""
    with open_sweep(path) as dataset:
        verdicts = dataset.verdict.values.ravel().tolist()
    return {verdict.name.lower(): verdicts.count(verdict) for verdict in Verdict}


@contextmanager
def _executor(options: argparse.Namespace) -> Iterator[tuple[Executor, int]]:
    """Who computes, and how many blocks at once keep all busy."""
    if options.scheduler:
        with _cluster(options.scheduler) as found:
            yield found
        return
    workers = options.workers or cores()
    executor = ThreadPoolExecutor(workers)
    try:
        yield executor, workers + 1
    finally:
        executor.shutdown(cancel_futures=True)


@contextmanager
def _cluster(address: str) -> Iterator[tuple[Executor, int]]:
    """The workers of a Dask cluster; blocks of one that dies are done by the others."""
    require_extra('distributed')
    from distributed import Client, KilledWorker
    from distributed.comm import CommClosedError

    try:
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise OSError(f'no Dask scheduler answers at {address}: {error}') from None
    with client:
        threads = sum(client.nthreads().values())
        if not threads:
            raise OSError(f'the Dask scheduler at {address} has no workers: start some with dask worker {address}')
        try:
            yield client.get_executor(pure=False), 2 * threads
        except (KilledWorker, CommClosedError, CancelledError) as error:
            raise OSError(
                f'the Dask cluster at {address} failed: {error}; the same command goes on from here'
            ) from None

"""The ensemble's speed beside that of SciPy, of the scalar simulation and of heyoka, at matched accuracy.

    python benchmarks/trajectories.py [--points 120] [--seconds 3]
    python benchmarks/trajectories.py --points 1000 --seconds 60 --against 47104d3

The workload is the paper's sweep, without dimensions: γ = 1.75°, S0 = 1, D0 = S0 + sin α, k̂ from 1e-4 to 1e-2 and b̂
from 0.1 to 10 in even steps of their logarithms, seven initial θ2, the front wheel just after a strike, each wheel with
the speed of its uncoupled limit cycle, 100 time units. Of it, `--points` trajectories are drawn, the same for all
programs; those in which a wheel rolls back are left out, because only this project's own programs know how to follow
them. The ensemble gets them ten times over, so that its lanes are as full as in a sweep of thousands. All run on one
core, which `taskset -c 1 python …` makes sure of.

Read the table from left to right: microseconds per trajectory; how many trajectories the program makes in the time of
one of SciPy's, measured in this same process; the 99th percentile and the maximum of the errors of all strike times,
against the scalar simulation at a tolerance of 1e-18; and in how many trajectories the number of strikes is wrong. The
tolerances are set so that the 99th percentile is just below 1e-9, or as near to it as the program's own choice of order
allows. `--seconds` is the time for which a quick program is repeated; its best repetition counts. A busy machine slows
all programs alike: compare ratios.

--against takes the ensemble of an earlier commit in the same run, a process each, in turns; 47104d3 is the last whose
model has no gyration, restitution, friction and rolling resistance. `extremes` watches the phase between strikes too,
as a verdict needs it; that commit has nothing of the kind.

SciPy and heyoka are given the same form of the equations; heyoka, where it is installed, as expressions of its own,
its strikes as terminal events, once one trajectory at a time and once in batches as wide as it recommends and twice so.
Goal: the ensemble at least 500 times as fast as SciPy, and faster than heyoka's batches.
"""

import argparse
import io
import math
import os
import subprocess
import sys
import tarfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from dcdrw_sim.model.dynamics import State
from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.wheel import limit_cycle_speed
from dcdrw_sim.motion import pair as simulation
from dcdrw_sim.motion import trajectory
from dcdrw_sim.motion.compiled import AVAILABLE
from dcdrw_sim.motion.ends import BACKWARD, End
from dcdrw_sim.motion.ensemble import run_ensemble

EXTREMES = 'extremes'  # as ensemble_speed.py knows it
SCIPY_TOLERANCE = 3e-13
TAYLOR_TOLERANCE = 1e-13  # of the simulation and of the ensemble
HEYOKA_TOLERANCE = 2e-11  # it chooses its order by this: from 3e-11 on the error is 1.7e-9
REFERENCE_TOLERANCE = 1e-18

SECONDS, CAPACITY = 100.0, 400
RIG = preset('paper-sweep').resolved()
ALPHA, STRIDE = RIG.front.alpha, RIG.front.step_length
RESTITUTION = math.cos(2.0 * ALPHA)

Floats = NDArray[np.float64]
Strikes = list[list[float]]
"""Strike times of each trajectory."""


class Points(NamedTuple):
    """N starts and their couplers."""

    states: Floats
    k: Floats
    b: Floats

    def take(self, which: Any) -> 'Points':
        """Some of the points."""
        return Points(self.states[which], self.k[which], self.b[which])

    def rows(self) -> Iterator[tuple[list[float], float, float]]:
        """Start, k and b of each point."""
        return zip(self.states.tolist(), self.k.tolist(), self.b.tolist(), strict=True)


def sweep(steps: int = 20) -> Points:
    """All points of the sweep."""
    k, b, theta2 = (
        axis.ravel()
        for axis in np.meshgrid(
            np.logspace(-4, -2, steps), np.logspace(-1, 1, steps), np.radians([-12, -8, -4, 0, 4, 8, 12]), indexing='ij'
        )
    )
    speed = limit_cycle_speed(RIG.front, RIG.slope, RIG.gravity)
    speeds = limit_cycle_speed(RIG.rear, RIG.slope, RIG.gravity, theta2)
    return Points(np.column_stack([np.full_like(k, -ALPHA), np.full_like(k, speed), theta2, speeds]), k, b)


def draw(points: Points, count: int) -> Points:
    """Some points whose wheels keep rolling forward, at random but always the same."""
    result = run_ensemble(RIG, points.states, SECONDS, CAPACITY, k=points.k, b=points.b)
    forward = (result.ends == End.TIME) & ~(result.strikes['direction'] == BACKWARD).any(axis=1)
    print(f"{forward.sum()} of the sweep's {len(forward)} trajectories roll forward all the time")
    return points.take(np.random.default_rng(1).permutation(np.flatnonzero(forward))[:count])


# Programs: each makes the strike times of all points.


def with_ensemble(points: Points) -> Strikes:
    result = run_ensemble(RIG, points.states, SECONDS, CAPACITY, TAYLOR_TOLERANCE, k=points.k, b=points.b)
    return [times[:count].tolist() for times, count in zip(result.strikes['t'], result.counts, strict=True)]


def with_simulation(points: Points) -> Strikes:
    simulation.PAIR_TOLERANCE = TAYLOR_TOLERANCE
    return simulated(points)


def simulated(points: Points) -> Strikes:
    runs = (trajectory.run(RIG._replace(k=k, b=b), State(*state), SECONDS) for state, k, b in points.rows())
    return [[strike.t for strike in run.strikes] for run in runs]


def reference(points: Points) -> Strikes:
    simulation.PAIR_TOLERANCE = REFERENCE_TOLERANCE
    return simulated(points)


def with_scipy(points: Points) -> Strikes:
    return [scipy_strikes(*row) for row in points.rows()]


def scipy_strikes(y: list[float], k: float, b: float) -> list[float]:
    sin, cos, sqrt, slope, D0 = math.sin, math.cos, math.sqrt, RIG.slope, RIG.D0

    def rates(t: float, y: Any, S: float) -> tuple[float, ...]:
        theta1, omega1, theta2, omega2 = y.tolist()
        sin1, cos1, sin2, cos2 = sin(theta1), cos(theta1), sin(theta2), cos(theta2)
        sin_difference = sin1 * cos2 - cos1 * sin2
        dx, dy = sin1 - sin2 + S, cos1 - cos2
        length = sqrt(dx * dx + dy * dy)
        p1, p2 = sin_difference + S * cos1, sin_difference + S * cos2
        pull = (k * (length - D0) + b * (p1 * omega1 - p2 * omega2) / length) / length
        return omega1, sin(theta1 + slope) - p1 * pull, omega2, sin(theta2 + slope) + p2 * pull

    def front(t: float, y: Any, S: float) -> float:
        return float(y[0]) - ALPHA

    def rear(t: float, y: Any, S: float) -> float:
        return float(y[2]) - ALPHA

    for event in (front, rear):
        event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
    t, S, times = 0.0, RIG.S0, []
    while t < SECONDS:
        solution = solve_ivp(
            rates,
            (t, SECONDS),
            y,
            'DOP853',
            events=(front, rear),
            args=(S,),
            rtol=SCIPY_TOLERANCE,
            atol=SCIPY_TOLERANCE,
        )
        t, y = solution.t[-1], solution.y[:, -1].copy()
        for i in (0, 1):
            if solution.t_events[i].size:
                times.append(float(t))
                y[2 * i], y[2 * i + 1] = -ALPHA, y[2 * i + 1] * RESTITUTION
                S += STRIDE if i == 0 else -STRIDE
    return times


class Heyoka:
    """heyoka's adaptive Taylor integrator: `width` trajectories at once, its batch class where that is above one.

    The runtime parameters are k, b and S; it is compiled when it is made.
    """

    def __init__(self, heyoka: Any, width: int) -> None:
        theta1, omega1, theta2, omega2 = heyoka.make_vars('theta1', 'omega1', 'theta2', 'omega2')
        k, b, S = (heyoka.par[i] for i in range(3))
        sin, cos = heyoka.sin, heyoka.cos
        length = heyoka.sqrt((sin(theta1) - sin(theta2) + S) ** 2.0 + (cos(theta1) - cos(theta2)) ** 2.0)
        p1, p2 = sin(theta1 - theta2) + S * cos(theta1), sin(theta1 - theta2) + S * cos(theta2)
        pull = (k * (length - RIG.D0) + b * (p1 * omega1 - p2 * omega2) / length) / length
        equations = [
            (theta1, omega1),
            (omega1, sin(theta1 + RIG.slope) - p1 * pull),
            (theta2, omega2),
            (omega2, sin(theta2 + RIG.slope) + p2 * pull),
        ]
        event, integrator = (
            (heyoka.t_event, heyoka.taylor_adaptive)
            if width == 1
            else (heyoka.t_event_batch, heyoka.taylor_adaptive_batch)
        )
        events = [
            event(theta - ALPHA, callback=self._strike(i, width), direction=heyoka.event_direction.positive)
            for i, theta in enumerate((theta1, theta2))
        ]
        shape = (4,) if width == 1 else (4, width)
        self._width, self._strikes = width, [[] for _ in range(width)]  # type: Any, Strikes
        self._integrator = integrator(
            equations, np.zeros(shape), tol=HEYOKA_TOLERANCE, t_events=events, pars=np.ones((3, *shape[1:]))
        )
        # Views of the integrator's own memory.
        self._state, self._pars, self._time = self._integrator.state, self._integrator.pars, self._integrator.time

    def _strike(self, i: int, width: int) -> Any:
        stride = (STRIDE, -STRIDE)[i]

        def alone(integrator: Any, sign: int) -> bool:
            self._strikes[0].append(integrator.time)
            self._state[2 * i] = -ALPHA
            self._state[2 * i + 1] *= RESTITUTION
            self._pars[2] += stride
            return True

        def in_batch(integrator: Any, sign: int, lane: int) -> bool:
            self._strikes[lane].append(self._time[lane])
            self._state[2 * i, lane] = -ALPHA
            self._state[2 * i + 1, lane] *= RESTITUTION
            self._pars[2, lane] += stride
            return True

        return alone if width == 1 else in_batch

    def __call__(self, points: Points) -> Strikes:
        """Strike times of all points; the last batch is filled up with the last point."""
        integrator, width, result = self._integrator, self._width, []  # type: Any, int, Strikes
        for first in range(0, len(points.k), width):
            which = np.minimum(np.arange(first, first + width), len(points.k) - 1)
            if width > 1:
                integrator.set_time(0.0)
            else:
                integrator.time = 0.0
            integrator.reset_cooldowns()
            self._state[:] = points.states[which].T.reshape(self._state.shape)
            for row, values in enumerate((points.k[which], points.b[which], np.full(width, RIG.S0))):
                self._pars[row] = values if width > 1 else values[0]
            self._strikes[:] = [[] for _ in range(width)]
            integrator.propagate_until(SECONDS)
            result += self._strikes[: len(points.k) - first]
        return result


# The table

Program = tuple[str, Callable[[Points], Strikes], int]
"""Name, function, and how many copies of the points it gets."""


def measure(program: Callable[[Points], Strikes], points: Points, seconds: float) -> tuple[float, Strikes]:
    """The best time per trajectory [µs], and the strikes."""
    best, total = math.inf, 0.0
    while total < seconds:
        start = time.perf_counter()
        strikes = program(points)
        taken = time.perf_counter() - start
        best, total = min(best, taken), total + taken
    return 1e6 * best / len(points.k), strikes


def accuracy(strikes: Strikes, truth: Strikes) -> tuple[Floats, int]:
    """Errors of the strike times, and in how many trajectories their number is wrong."""
    errors = [
        abs(a - b) for got, expected in zip(strikes, truth, strict=True) for a, b in zip(got, expected, strict=False)
    ]
    wrong = sum(len(got) != len(expected) for got, expected in zip(strikes, truth, strict=True))
    return np.array(errors), wrong


def programs() -> Iterator[Program]:
    """Every program, SciPy first, made when its turn comes."""
    yield f'SciPy DOP853, {SCIPY_TOLERANCE:g}', with_scipy, 1
    yield f'scalar simulation, {TAYLOR_TOLERANCE:g}', with_simulation, 1
    yield f'ensemble, {TAYLOR_TOLERANCE:g}', with_ensemble, 10
    try:
        import heyoka
    except ImportError:
        print('heyoka is not installed; to compare with it: pip install heyoka')
        return
    native = heyoka.recommended_simd_size()
    for width in (1, native, 2 * native):
        name = 'heyoka' if width == 1 else f'heyoka, batches of {width}'
        yield f'{name}, {HEYOKA_TOLERANCE:g}', Heyoka(heyoka, width), 1


def compare(points: Points, commit: str, seconds: float) -> None:
    """Time the ensemble of an earlier commit beside this one's, in turns; print the best of each, and the ratios."""
    here = Path(__file__).resolve().parents[1]
    with TemporaryDirectory() as name:
        folder = Path(name)
        np.savez(folder / 'points.npz', **points._asdict())
        packages = subprocess.run(
            ['git', '-C', str(here), 'archive', commit, 'dcdrw_sim', 'dcdrw_msgs_py'], check=True, capture_output=True
        ).stdout
        with tarfile.open(fileobj=io.BytesIO(packages)) as archive:
            archive.extractall(folder / 'earlier', filter='data')
        gyration = [f'{wheel}.gyration=0.5' for wheel in ('front', 'rear')]
        programs = {
            f'at {commit[:10]}': _timer(folder, folder / 'earlier'),
            'now': _timer(folder, here),
            'now, gyration': _timer(folder, here, *gyration),
            'now, extremes': _timer(folder, here, EXTREMES),
        }
        times: dict[str, list[list[float]]] = {name: [] for name in programs}
        for ask in programs.values():
            ask()  # compiles
        until = time.perf_counter() + seconds
        while time.perf_counter() < until:
            for name, ask in programs.items():
                times[name].append(ask())
    print(f'{"":24}{"µs":>10}{"µs/strike":>12}{"ratio, of a strike":>20}')
    best = {name: np.min(taken, axis=0) for name, taken in times.items()}
    earlier = next(iter(best.values()))
    for name, (each, strike) in best.items():
        print(f'{name:24}{each:10.2f}{strike:12.4f}{strike / earlier[1]:20.3f}')


def _timer(folder: Path, packages: Path, *columns: str) -> Callable[[], list[float]]:
    """A process that times the ensemble of some packages once for each call."""
    script = Path(__file__).with_name('children') / 'ensemble_speed.py'
    process = subprocess.Popen(
        [sys.executable, '-P', str(script), str(folder / 'points.npz'), *columns],
        env={**os.environ, 'PYTHONPATH': str(packages), 'NUMBA_CACHE_DIR': str(folder / f'numba{len(columns)}')},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )

    def ask() -> list[float]:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write('\n')
        process.stdin.flush()
        return [float(word) for word in process.stdout.readline().split()]

    return ask


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition('\n')[0])
    parser.add_argument('--points', type=int, default=120, help='trajectories that are drawn (default 120)')
    parser.add_argument('--seconds', type=float, default=3.0, help='time to repeat each quick program [s] (default 3)')
    parser.add_argument('--against', metavar='COMMIT', help='compare with the ensemble of an earlier commit instead')
    options = parser.parse_args()
    if not AVAILABLE:
        print('numba is not installed, the ensemble runs as plain Python; to compile it: pip install numba')
    points = draw(sweep(), options.points)
    if options.against:
        compare(points, options.against, options.seconds)
        return
    print(f'reference for {len(points.k)} of them …', file=sys.stderr)
    truth = reference(points)
    print(f'{"":34}{"µs":>10}{"× SciPy":>10}{"p99 error":>12}{"max error":>12}{"wrong":>8}')
    scipy_time = math.nan
    for name, program, copies in programs():
        program(points.take(slice(2)))  # compiles
        print(f'{name} …', end='\r', file=sys.stderr)
        taken, strikes = measure(program, points.take(np.tile(np.arange(len(truth)), copies)), options.seconds)
        scipy_time = taken if math.isnan(scipy_time) else scipy_time
        errors, wrong = accuracy(strikes[: len(truth)], truth)
        print(
            f'{name:34}{taken:10.1f}{scipy_time / taken:10.1f}{np.quantile(errors, 0.99):12.1e}{errors.max():12.1e}'
            f'{wrong:8}',
            flush=True,
        )


if __name__ == '__main__':
    main()

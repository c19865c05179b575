"""Choosing the coupler: search for the k and b that synchronize a rig fastest from the worst of its starts.

A coupler is judged as a trial is: by the steps to synchronization from each of several initial phases, and by the
swing of its limit cycle, which has to stay within the band at every instant. The worst start counts; what does not come
into step from every start is ranked by what becomes of it.
"""

import math
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.in_step import BAND_PERCENT
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.map.limit_cycles import losses
from dcdrw_sim.map.regression import TRIAL_PHASES
from dcdrw_sim.model.rigs import Rigs, take
from dcdrw_sim.model.start import require_rolling
from dcdrw_sim.model.wheel import gentlest_slope
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.study.loads import Loads, loads
from dcdrw_sim.study.points import run_starts, section_room, study, uncoupled
from dcdrw_sim.study.regimes import gentlest_slopes
from dcdrw_sim.study.verdict import Verdict

PART_TOLERANCE = 0.3
"""Fraction by which a bought part may differ from its data sheet."""
SLOPE_TOLERANCE = 0.1
"""Fraction by which the slope may be gentler than thought."""
BLOCK = 64
"""Rigs of a piece of work: a fraction of a second."""
GRID = 41
"""Couplers along each axis of the first search."""
ZOOM = 9
"""Couplers along each axis of a later search, around the best so far, two cells wide on either side."""
ZOOMS = 3
CASES = 18
"""What a coupler may turn out to be: k and b as they should be or off either way, the slope too or gentler."""
WORK = 2 * GRID**2 + ZOOMS * ZOOM**2 * (1 + CASES)
"""Couplers that a search scores."""
WIDEST = 8.0
"""Margins are looked for up to this factor."""
MARGIN_STEPS = 12
"""Factors tried each way in every round."""
PATIENCE = 4.0
"""So many times as long as a trial may last motions are followed to find margins."""
MARGIN_ROUNDS = 3
"""Rounds that narrow down an edge: each divides the gap that the last one left; an edge is known to about 0.1 %."""
VARIED = ('k', 'b', 'mass', 'slope')
"""What a rig may be other than it was thought to be."""


class Task(NamedTuple):
    """What couplers are judged by."""

    rig: RigParams
    """Its k and b do not matter."""
    seconds: float
    """How long a trial may last."""
    band_percent: float = BAND_PERCENT
    """In step is within ± this [% of a step]."""
    phases: tuple[float, ...] = TRIAL_PHASES
    """Starts, in steps."""


class Scores(NamedTuple):
    """How N couplers do, each array of shape (N,)."""

    k: Floats
    """[N/m]"""
    b: Floats
    """[N·s/m]"""
    verdict: NDArray[np.int8]
    """Verdict on the worst start."""
    in_step: Floats
    """Fraction of the starts that come into step for good."""
    steps: Floats
    """Steps from the worst start; NaN where not every start comes into step."""
    mean_steps: Floats
    """Mean steps of all starts; NaN where not every one comes into step."""
    time: Floats
    """Time from the worst start [s]; NaN where not every start comes into step."""

    def order(self) -> NDArray[np.int64]:
        """The couplers' indices from the best to the worst."""
        return np.lexsort((self.b, self.k, self.time, self.mean_steps, self.steps, -self.in_step, self.verdict))


class Margin(NamedTuple):
    """Factors by which a parameter may change, the others left, with every start still coming into step for good."""

    low: float
    high: float
    low_verdict: Verdict | None
    """What a smaller value leads to; None where it is harmless down to 1/WIDEST."""
    high_verdict: Verdict | None
    """What a greater value leads to; None where it is harmless up to WIDEST."""


class Variation(NamedTuple):
    """How a coupler does where one thing differs."""

    parameter: str
    factor: float
    verdict: Verdict
    """Verdict on the worst start."""
    steps: float
    """Steps from the worst start; NaN where not every start comes into step."""


class Assessment(NamedTuple):
    """All that is told of one coupler."""

    k: float
    b: float
    verdict: Verdict
    steps: tuple[float, ...]
    """To synchronization, from each start; NaN where it never comes into step."""
    strike_steps: tuple[float, ...]
    """The same by the strikes of the front wheel alone; NaN where it does not stay within the band at them."""
    time: float
    """Time from the worst start [s]."""
    paths: Floats
    """θ2 at the sections [rad] from each start, shape (starts, sections); NaN after the last."""
    swing: tuple[float, float]
    """Least and greatest error at any instant of the limit cycle [% of a step]; NaN where there is none."""
    multiplier: float
    """What a step leaves of a small error, on the limit cycle."""
    speed: float
    """Mean speed on the limit cycle [m/s]."""
    damper_loss: float
    """Energy that the damper takes on the limit cycle [J/m]."""
    loads: Loads
    stall_slope: float
    """As `stall_slopes` [rad]."""
    sensitivity: tuple[Variation, ...]
    margins: dict[str, Margin]

    @property
    def worst_steps(self) -> float:
        """Steps from the worst start; NaN where not every start comes into step."""
        return max(self.steps) if not any(map(math.isnan, self.steps)) else math.nan


class Search(NamedTuple):
    """The outcome of a search."""

    grid: Scores
    """The couplers of the first look, k running slowest."""
    fastest: tuple[float, float]
    """k and b of fewest steps from the worst start."""
    forgiving: tuple[float, float]
    """k and b of fewest steps from the worst start where k, b and slope may be off, as `worst_cases`."""


Report = Callable[[int], object]


def score(task: Task, k: Floats, b: Floats, slope: Floats | None = None, report: Report = lambda count: None) -> Scores:
    """Judge couplers, on all cores.

    Args:
        task: rig and starts.
        k: shape (N,) [N/m].
        b: shape (N,) [N·s/m].
        slope: shape (N,) [rad]; that of the rig by default.
        report: told how many more are done.

    Raises:
        ValueError: an impossible rig.

    """
    slopes = np.full(len(k), task.rig.slope) if slope is None else slope
    return Scores(k, b, *score_rigs(task, spread(task.rig, len(k), {'k': k, 'b': b, 'slope': slopes}), report))


def search(
    task: Task,
    k: tuple[float, float],
    b: tuple[float, float],
    tolerance: float = PART_TOLERANCE,
    report: Report = lambda count: None,
) -> Search:
    """Find the best couplers within bounds: on a logarithmic grid, then on ever finer ones around the best so far.

    Args:
        task: rig and starts.
        k: least and greatest stiffness [N/m].
        b: least and greatest damping [N·s/m].
        tolerance: fraction by which k and b may be off for the forgiving one, in [0, 1).
        report: told how many more couplers are done; `WORK` tells how many there are.

    Raises:
        ValueError: an impossible rig or bounds, or wheels that do not roll by themselves.

    """
    if not (0.0 < k[0] <= k[1] and 0.0 < b[0] <= b[1]):
        raise ValueError(f'bounds must be 0 < least ≤ greatest, got {k} N/m and {b} N·s/m')
    require_rolling(task.rig)
    grid = score(task, *mesh(k, b), report=report)
    eased = score(task, grid.k, grid.b, np.full(GRID**2, (1.0 - SLOPE_TOLERANCE) * task.rig.slope), report)

    def fastest(k: Floats, b: Floats) -> NDArray[np.int64]:
        return score(task, k, b, report=report).order()

    def forgiving(k: Floats, b: Floats) -> NDArray[np.int64]:
        return worst_cases(task, k, b, tolerance, report).order

    start, near = grid.order()[0], _blunt(grid, eased).order[0]
    return Search(
        grid, _zoom(fastest, (grid.k[start], grid.b[start]), k, b), _zoom(forgiving, (grid.k[near], grid.b[near]), k, b)
    )


def mesh(k: tuple[float, float], b: tuple[float, float]) -> tuple[Floats, Floats]:
    """The couplers of the first look within bounds: GRID × GRID, k running slowest."""
    return _mesh(np.geomspace(*k, GRID), np.geomspace(*b, GRID))


class WorstCases(NamedTuple):
    """How N couplers do, each as badly as it may turn out to do."""

    order: NDArray[np.int64]
    """The couplers' indices from the best to the worst."""
    steps: Floats
    """From the worst start, shape (N,); NaN where not every start comes into step."""


def worst_cases(task: Task, k: Floats, b: Floats, tolerance: float, report: Report = lambda count: None) -> WorstCases:
    """How couplers do in the worst case: k and b off by the tolerance, the slope gentler by SLOPE_TOLERANCE."""
    factors = (1.0 - tolerance, 1.0, 1.0 + tolerance)
    cases = [
        (k_factor, b_factor, slope)
        for k_factor in factors
        for b_factor in factors
        for slope in (task.rig.slope, (1.0 - SLOPE_TOLERANCE) * task.rig.slope)
    ]
    scores = score(
        task,
        np.concatenate([case[0] * k for case in cases]),
        np.concatenate([case[1] * b for case in cases]),
        np.repeat([case[2] for case in cases], len(k)),
        report,
    )
    return _worst_of(scores, np.arange(len(scores.k)).reshape(CASES, -1))


def bear(task: Task, k: Floats, b: Floats) -> list[Loads]:
    """What couplers bear from the start of a trial to its end, whatever the start.

    Args:
        task: rig and starts.
        k: shape (N,) [N/m].
        b: shape (N,) [N·s/m].

    Raises:
        ValueError: as `score`.

    """
    borne: list[Loads] = []
    for first in range(0, len(k), BLOCK):
        piece = slice(first, first + BLOCK)
        rigs = spread(task.rig, len(k[piece]), {'k': k[piece], 'b': b[piece]})
        room = section_room(rigs, task.seconds)
        cycles = study(rigs, task.seconds, task.phases, task.band_percent, room=room).cycles
        borne += loads(rigs, *run_starts(rigs, task.seconds, task.phases, room), cycles)
    return borne


def stall_slopes(task: Task, k: Floats, b: Floats) -> Floats:
    """The slopes [rad] at and below which couplers stall.

    With equal wheels there is no limit cycle there. With unequal ones some start of the task does not walk on for as
    long as margins are looked for, which takes some time for each. NaN where it is gentler than 1/WIDEST of the rig's.

    Args:
        task: rig and starts.
        k: shape (N,) [N/m].
        b: shape (N,) [N·s/m].

    """
    if task.rig.front == task.rig.rear:
        return gentlest_slopes(spread(task.rig, len(k), {'k': k, 'b': b})).values
    patient = task._replace(seconds=PATIENCE * task.seconds)
    rigs = (task.rig._replace(k=float(one), b=float(other)) for one, other in zip(k, b, strict=True))
    edges = (_edge(patient, rig, 'slope', 1.0 / WIDEST, Verdict.ELSEWHERE) for rig in rigs)
    return np.array([math.nan if verdict is None else factor * task.rig.slope for factor, verdict in edges])


def assess(task: Task, k: float, b: float, tolerance: float = PART_TOLERANCE) -> Assessment:
    """Tell all of one coupler.

    Raises:
        ValueError: an impossible coupler or rig, or one whose wheels do not roll by themselves.

    """
    rig = task.rig._replace(k=k, b=b)
    alone = spread(rig, 1, {})
    found = study(alone, task.seconds, task.phases, task.band_percent)
    walking = losses(alone, found.cycles)
    return Assessment(
        k,
        b,
        Verdict(int(found.verdicts.max())),
        tuple(found.steps[0].tolist()),
        tuple(found.motions.strike_steps.tolist()),
        float(found.times.max()),
        found.sections.theta2,
        (float(found.cycles.swings[0, 0]), float(found.cycles.swings[0, 1])),
        float(abs(found.cycles.multipliers[0, 0])),
        float(walking.speed[0]),
        float(walking.damper[0]),
        bear(task, np.array([k]), np.array([b]))[0],
        float(stall_slopes(task, np.array([k]), np.array([b]))[0]),
        tuple(_sensitivity(task, rig, tolerance)),
        {name: _margin(task, rig, name) for name in VARIED},
    )


def _sensitivity(task: Task, rig: RigParams, tolerance: float) -> Iterator[Variation]:
    for name in VARIED:
        for factor in (1.0 - tolerance, 1.0 + tolerance):
            verdict, _, steps, *_ = score_rigs(task, _multiplied(rig, name, np.array([factor])))
            yield Variation(name, factor, Verdict(int(verdict[0])), float(steps[0]))


def _margin(task: Task, rig: RigParams, name: str) -> Margin:
    """Both edges, by the factors next to the coupler that spoil it; each look narrows the last one's gap.

    Near an edge all is slow: what is left of a limit cycle holds a pair up beyond it. So motions are followed for
    longer than trials last, and the limit cycle has the last word.
    """
    task = task._replace(seconds=PATIENCE * task.seconds)
    (low, below), (high, above) = (_edge(task, rig, name, limit) for limit in (1.0 / WIDEST, WIDEST))
    return Margin(low, high, below, above)


def _edge(
    task: Task, rig: RigParams, name: str, limit: float, still_good: Verdict = Verdict.IN_STEP
) -> tuple[float, Verdict | None]:
    """The last factor on the way to a limit that leads to nothing worse, and what follows; None where nothing does."""
    good, spoilt, verdict = 1.0, limit, None
    if name == 'slope':  # steeper than α no wheel stands on a spoke
        spoilt = min(limit, min(rig.front.alpha, rig.rear.alpha) / rig.slope * (1 - 1e-9))
    for _ in range(MARGIN_ROUNDS):
        factors = np.geomspace(good, spoilt, MARGIN_STEPS + 1)
        verdicts = score_rigs(task, _multiplied(rig, name, factors))[0]
        bad = np.flatnonzero(verdicts > still_good)
        if not bad.size:
            return spoilt, verdict
        first = int(bad[0])
        verdict = Verdict(int(verdicts[first]))
        if first == 0:
            return good, verdict
        good, spoilt = float(factors[first - 1]), float(factors[first])
    return good, verdict


def _multiplied(rig: RigParams, name: str, factors: Floats) -> Rigs:
    """Rigs with one of VARIED times each factor; the mass is that of both wheels."""
    if name == 'mass':
        return spread(rig, len(factors), {'front.mass': factors * rig.front.mass, 'rear.mass': factors * rig.rear.mass})
    return spread(rig, len(factors), {name: factors * getattr(rig, name)})


def score_rigs(task: Task, rigs: Rigs, report: Report = lambda count: None) -> tuple[NDArray[Any], ...]:
    """The columns of `Scores` behind k and b."""
    count = len(rigs.k)
    gentlest = [
        max(gentlest_slope(wheel, rig.rolling_resistance) for wheel in (rig.front, rig.rear)) for rig in uncoupled(rigs)
    ]
    rolling = np.flatnonzero(rigs.slope > gentlest)
    verdict, in_step = np.full(count, Verdict.STALLS, np.int8), np.zeros(count)  # what becomes of those that do not
    columns: tuple[NDArray[Any], ...] = (verdict, in_step, *(np.full(count, math.nan) for _ in range(3)))
    if rolling.size:
        room = section_room(take(rigs, rolling), task.seconds)
        pieces = np.array_split(rolling, math.ceil(rolling.size / BLOCK))
        executor = ThreadPoolExecutor(len(os.sched_getaffinity(0)))  # the kernels let go of Python's lock
        try:
            scored = executor.map(lambda piece: _score_piece(task, take(rigs, piece), room), pieces)
            for piece, results in zip(pieces, scored, strict=True):
                for column, result in zip(columns, results, strict=True):
                    column[piece] = result
                report(len(piece))
        finally:
            executor.shutdown(cancel_futures=True)
    report(count - rolling.size)
    return columns


def _score_piece(task: Task, rigs: Rigs, room: int) -> tuple[NDArray[Any], ...]:
    found = study(rigs, task.seconds, task.phases, task.band_percent, room=room)
    verdicts, steps = found.verdicts, found.steps
    return (
        verdicts.max(axis=1),
        (verdicts == Verdict.IN_STEP).mean(axis=1),
        steps.max(axis=1),
        steps.mean(axis=1),
        found.times.max(axis=1),
    )


def _zoom(
    order: Callable[[Floats, Floats], NDArray[np.int64]],
    best: tuple[float, float],
    k: tuple[float, float],
    b: tuple[float, float],
) -> tuple[float, float]:
    """The best coupler, on ever finer grids around the best so far."""
    reaches = [2.0 * math.log(high / low) / (GRID - 1) for low, high in (k, b)]
    for _ in range(ZOOMS):
        axes = [
            np.clip(value * np.exp(np.linspace(-reach, reach, ZOOM)), *bounds)
            for value, reach, bounds in zip(best, reaches, (k, b), strict=True)
        ]
        ks, bs = _mesh(*axes)
        first = order(ks, bs)[0]
        best = float(ks[first]), float(bs[first])
        reaches = [reach / (ZOOM // 2) * 1.5 for reach in reaches]
    return best


def _blunt(*grids: Scores) -> WorstCases:
    """The grid's couplers, each as good as the worst of its neighbours on all the grids."""
    both = Scores(*map(np.concatenate, zip(*grids, strict=True)))
    places = np.arange(len(both.k)).reshape(len(grids), GRID, GRID)
    padded = np.pad(places, ((0, 0), (1, 1), (1, 1)), mode='edge')
    return _worst_of(
        both,
        np.concatenate(
            [padded[:, i : i + GRID, j : j + GRID].reshape(len(grids), -1) for i in range(3) for j in range(3)]
        ),
    )


def _worst_of(scores: Scores, members: NDArray[np.int64]) -> WorstCases:
    """How groups do by their worst member; members of shape (of a group, groups)."""
    rank = np.empty(len(scores.k), np.int64)
    order = scores.order()
    rank[order] = np.arange(len(order))
    worst = rank[members].max(axis=0)
    return WorstCases(np.argsort(worst, kind='stable'), scores.steps[order[worst]])


def _mesh(k: Floats, b: Floats) -> tuple[Floats, Floats]:
    ks, bs = np.meshgrid(k, b, indexing='ij')
    return ks.ravel(), bs.ravel()

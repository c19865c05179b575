"""Springs and dashpots on sale, and which pairs of them bring a rig into step without being asked for too much."""

import math
from collections.abc import Iterable
from itertools import product
from typing import NamedTuple

import numpy as np

from dcdrw_sim.study.design import Report, Task, bear, score, stall_slopes, worst_cases
from dcdrw_sim.study.loads import UNKNOWN, Loads, Order, order
from dcdrw_sim.study.verdict import Verdict

SPRING, DASHPOT = 'spring', 'dashpot'
LOOKED_AT = 12
"""Of unequal wheels the slopes are sought on which so many pairs stall, the best."""


class Part(NamedTuple):
    """A spring or a dashpot on sale."""

    kind: str
    """SPRING or DASHPOT."""
    value: float
    """Stiffness [N/m] or damping [N·s/m]."""
    name: str = ''
    max_force: float = math.inf
    """That it is rated for [N]."""
    max_stroke: float = math.inf
    """That it is rated for [m]: a spring's change of length from its free length, a dashpot's travel."""
    max_speed: float = math.inf
    """That it is rated for [m/s]."""
    free_length: float = math.nan
    """A spring's, without force and without rods [m]; NaN where it is not told."""

    def exceeded(self, force: float, stroke: float, speed: float) -> list[str]:
        """The rated limits that these loads exceed, by their names."""
        asked = {'max_force': force, 'max_stroke': stroke, 'max_speed': speed}
        return [f'{self.kind} {limit}' for limit, value in asked.items() if value > getattr(self, limit)]


class Pair(NamedTuple):
    """A spring with a dashpot, and how they do."""

    spring: Part
    dashpot: Part
    verdict: Verdict
    """Of the worst start."""
    steps: float
    """To synchronization from the worst start; NaN where not every start comes into step."""
    time: float
    """The same as time [s]."""
    steps_if_off: float
    """The same where k and b are off and the slope is gentler, in the worst case; NaN where it does not come then."""
    rank_if_off: int
    """By what it may turn out to be, from 0 on."""
    loads: Loads
    """NaN where it does not come into step."""
    exceeded: tuple[str, ...]
    """Rated limits that do not allow it."""
    order: Order
    """Of the spring."""
    stall_slope: float = math.nan
    """As `dcdrw_sim.study.design.stall_slopes` [rad]; NaN also where it was not sought."""
    stall_slope_sought: bool = False
    """Not that of pairs that do not work, nor, with unequal wheels, beyond the best LOOKED_AT."""

    @property
    def works(self) -> bool:
        """Whether it comes into step from every start, and all rated limits allow it."""
        return self.verdict is Verdict.IN_STEP and not self.exceeded


def rank(task: Task, parts: Iterable[Part], tolerance: float, report: Report = lambda count: None) -> list[Pair]:
    """Every pair of a spring and a dashpot, those that work first, the fastest of them before all.

    Args:
        task: rig and starts.
        parts: on sale.
        tolerance: by which part k and b may be off, in [0, 1).
        report: told how many more couplers are scored; `CASES` + 1 of a pair.

    Raises:
        ValueError: as `dcdrw_sim.study.design.score`.

    """
    parts = list(parts)
    kinds = ([part for part in parts if part.kind == kind] for kind in (SPRING, DASHPOT))
    couples = list(product(*kinds))
    k, b = (np.array([couple[i].value for couple in couples]) for i in range(2))
    scores = score(task, k, b, report=report)
    off = worst_cases(task, k, b, tolerance, report)
    ranks = np.argsort(off.order)
    works = np.flatnonzero(scores.verdict == Verdict.IN_STEP)
    borne = dict(zip(works.tolist(), bear(task, k[works], b[works]), strict=True))
    pairs = []
    for index in scores.order().tolist():
        spring, dashpot = couples[index]
        loads = borne.get(index, UNKNOWN)
        exceeded = [
            *spring.exceeded(loads.spring_force, loads.spring_force / spring.value, loads.speed),
            *dashpot.exceeded(loads.damper_force, loads.stroke, loads.speed),
        ]
        verdict = Verdict(int(scores.verdict[index]))
        steps, time, if_off = (float(column[index]) for column in (scores.steps, scores.time, off.steps))
        ordered = order(task.rig, spring.value, loads, spring.free_length)
        if ordered.rods < 0.0:
            exceeded.append('spring free_length')
        rank_if_off = int(ranks[index])
        pairs.append(Pair(spring, dashpot, verdict, steps, time, if_off, rank_if_off, loads, tuple(exceeded), ordered))
    pairs.sort(key=lambda pair: not pair.works)
    equal = task.rig.front == task.rig.rear
    seen = [pair for pair in pairs if pair.works][: None if equal else LOOKED_AT]
    values = np.array([(pair.spring.value, pair.dashpot.value) for pair in seen]).reshape(-1, 2)
    slopes = stall_slopes(task, *values.T) if seen else np.empty(0)
    sought = zip(seen, slopes.tolist(), strict=True)
    looked_at = [pair._replace(stall_slope=slope, stall_slope_sought=True) for pair, slope in sought]
    return looked_at + pairs[len(seen) :]

"""Couplers judged on a rig that is known with errors: on rigs drawn from what is known of it."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from dcdrw_msgs_py.values import Floats
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.study.design import Report, Task, score_rigs
from dcdrw_sim.study.verdict import Verdict

DRAWN, FINAL = 12, 64
"""Rigs that each candidate is judged on, and those that the chosen ones are."""
CANDIDATES = 30
"""The best couplers for the rig as it is thought to be are judged on the others."""


class Outlook(NamedTuple):
    """What becomes of a coupler on the rigs that are as likely as what is known of one."""

    rigs: int
    in_step: float
    """Part of the rigs that come into step for good from every start."""
    median_steps: float
    """Steps from the worst start that half of all rigs need at most; NaN where fewer come into step."""
    late_steps: float
    """Steps that nine of ten rigs need at most; NaN where fewer come into step."""


def surest(
    task: Task, k: Floats, b: Floats, drawn: Mapping[str, Floats], report: Report = lambda count: None
) -> tuple[float, float]:
    """The coupler, among N, that is best on the worst of the drawn rigs.

    Most important is on how many it comes into step from every start, then how many steps the worst takes.
    """
    shape = len(k), len(next(iter(drawn.values())))
    verdicts, steps = _judged(task, np.repeat(k, shape[1]), np.repeat(b, shape[1]), _tiled(drawn, len(k)), report)
    lost = (verdicts > Verdict.IN_STEP).reshape(shape).sum(axis=1)
    worst = np.nan_to_num(steps, nan=math.inf).reshape(shape).max(axis=1)
    mean = np.nan_to_num(steps, nan=task.seconds).reshape(shape).mean(axis=1)
    best = int(np.lexsort((mean, worst, lost))[0])
    return float(k[best]), float(b[best])


def outlook(task: Task, k: float, b: float, drawn: Mapping[str, Floats]) -> Outlook:
    """What becomes of one coupler on drawn rigs."""
    count = len(next(iter(drawn.values())))
    verdicts, steps = _judged(task, np.full(count, k), np.full(count, b), drawn, lambda done: None)
    inside = verdicts <= Verdict.IN_STEP
    needed = np.sort(np.where(inside, steps, math.inf))
    median, late = (float(needed[math.ceil(part * count) - 1]) for part in (0.5, 0.9))
    return Outlook(count, float(inside.mean()), *(steps if steps < math.inf else math.nan for steps in (median, late)))


def _judged(task: Task, k: Floats, b: Floats, drawn: Mapping[str, Floats], report: Report) -> tuple[Floats, Floats]:
    verdicts, _, steps, *_ = score_rigs(task, spread(task.rig, len(k), {**drawn, 'k': k, 'b': b}), report)
    return verdicts, steps


def _tiled(drawn: Mapping[str, Floats], times: int) -> dict[str, Floats]:
    return {name: np.tile(column, times) for name, column in drawn.items()}

"""An earlier trial for the page to draw beneath the one that it shows."""

import math
from typing import Any

from dcdrw.page.live_state import POINT_NS
from dcdrw.trials.analysis import Analysis
from dcdrw_msgs_py.samples import SECOND


def overlay(trial: Analysis, name: str) -> dict[str, Any]:
    """The phase difference [°] against the time since the wheels were let go [s], and the wheels that it is of.

    Raises:
        ValueError: the trial was not run.

    """
    if not trial.ran:
        raise ValueError(f'{name} cannot be laid beneath the live trial: {trial.why_not_run}')
    points: list[list[float]] = []
    due = -math.inf
    for seconds, phi in zip(trial.judged.seconds.tolist(), trial.judged.phi.tolist(), strict=True):
        if seconds >= due:
            points.append([round(seconds, 3), round(math.degrees(phi), 2)])
            due = seconds + POINT_NS / SECOND
    phase = trial.params.phase
    return {
        'name': name,
        'wheels': [[wheel.length, wheel.spokes] for wheel in (phase.front, phase.rear)],
        'phis': points,
    }

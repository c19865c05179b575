"""Time one repetition of an ensemble for each line on standard input: what `trajectories.py --against` measures by.

It runs with the packages that PYTHONPATH names, also with older ones.
"""

import sys
import time

import numpy as np

from dcdrw_sim.model.presets import preset
from dcdrw_sim.motion.ensemble import run_ensemble

EXTREMES = 'extremes'

SECONDS, CAPACITY, TOLERANCE = 100.0, 400, 1e-13


def main(points: str, *columns: str) -> None:
    """Measure.

    Args:
        points: file of starts and couplers.
        columns: parameters of all pairs, as `front.gyration=0.5`; EXTREMES watches the phase between strikes too.

    """
    saved, rig = np.load(points), preset('paper-sweep').resolved()
    given = {
        name: float(value) for name, _, value in (column.partition('=') for column in columns if column != EXTREMES)
    }
    more = {'extremes': True} if EXTREMES in columns else {}  # which earlier packages do not know
    for _ in sys.stdin:
        start = time.perf_counter()
        result = run_ensemble(
            rig, saved['states'], SECONDS, CAPACITY, TOLERANCE, k=saved['k'], b=saved['b'], **given, **more
        )
        taken = time.perf_counter() - start
        print(1e6 * taken / len(saved['k']), 1e6 * taken / result.counts.sum(), flush=True)


if __name__ == '__main__':
    main(*sys.argv[1:])

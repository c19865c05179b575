"""A person in front, the robot behind: how well the law `rear` keeps in step, beside passive couplers.

    python benchmarks/person.py [--seconds 60] [--spread 10] [--seed 0]

The front wheel walks as a person whose every step's time lies evenly within ±10 % of the mean, the rear hub is driven
by the synchronizer (500 Hz, at most 20 N·m), with and without 50 ms from its command to the torque. From 21.6 %, the
paper's wheels on 2°. Rows: error p − 50 % of a step, rms after the third step; share of that time within ±6 %; the
steps until it stays there; the largest force on the person, and its rms.

Goals: rms 3 %, always in the band after 3 steps, 10 N; with 50 ms 4 %, 95 % of the time, 20 N.
"""

import argparse
import random
import sys
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dcdrw.suite.hub_gains import hub_gains
from dcdrw_control.sync.synchronizer import Synchronizer, SynchronizerParams
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.rig.person import PersonParams, Walk, natural_cadence
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams

PERIOD = 0.002
"""Time from sample to sample, and from command to command [s]."""
BAND = 6.0
"""[% of a step]"""
SETTLED = 3
"""Steps of the person after which the pair is judged."""


class Row(NamedTuple):
    """What one walk came to."""

    rms: float
    """Root mean square of 100 (p − 0.5) after the third step [% of a step]."""
    in_band: float
    """Share of the time after the third step within the band [%]."""
    steps: int
    """The person's steps until the error stays in the band; more than the walk has where it does not."""
    peak: float
    """Force on the person [N]."""
    force: float
    """Its rms [N]."""


def even_steps(mean: float, spread: float, seed: int) -> Iterator[float]:
    """Durations of steps, evenly distributed within ±spread of their mean [s]."""
    chance = random.Random(seed)
    while True:
        yield mean * (1.0 + spread * chance.uniform(-1.0, 1.0))


def walk(rig: RigParams, law: str, delay: float, seconds: float, spread: float, seed: int) -> Row:
    """Let a person and a robot walk, and judge them.

    Args:
        rig: the rig.
        law: `rear` or `off`.
        delay: from the synchronizer's command to the torque [s].
        seconds: how long.
        spread: of the person's steps, relative.
        seed: of the person's steps.

    """
    simulated = SimulatedRig(rig, SimulatorParams(person=PersonParams(walks=True), seed=seed))
    assert simulated.person
    simulated.person.walk = Walk(even_steps(1.0 / natural_cadence(rig), spread, seed))
    estimator = PhaseEstimator(PhaseParams())
    core = Synchronizer(SynchronizerParams(law=law, hub=hub_gains(rig, delay)))
    under_way = deque([0.0] * round(delay / PERIOD))
    rows = []
    for tick in range(round(seconds / PERIOD)):
        t = tick * PERIOD
        joints = simulated.read(t, round(t * 1e9) + 1)
        assert joints
        update = estimator.update(joints)
        assert update
        core.update(update.phase, t)
        core.enable(t, True)
        under_way.append(core.command(t).torque)
        simulated.rear_torque = under_way.popleft()
        turned = joints.front.angle / rig.front.alpha / 2.0, joints.rear.angle / rig.rear.alpha / 2.0
        rows.append((turned[0] + 0.5, 100.0 * ((turned[0] - turned[1]) % 1.0 - 0.5), joints.coupler.force))
    steps, error, force = np.array(rows).T
    late = error[steps >= SETTLED]
    outside = steps[np.abs(error) > BAND]
    return Row(
        float(np.sqrt(np.mean(late**2))),
        100.0 * float(np.mean(np.abs(late) <= BAND)),
        int(outside.max()) + 1 if len(outside) else 0,
        float(np.abs(force).max()),
        float(np.sqrt(np.mean(force**2))),
    )


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else '')
    parser.add_argument('--seconds', type=float, default=60.0, help='length of each walk')
    parser.add_argument('--spread', type=float, default=10.0, help="of the person's step times, ± percent")
    parser.add_argument('--seed', type=int, default=0, help='of the step times')
    options = parser.parse_args()
    print(f'{"":34} {"rms %":>6} {"in band %":>9} {"steps":>6} {"peak N":>7} {"rms N":>6}')
    for name, k, b, law, delay in (
        ('passive, 5.25 N/m, 100 N·s/m', 5.25, 100.0, 'off', 0.0),
        ('passive, 16 N/m, 10 N·s/m', 16.0, 10.0, 'off', 0.0),
        ('rear, 16 N/m, 10 N·s/m', 16.0, 10.0, 'rear', 0.0),
        ('rear, 16 N/m, 10 N·s/m, 50 ms', 16.0, 10.0, 'rear', 0.05),
    ):
        rig = RigParams(k=k, b=b)
        row = walk(rig, law, delay, options.seconds, options.spread / 100.0, options.seed)
        print(
            f'{name:34} {row.rms:6.2f} {row.in_band:9.1f} {row.steps:6d} {row.peak:7.1f} {row.force:6.2f}', flush=True
        )
    return 0


if __name__ == '__main__':
    sys.exit(main())

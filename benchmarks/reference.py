"""How near the robot's planned footfalls are to a quarter stride ahead of people's, and whether their order is right.

    PYTHONPATH=. python benchmarks/reference.py [--seconds 120]

Simulated people walk as the front wheel of the simulator does (1 kHz, through the phase estimator), with the named
variability of a stride, or every step evenly within ±10 % of the mean; one stops now and then, at any place of a
stride, stands and starts again, told by leg phases alone, and is judged by the node's own count. The recorded people
are those in tests/data/gait, their legs by the leg tracker; a foot on the force plate stands for both legs, half a
stride apart. A trajectory takes `lead` (50 ms) to the joints. The phase that it carries is held against a quarter of
each true stride: motion capture's and the plate's where people were recorded.

Columns: the robot's footfalls in the whole gait; their distance from a quarter stride ahead, rms [ms] (goal: 25 ms);
steps of the four feet in the order 1-4-2-3 (goal: 99 %); how often the node would have said WARN or ERROR of the order;
processor time per sample [µs]. `!` marks a goal missed.
"""

import argparse
import random
import sys
import time
from collections.abc import Iterable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from legs import at_50_newtons, person, plate, truth
from numpy.typing import NDArray

from dcdrw_control.legs.samples import LEGS, LegReading, WrenchReading
from dcdrw_control.legs.walk import Walk, follow
from dcdrw_control.reference.joint_table import DEFAULT, read_joint_table
from dcdrw_control.reference.order import FRONT_FEET, REAR_FEET, Fall, FootfallOrder
from dcdrw_control.reference.params import ReferenceParams
from dcdrw_control.reference.person import GaitSample, WheelGait
from dcdrw_control.reference.plan import Trajectory
from dcdrw_control.reference.reference import LegReference, State
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.rig import person as simulated
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams

LATE_GOAL, ORDER_GOAL = 0.025, 0.99
"""Root mean square [s]; share of the steps."""
Floats = NDArray[np.float64]


class Score(NamedTuple):
    """What came of a walk."""

    falls: int
    """Of the robot, in the whole gait."""
    rms: float
    """From a quarter stride ahead [s]."""
    right: float
    """Share of the steps of all four feet that came in order."""
    alarms: int
    """How often the node's own judgement of the order went bad."""
    trajectories: list[Trajectory]
    seconds: float
    """Processor time per sample [s]."""


def judge(samples: Iterable[GaitSample], strikes: tuple[Floats, Floats] | None) -> Score:
    """Let the robot follow, always enabled.

    Args:
        samples: of the person.
        strikes: true heel strikes [s], against which the robot's are held; None: the node's own judgement.

    """
    core = LegReference(ReferenceParams(), read_joint_table(DEFAULT))
    trajectories, count, spent, start_ns, alarms, bad = [], 0, 0.0, None, 0, False
    falls = [Fall(foot, round(t * 1e9)) for foot, times in zip(FRONT_FEET, strikes or (), strict=False) for t in times]
    for sample in samples:
        begin = time.process_time()
        core.enable(0.0, True)
        update = core.update(sample, 0.0, sample.stamp_ns)
        spent, count = spent + time.process_time() - begin, count + 1
        assert update
        status = core.status()
        if status.state is State.WALKING and start_ns is None:
            start_ns = sample.stamp_ns
        was_bad, bad = bad, False in status.order.lately
        alarms += bad and not was_bad
        falls += update.falls
        if update.trajectory:
            trajectories.append(update.trajectory)
    if not strikes:
        own = core.status().order
        return Score(own.falls, own.lead_error, 1.0 - own.wrong / own.falls, alarms, trajectories, spent / count)
    order = FootfallOrder()
    assert start_ns is not None
    end_ns = 1e9 * min(times[-1] for times in strikes)  # the truth ends before the walk does
    judged = [fall for fall in sorted(falls, key=lambda one: one.stamp_ns) if start_ns < fall.stamp_ns <= end_ns]
    errors = [error for fall in judged if (error := order.see(fall)) is not None]
    return Score(
        sum(fall.foot in REAR_FEET for fall in judged),
        float(np.sqrt(np.mean(np.square(errors)))),
        1.0 - order.wrong / order.falls,
        alarms,
        trajectories,
        spent / count,
    )


def samples_of(walk: Walk) -> Iterator[GaitSample]:
    """Both legs of a walk, where both are known."""
    for update in walk.updates:
        legs = [update.legs.get(leg) for leg in LEGS[:2]]
        if all(legs):
            left, right = (turn.angle / (2.0 * np.pi) for turn in legs if turn)
            yield GaitSample(update.stamp_ns, (left, right))


def walking_20_m() -> Score:
    """The person with IMUs on both feet, the turn included."""
    return judge(samples_of(follow(person())), (truth('left'), truth('right')))


def on_the_treadmill() -> Score:
    """The foot on the force plate, and the same foot half a mean stride later as the other one."""
    seconds, force = plate()
    strikes = at_50_newtons(seconds, force)
    half = 0.5 * float(np.diff(strikes).mean())
    rows = [
        (t + later, leg, f)
        for later, leg in ((0.0, LEGS[0]), (half, LEGS[1]))
        for t, f in zip(seconds, force, strict=True)
    ]
    readings = [LegReading(round(t * 1e9), leg, WrenchReading(f)) for t, leg, f in sorted(rows)]
    return judge(samples_of(follow(readings)), (strikes, strikes + half))


def stopping(seconds: float, seed: int = 0) -> Score:
    """A person who stops within half a stride after five to ten strides, stands for two to four seconds and starts."""
    chance, tick = random.Random(seed), 0.005
    stride, pace, speed, until, walks = 0.0, 0.9, 0.0, 0.0, False
    samples = []
    for i in range(round(seconds / tick)):
        if walks and stride >= until:
            walks, until = False, i * tick + chance.uniform(2.0, 4.0)
        elif not walks and speed == 0.0 and i * tick >= until:
            walks, until, pace = True, stride + chance.uniform(5.0, 10.0), chance.uniform(0.7, 1.0)
        rate = pace * tick / 0.4  # within 0.4 s to the pace, and to a stand
        speed = min(speed + rate, pace) if walks else max(speed - rate, 0.0)
        stride += speed * tick
        samples.append(GaitSample(round((i + 1) * tick * 1e9), (stride, stride - 0.5)))
    return judge(samples, None)


def even_steps(seed: int) -> Iterator[float]:
    """Durations of steps, evenly within ±10 % of the mean [s]."""
    chance, mean = random.Random(seed), 1.0 / simulated.natural_cadence(RigParams())
    while True:
        yield mean * (1.0 + 0.1 * chance.uniform(-1.0, 1.0))


def simulated_person(seconds: float, steps: Iterator[float] | None, **person_params: float) -> Score:
    """A person in the place of the front wheel, followed through the phase estimator."""
    params = SimulatorParams(person=simulated.PersonParams(walks=True, **person_params))
    rig = SimulatedRig(RigParams(), params)
    assert rig.person
    if steps:
        rig.person.walk = simulated.Walk(steps)
    estimator, wheels = PhaseEstimator(PhaseParams()), WheelGait(PhaseParams().front.alpha, PhaseParams().rear.alpha)
    strikes: list[list[float]] = [[], []]

    def samples() -> Iterator[GaitSample]:
        for tick in range(1, round(seconds * 1000.0)):
            joints = rig.read(tick / 1000.0, tick * 1_000_000)
            update = estimator.update(joints) if joints else None
            assert update
            for fall in update.footfalls:
                if fall.wheel == 'front':
                    strikes[fall.steps % 2].append(fall.stamp_ns / 1e9)
            yield wheels.read(update.phase)._replace(robot=None)

    made = list(samples())
    return judge(made, (np.array(strikes[0]), np.array(strikes[1])))


def cases(seconds: float) -> dict[str, partial[Score]]:
    """Every row of the table."""
    return {
        'simulated, 2.7 % per stride': partial(simulated_person, seconds, None),
        'simulated, 1.7 % per stride': partial(simulated_person, seconds, None, variability_percent=1.7),
        'simulated, 2.7 %, faster by 20 % a minute': partial(simulated_person, seconds, None, drift_percent=20.0),
        'simulated, 2.7 %, slower by 20 % a minute': partial(simulated_person, seconds, None, drift_percent=-20.0),
        'simulated, 4 % per stride': partial(simulated_person, seconds, None, variability_percent=4.0),
        'simulated, 2.7 %, 1.3 steps/s': partial(simulated_person, seconds, None, cadence=1.3),
        'simulated, 2.7 %, 2.0 steps/s': partial(simulated_person, seconds, None, cadence=2.0),
        'simulated, ±10 % per step': partial(simulated_person, seconds, even_steps(0)),
        'simulated, ±10 % per step, another': partial(simulated_person, seconds, even_steps(1)),
        'simulated, stops and starts': partial(stopping, seconds),
        'recorded, 2 × 20 m with a turn': partial(walking_20_m),
        'recorded, on a treadmill': partial(on_the_treadmill),
    }


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else '')
    parser.add_argument('--seconds', type=float, default=120.0, help='length of the simulated walks')
    options = parser.parse_args()
    print(f'{"":44} falls   rms [ms]  in order  alarms   sample')
    for name, case in cases(options.seconds).items():
        score = case()
        print(
            f'{name:44}{score.falls:6}{1e3 * score.rms:10.1f}{"!" if score.rms > LATE_GOAL else " "}'
            f'{100.0 * score.right:8.1f} %{"!" if score.right < ORDER_GOAL else " "}{score.alarms:6}'
            f'{1e6 * score.seconds:7.0f} µs',
            flush=True,
        )
    return 0


if __name__ == '__main__':
    sys.exit(main())

"""How well trials tell their rigs: coverage of the 90 % intervals, median errors, and the time that it takes.

    python benchmarks/identify.py [--rigs 100] [--seed 1] [--fix mass,slope]

Simulated trials of 10 s at 60 Hz with 0.1° of noise, of rigs drawn at random about 10 kg, r² 0.3, ΔD0 0.5 σ and
100 N·s/m. The rig file is the paper's, but for what is fixed; the slope differs from it as is assumed. Times
are of the processor, for one trial, beside that of one plain simulation of it.
Goals: 85 to 95 of 100 intervals hold the truth; median errors of k ΔD0 / b 1.5 %, r² 0.02, restitution 0.012; with mass
and slope given b 4 % and ΔD0 0.05 σ; 20 s a trial.
"""

import argparse
import math
import time
from collections import defaultdict

import numpy as np

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.identification.findings import COMBINATIONS, combinations, parameters
from dcdrw_sim.identification.fit import identify
from dcdrw_sim.identification.samples import free_rolling
from dcdrw_sim.identification.unknowns import knowledge
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.ends import End
from dcdrw_sim.motion.trajectory import run

SECONDS, RATE, NOISE = 10.0, 60.0, math.radians(0.1)
SAID = RigParams()
RELATIVE = ('mass', 'b', 'drift', 'damping_per_mass', 'stiffness_per_mass')
"""Whose errors are told in percent."""


def random_rig(rng: np.random.Generator) -> RigParams:
    wheel = WheelParams(
        mass=10.0 * math.exp(rng.normal(0.0, 0.25)),
        gyration=math.sqrt(rng.uniform(0.1, 0.5)),
        restitution=rng.uniform(0.02, 0.15),
    )
    rig = RigParams(
        wheel,
        wheel,
        b=100.0 * math.exp(rng.normal(0.0, 0.25)),
        slope=SAID.slope + rng.normal(0.0, math.radians(0.25)),
        coupler_friction=rng.uniform(0.1, 1.0),
        rolling_resistance=rng.uniform(0.0, 0.006),
    )
    return rig._replace(D0=rig.resolved().D0 + rng.uniform(0.3, 0.7) * wheel.step_length)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--rigs', type=int, default=100)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--fix', default='')
    options = parser.parse_args()
    fixed = tuple(filter(None, options.fix.split(',')))
    rng = np.random.default_rng(options.seed)
    held, errors = defaultdict(list), defaultdict(list)
    identified, simulated = [], []
    while len(identified) < options.rigs:
        true, phase = random_rig(rng), rng.uniform(0.1, 0.9)
        began = time.process_time()
        try:
            motion = run(*start(true, phase), SECONDS)
        except ValueError:  # its wheels do not roll by themselves
            continue
        if motion.end is not End.TIME:
            continue
        simulated.append(time.process_time() - began)
        times = np.arange(0.0, SECONDS, 1.0 / RATE)
        at = motion.at(times)
        psi = np.column_stack([at.rotation1, at.rotation2])
        psi += rng.normal(0.0, NOISE, psi.shape)
        known = knowledge(_said(true, fixed), fixed)
        began = time.process_time()
        fit = identify(known, [free_rolling(SAID, times, psi)])
        identified.append(time.process_time() - began)
        truth = {unknown.name: unknown.shown(unknown.coordinate(true.resolved())) for unknown in known.unknowns}
        truth |= {combination.name: combination.value(true) for combination in COMBINATIONS}
        for finding in (*parameters(fit), *combinations(fit)):
            held[finding.name].append(finding.low <= truth[finding.name] <= finding.high)
            scale = 0.01 * truth[finding.name] if finding.name in RELATIVE else 1.0
            errors[finding.name].append(abs(finding.value - truth[finding.name]) / scale)
    print(f'{options.rigs} rigs, seed {options.seed}, given: {", ".join(fixed) or "nothing but k"}')
    print(f'{"":<20} {"within 90 %":>12} {"median error":>13}')
    for name, inside in held.items():
        unit = ' %' if name in RELATIVE else ''
        print(f'{name:<20} {np.mean(inside):>12.0%} {np.median(errors[name]):>13.3g}{unit}')
    print(f'ΔD0 in steps: {np.median(errors["D0"]) / SAID.front.step_length:.3g} σ')
    print(
        f'time: {np.median(identified):.2f} s a trial, {max(identified):.2f} s at most; one simulation '
        f'{np.median(simulated):.3f} s'
    )


def _said(true: RigParams, fixed: tuple[str, ...]) -> RigParams:
    """What the lab's rig file says: the paper's rig, but for what was measured."""
    front, rear = SAID.front, SAID.rear
    if 'mass' in fixed:
        front, rear = front._replace(mass=true.front.mass), rear._replace(mass=true.rear.mass)
    return SAID._replace(front=front, rear=rear, slope=true.slope if 'slope' in fixed else SAID.slope)


if __name__ == '__main__':
    main()

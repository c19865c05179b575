"""How well trials tell their rigs: coverage of the 90 % intervals, median errors beside their bounds, and time.

    python benchmarks/identify.py [--rigs 100] [--seed 1] [--fix mass,slope] [--phase 0.1 0.5]
                                  [--assumed] [--profiles] [--filmed]

Simulated trials of 10 s at 60 Hz with 0.1° of noise, of rigs drawn at random about 10 kg, r² 0.3, ΔD0 0.5 σ and
100 N·s/m, begun anywhere in `--phase`. The rig file is the paper's, but for what is fixed; the slope differs from it as
is assumed. These rigs lie nearer together, and their sensors are better, than is assumed beforehand; `--assumed` draws
both as they are assumed: intervals of errors that are right hold the truth in 90 of 100. Those of parameters are of
standard errors, or with `--profiles` of profiles, which take some seconds a trial. The bound is the median error
of estimates whose standard errors are those of Cramér and Rao: of the samples' Fisher information at the true
parameters and start, and of what is assumed beforehand. `--filmed`: trials are filmed and tracked by the commands, at
1280 × 720 and 60 frames a second. Times are of the processor, for one trial, beside that of one plain simulation of it.
Goals: 85 to 95 of 100 intervals hold the truth; median errors of k ΔD0 / b 1.5 %, r² 0.02, restitution 0.012; with mass
and slope given b 4 % and ΔD0 0.05 σ; from films within twice; 20 s a trial.
"""

import argparse
import math
import time
from collections import defaultdict
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.stats import norm

from dcdrw.cli import main as command
from dcdrw.suite.parameter_file import given
from dcdrw.trials.motion import Whole
from dcdrw.trials.results import read_trial
from dcdrw.trials.rolling import rolling_samples
from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_msgs_py.values import Floats
from dcdrw_msgs_py.yaml_file import yaml_text
from dcdrw_sim.identification.findings import COMBINATIONS, combinations, parameters, profiles
from dcdrw_sim.identification.fit import OWN, PARTS, REPEATED, START, ZERO, Explained, Fit, Problem, identify, shares
from dcdrw_sim.identification.samples import Samples, free_rolling
from dcdrw_sim.identification.unknowns import Knowledge, knowledge
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.ends import End
from dcdrw_sim.motion.trajectory import Run, run

SECONDS, RATE, NOISE = 10.0, 60.0, math.radians(0.1)
SAID = RigParams()
RELATIVE = ('mass', 'b', 'drift', 'damping_per_mass', 'stiffness_per_mass')
"""Whose errors are told in percent."""
HALF_NORMAL = abs(norm.ppf((np.arange(100) + 0.5) / 100))
"""Errors of an estimate whose standard error is 1, each as likely as the next."""


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


def assumed_rig(rng: np.random.Generator, fixed: tuple[str, ...]) -> RigParams:
    """As likely as the paper's rig file says without more, but for what is fixed; bounds are mirrors."""
    known = knowledge(_said(random_rig(rng), fixed), fixed)
    low, _ = known.bounds()
    return known.rig_with(low + abs(rng.multivariate_normal(known.coordinates, known.covariance) - low))


def systematic(samples: Samples, rng: np.random.Generator) -> Floats:
    """Errors of ψ1 and ψ2 as they are assumed [rad]."""
    errors = rng.normal(0.0, [ZERO, *[REPEATED] * PARTS], (2, 1 + PARTS))
    return np.einsum('twk,wk->tw', shares(samples, np.array([SAID.front.alpha, SAID.rear.alpha])), errors)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--rigs', type=int, default=100)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--fix', default='')
    parser.add_argument(
        '--phase', type=float, nargs='+', default=[0.1, 0.9], help='of all starts, or between which they are drawn'
    )
    parser.add_argument('--assumed', action='store_true', help='rigs and systematic errors are as is assumed')
    parser.add_argument('--profiles', action='store_true', help="parameters' intervals are as the command tells them")
    parser.add_argument('--filmed', action='store_true')
    options = parser.parse_args()
    fixed = tuple(filter(None, options.fix.split(',')))
    rng = np.random.default_rng(options.seed)
    held, errors, bounds = defaultdict(list), defaultdict(list), defaultdict(list)
    identified, simulated = [], []
    while len(identified) < options.rigs:
        true = assumed_rig(rng, fixed) if options.assumed else random_rig(rng)
        phase = rng.uniform(options.phase[0], options.phase[-1])
        began = time.process_time()
        try:
            motion = run(*start(true, phase), SECONDS)
        except ValueError:  # its wheels do not roll by themselves
            continue
        if motion.end is not End.TIME:
            continue
        simulated.append(time.process_time() - began)
        samples = filmed(true, phase, len(identified)) if options.filmed else measured(motion, rng)
        if options.assumed:
            samples = samples._replace(rotations=samples.rotations + systematic(samples, rng))
        known = knowledge(_said(true, fixed), fixed)
        began = time.process_time()
        fit = identify(known, [samples])
        identified.append(time.process_time() - began)
        truth = {unknown.name: unknown.shown(unknown.coordinate(true.resolved())) for unknown in known.unknowns}
        truth |= {combination.name: combination.value(true) for combination in COMBINATIONS}
        [trial] = fit.trials
        best = ideal(known, true, motion, trial if options.filmed else trial._replace(noise=NOISE, memory=1.0))
        told = [*parameters(fit, profiles(fit) if options.profiles else ()), *combinations(fit)]
        for finding, bound in zip(told, [*parameters(best), *combinations(best)], strict=True):
            held[finding.name].append(finding.low <= truth[finding.name] <= finding.high)
            scale = 0.01 * abs(truth[finding.name]) if finding.name in RELATIVE else 1.0
            errors[finding.name].append(abs(finding.value - truth[finding.name]) / scale)
            bounds[finding.name].extend(bound.error / scale * HALF_NORMAL)
    starts = ' to '.join(f'{100 * phase:g}' for phase in options.phase)
    drawn = ', as is assumed' * options.assumed
    print(
        f'{options.rigs} rigs{drawn}, seed {options.seed}, begun at {starts} %, given {options.fix or "nothing but k"}'
    )
    print(f'{"":<20} {"within 90 %":>12} {"median error":>13} {"bound":>10}')
    for name, inside in held.items():
        unit = ' %' if name in RELATIVE else ''
        error, bound = np.median(errors[name]), np.median(bounds[name])
        print(f'{name:<20} {np.mean(inside):>12.0%} {error:>13.3g} {bound:>10.3g}{unit}')
    error, bound = (np.median(one['D0']) / SAID.front.step_length for one in (errors, bounds))
    print(f'ΔD0 in steps: {error:.3g} σ, bound {bound:.3g} σ')
    print(
        f'time: {np.median(identified):.2f} s a trial, {max(identified):.2f} s at most; one simulation '
        f'{np.median(simulated):.3f} s'
    )


def measured(motion: Run, rng: np.random.Generator) -> Samples:
    """As encoders would have them."""
    times = np.arange(0.0, SECONDS, 1.0 / RATE)
    at = motion.at(times)
    psi = np.column_stack([at.rotation1, at.rotation2])
    return free_rolling(SAID, times, psi + rng.normal(0.0, NOISE, psi.shape))


def filmed(true: RigParams, phase: float, seed: int) -> Samples:
    """As a camera has them."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / 'true.yaml').write_text(yaml_text({'/**': {'ros__parameters': given(true)}}))
        start_of = ['--initial-phase', 100.0 * phase, '--seconds', SECONDS, '--image-seed', seed]
        film = ['film', '--out', folder / 'trial.mp4', '--rig', folder / 'true.yaml', *start_of, '--quiet']
        files = ['--camera', folder / 'trial.camera.yaml', '--rig', folder / 'trial.rig.yaml']
        track = ['track', folder / 'trial.mp4', *files, '--out', folder / 'tracked']
        for arguments in (film, track):
            with redirect_stdout(StringIO()):
                command([*map(str, arguments)])
        whole = Whole()
        trial, _ = read_trial(folder / 'tracked', sinks=[whole])
        return rolling_samples(trial, whole.motion, SAID)


def ideal(known: Knowledge, true: RigParams, motion: Run, trial: Explained) -> Fit:
    """The fit that finds the truth itself, with the errors that follow from the samples' information there."""
    samples = trial.samples
    at = motion.at(np.array([samples.begins]))
    coordinates = [unknown.coordinate(true.resolved()) for unknown in known.unknowns]
    point = np.concatenate([coordinates, at.theta1, at.omega1, at.theta2, at.omega2, np.zeros(OWN - START)])
    problem = Problem(known, [samples], [trial.deviation])
    return Fit(problem, point, problem.covariance(point), ())


def _said(true: RigParams, fixed: tuple[str, ...]) -> RigParams:
    """What the lab's rig file says: the paper's rig, but for what was measured."""
    front, rear = SAID.front, SAID.rear
    if 'mass' in fixed:
        front, rear = front._replace(mass=true.front.mass), rear._replace(mass=true.rear.mass)
    return SAID._replace(front=front, rear=rear, slope=true.slope if 'slope' in fixed else SAID.slope)


if __name__ == '__main__':
    main()

"""`dcdrw identify`: what recorded trials tell of the rig, and what they cannot tell."""

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dcdrw.console import LiveLine, add_json, check_json, number, positive, tell, tell_where
from dcdrw.drawings.figure_files import add_formats, figure_files, write_figure
from dcdrw.files import add_force, refuse_existing, to_json, write_text, write_whole
from dcdrw.suite.parameter_file import TrialParams, read_parameter_file, read_uncertainty, write_changed
from dcdrw.trials.motion import Whole
from dcdrw.trials.results import read_trial
from dcdrw.trials.rolling import rolling_samples, table_samples
from dcdrw_msgs_py.quantity import flatten
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.topics import JOINT_STATES
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.figures.identification_figures import draw_identification
from dcdrw_sim.figures.style import for_print, new_figure
from dcdrw_sim.identification.findings import (
    COMBINATIONS,
    Fault,
    Finding,
    Gain,
    Misfit,
    Profile,
    combinations,
    faults,
    gains,
    misfit,
    parameters,
    profiles,
    together,
)
from dcdrw_sim.identification.fit import ZERO, Fit, identify
from dcdrw_sim.identification.unknowns import correlation, knowledge
from dcdrw_sim.model.presets import PRESETS

FIGURE, RESULT, RIG = 'identification', 'identification.json', 'rig.yaml'
SLOW = 5.0
"""Where what is left of a trial has more memory than this, it is told."""
MOST_GAINS = 3
"""Measurements that are told."""
_EPILOG = """\
A recording is as for dcdrw analyze, or the folder of dcdrw track, or a CSV file of encoders: columns time [s], psi1 and
psi2 [rad] (or psi1_deg, psi2_deg), both zero where a spoke stands along the slope's normal. Other units stand in
brackets behind a name: time [ms].

The rig file says what is known: its values are where the search begins, and how far each is trusted stands in its
section on uncertainty (docs/identify.md), or is assumed. The spring's rate is as the file says: free wheels tell
masses, damping and friction only in proportion to it. Several recordings must be of the same rig.

Exit status: 0 the trials are explained, 1 one is not (the sentence says where), 2 wrong input.

examples:
  dcdrw identify trials/first --rig my_rig.yaml --out identified
  dcdrw identify trials/* --rig my_rig.yaml --fix mass,slope --out identified_together
  dcdrw design --rig identified/rig.yaml                 the coupler for that rig, as well as it is known
"""


class Outcome(NamedTuple):
    """All that is told."""

    fit: Fit
    found: list[Finding]
    combined: list[Finding]
    gains: list[Gain]
    misfits: list[Misfit | None]
    faults: list[list[Fault]]
    """Of each trial."""
    profiles: list[Profile]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Find the parameters of a rig under which the model moves as the rig did, with their errors.'
    parser.epilog = _EPILOG
    parser.add_argument('recordings', type=Path, nargs='+', metavar='RECORDING')
    parser.add_argument('--rig', type=Path, required=True, metavar='RIG.yaml', help='what is known of the rig')
    parser.add_argument('--fix', type=_names, default=(), metavar='mass,slope', help='these are as the rig file says')
    parser.add_argument(
        '--zero-deg',
        type=positive,
        default=math.degrees(ZERO),
        metavar='DEG',
        help='to what the zeros of both wheels are known (default: %(default)g)',
    )
    parser.add_argument('--from', dest='begin', type=number, default=0.0, metavar='S', help='time in the trials [s]')
    parser.add_argument('--to', dest='end', type=number, default=math.inf, metavar='S', help='time in the trials [s]')
    parser.add_argument(
        '--topic', default=JOINT_STATES.name, metavar='NAME', help='where the joint states are (default: %(default)s)'
    )
    parser.add_argument('--namespace', default='', metavar='NS', help='of the suite, where several were recorded')
    parser.add_argument('--out', type=Path, metavar='DIR', help=f'write {RIG}, {RESULT} and the figure there')
    add_formats(parser)
    add_json(parser)
    add_force(parser)


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(',') if name.strip())


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    check_json(options)
    if options.out:
        new_figure(1, 1, 'the figure of an identification')
        files = [options.out / RIG, options.out / RESULT, *figure_files(options.out, [FIGURE], options.formats)]
        refuse_existing(files, options.force)
    rig = read_parameter_file(options.rig, TrialParams.of_rig(PRESETS['paper'].rig), options.namespace).rig
    known = knowledge(rig, options.fix, read_uncertainty(options.rig), str(options.rig))
    if not known.unknowns:
        raise ValueError('everything is fixed: there is nothing to identify')
    trials = []
    for path in options.recordings:
        if path.suffix.lower() == '.csv':
            trials.append(table_samples(path, known.rig, options.begin, options.end))
            continue
        whole = Whole()
        trial, _ = read_trial(path, None, options.rig, options.topic, options.namespace, [whole])
        for text in (*trial.damage, *trial.notes):
            print(f'dcdrw identify: {text}', file=sys.stderr)
        try:
            trials.append(rolling_samples(trial, whole.motion, known.rig, options.begin, options.end))
        except ValueError as error:
            raise ValueError(f'{path}: {error}') from None
    with LiveLine() as line:
        fit = identify(known, trials, math.radians(options.zero_deg), line.show)
        profiled = profiles(fit, line.show)
        outcome = Outcome(
            fit,
            parameters(fit, profiled),
            combinations(fit),
            gains(fit),
            [misfit(fit, trial) for trial in fit.trials],
            [faults(fit, index) for index in range(len(fit.trials))],
            profiled,
        )
    found = record(options.recordings, outcome)
    tell(options, report(options.recordings, outcome), found)
    if options.out:
        _write(options, outcome, found)
    return 1 if any(outcome.misfits) else 0


def _write(options: argparse.Namespace, outcome: Outcome, found: dict[str, Any]) -> None:
    fit = outcome.fit
    options.out.mkdir(parents=True, exist_ok=True)
    changes = {
        name: value
        for name, value in flatten(fit.after.rig_with(fit.coordinates)).items()
        if any(name in unknown.parameters for unknown in fit.known.unknowns)
    }
    remark = f'As dcdrw identify found it in {", ".join(map(str, options.recordings))}'
    with write_whole(options.out / RIG, options.force) as path:
        write_changed(options.rig, changes, path, remark, fit.after.uncertainty)
    write_text(options.out / RESULT, to_json(found), options.force)
    with for_print():
        figure = draw_identification(fit, outcome.found, outcome.profiles)
        write_figure(figure, options.out, FIGURE, options.formats, options.force)
    tell_where(options, f'\nThe rig file, the figure and all numbers are in {options.out}.')


def report(recordings: Sequence[Path], outcome: Outcome) -> Iterator[str]:
    """Lines for a person."""
    fit = outcome.fit
    for path, trial, left, wrong in zip(recordings, fit.trials, outcome.misfits, outcome.faults, strict=True):
        count, outliers = trial.outliers.size, int(trial.outliers.sum())
        yield (
            f'{path}: {len(trial.residuals)} samples over {trial.samples.seconds[-1]:.1f} s, '
            f'residuals {math.degrees(trial.noise):.3f}° rms, {outliers} of {count} left out as outliers'
        )
        yield f'  {_explanation(left)}'
        yield from (f'  {_warning(fault)}' for fault in wrong)
        if trial.memory > SLOW:
            yield f'  What is left goes on from sample to sample: {trial.memory:.0f} of them count as one.'
    yield ''
    yield f'{"parameter":<20} {"value":>10} {"± error":>10}   90 % interval          told by'
    for finding in outcome.found:
        yield _line(finding)
    for name in (name for name, error in fit.after.uncertainty.errors.items() if error == 0.0):
        yield f'{name:<20} {"as the rig file has it":>22}'
    yield ''
    for finding, doc in _documented(outcome.combined):
        yield f'{_line(finding)}, {doc}'
    yield ''
    yield from _remarks(fit, outcome.found)
    yield ''
    yield 'What would tell more:'
    for gain in outcome.gains[:MOST_GAINS]:
        errors = ', '.join(f'{name} ±{now:.3g} → ±{then:.2g}' for name, (now, then) in gain.errors.items())
        yield f'  {gain.what}: {errors or "little"}'


def _explanation(left: Misfit | None) -> str:
    if left is None:
        return 'The model explains the trial.'
    where = (
        f'{100.0 * left.outliers:.0f} % of its samples are outliers: find where they come from'
        if left.is_outliers
        else f'the {(FRONT, REAR)[left.wheel]} wheel is off by '
        f'{math.degrees(left.worst):.2f}° from {left.begins:.1f} to {left.ends:.1f} s, '
        f'most at stance angles about {math.degrees(left.theta):.0f}°'
    )
    return f'NO parameters of the model explain this trial: {where}; the errors below mean nothing'


def _warning(fault: Fault) -> str:
    if fault.wheel is not None:
        return (
            f'The zero of the {(FRONT, REAR)[fault.wheel]} wheel is off by {math.degrees(fault.value):+.2f}° ± '
            f'{math.degrees(fault.error):.2f}°, which is allowed for: calibrate it to learn more.'
        )
    late, early = (REAR, FRONT) if fault.value > 0.0 else (FRONT, REAR)
    return (
        f'The {late} wheel is stamped {1e3 * abs(fault.value):.1f} ± {1e3 * fault.error:.1f} ms later than the {early} '
        'one, which is allowed for: mend the stamps to learn more.'
    )


def _line(finding: Finding) -> str:
    unit = f' {finding.unit}' if finding.unit else ''
    interval = f'{finding.low:.4g} to {finding.high:.4g}{unit}'
    return f'{finding.name:<20} {finding.value:>10.4g} {finding.error:>10.2g}   {interval:<22} {finding.source.value}'


def _documented(found: list[Finding]) -> Iterator[tuple[Finding, str]]:
    docs = {combination.name: combination.doc for combination in COMBINATIONS}
    for finding in found:
        yield finding, docs[finding.name]


def _remarks(fit: Fit, found: list[Finding]) -> Iterator[str]:
    """What the data cannot tell, in sentences."""
    sought = {unknown.name for unknown in fit.known.unknowns}
    scale = [name for name in ('mass', 'front.mass', 'rear.mass', 'k', 'b', 'coupler_friction') if name in sought]
    given = ' and '.join(name for name in ('mass', 'k') if name not in sought and f'front.{name}' not in sought)
    yield (
        f'Free wheels never tell the common scale of masses, k, b and F_c: {", ".join(scale) or "all"} '
        + (f'are in proportion to {given} as the rig file has it.' if given else 'have it from what was assumed.')
    )
    if {'slope', 'rolling_resistance'} <= sought:
        yield (
            'They never tell slope from rolling resistance: only the drive, sin γ − c_r α / sin α, is known; how it is '
            'shared out is assumed.'
        )
    for one, other, part in together(fit):
        yield f'{one} and {other} are known together only: their errors correlate by {part:.3f}.'
    assumed = [finding.name for finding in found if finding.part > 0.8]
    if assumed:
        yield f'The trials say next to nothing of {", ".join(assumed)}: the error is that which was assumed.'


def record(recordings: Sequence[Path], outcome: Outcome) -> dict[str, Any]:
    """Everything for a program, in SI units and radians."""
    fit = outcome.fit
    return {
        'recordings': [str(path) for path in recordings],
        'explained': not any(outcome.misfits),
        'rig': flatten(fit.after.rig_with(fit.coordinates)),
        'parameters': {finding.name: _finding(finding) for finding in outcome.found},
        'combinations': {finding.name: _finding(finding) for finding in outcome.combined},
        'given': [name for name, error in fit.after.uncertainty.errors.items() if error == 0.0],
        'correlations': {
            'names': [unknown.name for unknown in fit.known.unknowns],
            'rows': correlation(fit.covariance).tolist(),
        },
        'known_together': [list(pair) for pair in together(fit)],
        'profiles': {
            profile.name: {'values': profile.values.tolist(), 'deviance': profile.deviance.tolist()}
            for profile in outcome.profiles
        },
        'trials': [
            {
                'samples': len(trial.residuals),
                'begins': trial.samples.begins,
                'seconds': float(trial.samples.seconds[-1]),
                'start': dict(zip(('theta1', 'omega1', 'theta2', 'omega2'), trial.start.tolist(), strict=True)),
                'start_errors': starts.tolist(),
                'zeros': trial.systematic[:, 0].tolist(),
                'zero_errors': systematic[:, 0].tolist(),
                'rear_late': trial.late,
                'faults': wrong,
                'noise': trial.noise,
                'memory': trial.memory,
                'outliers': int(trial.outliers.sum()),
                'unexplained': left,
            }
            for trial, left, wrong, (starts, systematic, _) in zip(
                fit.trials, outcome.misfits, outcome.faults, _own_errors(fit), strict=True
            )
        ],
        'next': [gain._asdict() for gain in outcome.gains],
    }


def _own_errors(fit: Fit) -> list[tuple[Floats, Floats, float]]:
    errors = np.sqrt(fit.whole_covariance.diagonal())
    return [fit.problem.own(trial, errors) for trial in range(len(fit.trials))]


def _finding(finding: Finding) -> dict[str, Any]:
    content = {name: value for name, value in finding._asdict().items() if name != 'name'}
    return {**content, 'source': finding.source.value}

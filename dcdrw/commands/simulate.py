"""`dcdrw simulate`: cases in, strikes and motion out."""

import argparse
import sys
from pathlib import Path

import numpy as np

from dcdrw.console import count, positive
from dcdrw.files import add_force, refuse_existing, to_json, write_csv, write_text, write_whole
from dcdrw_msgs_py.words import counted
from dcdrw_sim.motion.cases import DEFAULT_STRIKES, Case, read_cases, run_record
from dcdrw_sim.motion.trajectory import Run, Trajectory
from dcdrw_sim.motion.trajectory import run as integrate

_EPILOG = """\
A case is {"g", "slope", "l": [2], "m": [2], "alpha": [2], "k", "b", "D0", "S0", "x0": [theta1, omega1, theta2,
omega2]}, SI units and radians, or such an object under "case" beside its "strikes". The output has the same form;
"end" tells why a case ended before its last strike. Several cases in one trajectory file are told apart by the
column `case` (csv) or by a prefix `<case>/` of each array (npz).
"""


MOST_SAMPLES = 20_000_000
"""Samples of a trajectory file, which must fit into memory."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Integrate cases to their strikes, which are located to rounding error.'
    parser.epilog = _EPILOG
    parser.add_argument('cases', type=Path, metavar='CASE.json', help='one case or a list of cases')
    parser.add_argument(
        '--strikes',
        type=Path,
        metavar='OUT.json',
        help='write the strikes here (default: print them, unless a trajectory is asked for)',
    )
    parser.add_argument(
        '--count',
        type=count,
        metavar='N',
        help=f'strikes per case (default: as many as the case lists, else {DEFAULT_STRIKES})',
    )
    add_force(parser)
    parser.add_argument('--trajectory', type=Path, metavar='OUT.csv|OUT.npz', help='write the motion here')
    parser.add_argument(
        '--rate',
        type=positive,
        default=100.0,
        metavar='HZ',
        help='samples per unit of time of the trajectory (default: %(default)g)',
    )


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    if options.trajectory and options.trajectory.suffix not in _WRITERS:
        raise ValueError(f'--trajectory must end in {" or ".join(_WRITERS)}, got {options.trajectory}')
    refuse_existing(filter(None, (options.strikes, options.trajectory)), options.force)
    cases, is_list = read_cases(options.cases)
    runs = []
    for case in cases:
        result = integrate(case.rig, case.state, strikes=options.count or case.listed_strikes)
        runs.append(result)
        print(
            f'{case.name}: {counted(len(result.strikes), "strike")} in {result.duration:.6g}; {result.reason}',
            file=sys.stderr,
        )
    records = [run_record(case, result) for case, result in zip(cases, runs, strict=True)]
    text = to_json(records if is_list else records[0])
    if options.strikes:
        write_text(options.strikes, text, options.force)
    elif not options.trajectory:
        print(text, end='')
    if options.trajectory:
        samples = sum(result.duration for result in runs) * options.rate
        if samples > MOST_SAMPLES:
            raise ValueError(f'--rate {options.rate:g} makes {samples:.3g} samples; {MOST_SAMPLES:.0e} are the limit')
        motions = [(name, _sample(result, options.rate)) for name, result in zip(_labels(cases), runs, strict=True)]
        with write_whole(options.trajectory, options.force) as unfinished:
            _WRITERS[options.trajectory.suffix](unfinished, motions)
    return 0


def _labels(cases: list[Case]) -> list[str]:
    """The cases' names, numbered where one stands twice."""
    names = [case.name for case in cases]
    return [f'{name}_{index}' if names.count(name) > 1 else name for index, name in enumerate(names)]


def _sample(result: Run, rate: float) -> Trajectory:
    return result.at(np.arange(int(result.duration * rate) + 1) / rate)


def _write_csv(path: Path, motions: list[tuple[str, Trajectory]]) -> None:
    rows = ((name, *map(float, row)) for name, motion in motions for row in zip(*motion, strict=True))
    write_csv(path, ('case', *Trajectory._fields), rows, force=True)


def _write_npz(path: Path, motions: list[tuple[str, Trajectory]]) -> None:
    prefix = len(motions) > 1
    np.savez_compressed(
        path,
        **{
            f'{name}/{field}' if prefix else field: column
            for name, motion in motions
            for field, column in motion._asdict().items()
        },
    )


_WRITERS = {'.csv': _write_csv, '.npz': _write_npz}

"""A verdict that is expected, and the exit status where another one comes."""

import argparse
import sys
from collections.abc import Iterable

from dcdrw_msgs_py.diagnosis import PairState

UNEXPECTED = 3
"""Exit status of a command whose trial ends in another state than the one that was asked for."""


def add_expect(parser: argparse.ArgumentParser) -> None:
    """Add the option that asks for a verdict."""
    parser.add_argument(
        '--expect',
        choices=[state.value for state in PairState],
        metavar='STATE',
        help=f'exit with status {UNEXPECTED} unless each trial ends in this state, one of %(choices)s',
    )


def expectation_status(expected: str | None, states: Iterable[PairState]) -> int:
    """The exit status of trials that ended in these states; others than the expected one are told."""
    others = [] if expected is None else [state.value for state in states if state != expected]
    if others:
        print(f'expected {expected}, got {", ".join(others)}', file=sys.stderr)
    return UNEXPECTED if others else 0

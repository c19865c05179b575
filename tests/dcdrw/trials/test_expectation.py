"""A verdict that was expected, and the exit status where another one comes."""

import argparse

import pytest

from dcdrw.cli import COMMANDS
from dcdrw.command_line import CommandLine
from dcdrw.trials.expectation import UNEXPECTED, add_expect, expectation_status
from dcdrw_msgs_py.diagnosis import PairState

STATES = list(PairState)


@pytest.mark.parametrize('expected', STATES)
def test_the_status_is_good_where_every_trial_ends_as_expected(expected):
    assert expectation_status(expected, [expected, expected]) == 0
    for other in STATES:
        assert expectation_status(expected, [expected, other]) == (0 if other is expected else UNEXPECTED)
        assert expectation_status(None, [other]) == 0


def test_what_came_in_its_place_is_told(capsys):
    expectation_status('stalled', [PairState.STALLED, PairState.SYNCHRONIZED])
    assert capsys.readouterr().err == 'expected stalled, got synchronized\n'


def test_the_status_is_no_other_commands():
    assert UNEXPECTED not in (0, 1, 2)


def test_an_unknown_state_is_told_with_the_known_ones():
    parser = argparse.ArgumentParser(exit_on_error=False)
    add_expect(parser)
    assert parser.parse_args(['--expect', 'synchronized']).expect == PairState.SYNCHRONIZED
    with pytest.raises(argparse.ArgumentError, match=r'good.*no_data.*synchronized.*converging'):
        parser.parse_args(['--expect', 'good'])


@pytest.mark.parametrize('name', ['trial', 'analyze', 'track', 'report'])
def test_every_command_that_judges_a_trial_takes_an_expectation(name):
    parser = CommandLine(COMMANDS, '', '').commands[name]
    parser.load()
    assert {'--expect', '--json'} <= set(parser.option_strings)

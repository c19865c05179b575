"""A rig is a preset, then what a file changes, then what an option does; wherever one is taken."""

import argparse
import math

import pytest

from dcdrw.cli import COMMANDS
from dcdrw.command_line import CommandLine
from dcdrw.suite.parameter_file import RIG_OPTIONS, TrialParams, add_rig_options, chosen_params
from dcdrw_sim.model.presets import preset

TAKE_A_RIG = ('trial', 'live', 'film', 'design', 'sweep', 'regimes', 'map', 'models', 'urdf')


def chosen(*arguments: str) -> TrialParams:
    parser = argparse.ArgumentParser()
    add_rig_options(parser)
    return chosen_params(parser.parse_args(arguments))


def test_each_option_changes_its_parameters_wherever_they_stand():
    params = chosen('--k', '7', '--b', '50', '--slope-deg', '3', '--mass', '12', '--length', '0.5', '--spokes', '8')
    rig = params.rig
    assert (rig.k, rig.b, rig.slope) == (7.0, 50.0, pytest.approx(math.radians(3.0)))
    for wheel in (rig.front, rig.rear):
        assert (wheel.mass, wheel.length, wheel.spokes) == (12.0, 0.5, 8)
    for wheel in (params.phase.front, params.phase.rear):
        assert (wheel.length, wheel.spokes) == (0.5, 8)
    assert params.sync.front.spokes == params.sync.rear.spokes == 8


def test_without_options_the_rig_is_the_preset():
    assert chosen().rig == preset('paper')
    assert chosen('--preset', 'paper-sweep').rig == preset('paper-sweep')


def test_an_option_counts_more_than_the_file(tmp_path):
    (tmp_path / 'rig.yaml').write_text('/**:\n  ros__parameters: {k: 6.0, slope: 0.05, front.mass: 11.0}\n')
    rig = chosen('--rig', str(tmp_path / 'rig.yaml'), '--k', '7').rig
    assert (rig.k, rig.slope, rig.front.mass, rig.rear.mass) == (7.0, 0.05, 11.0, preset('paper').rear.mass)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (('--mass', '-3'), r'front\.mass must be > 0, ≤ 1000 kg, got -3\.0 \(--mass\)'),
        (('--spokes', '3'), r'front\.spokes must be ≥ 4, ≤ 1000, got 3 \(--spokes\)'),
        (('--slope-deg', '60'), r'slope must be .* \(--slope-deg\)'),
    ],
)
def test_what_is_impossible_is_told_with_its_option(arguments, message):
    with pytest.raises(ValueError, match=message):
        chosen(*arguments)


def test_a_slope_that_is_told_in_degrees_is_not_asked_about():
    with pytest.raises(ValueError, match=r'slope must be .* rad, got 0\.872\d* \(--slope-deg\)'):
        chosen('--slope-deg', '50')


def test_a_slope_in_degrees_is_asked_about(tmp_path):
    (tmp_path / 'rig.yaml').write_text('/**:\n  ros__parameters: {slope: 2}\n')
    with pytest.raises(ValueError, match=r'rad, got 2: degrees\? 2° is 0\.0349066 rad \(.*rig\.yaml\)'):
        chosen('--rig', str(tmp_path / 'rig.yaml'))


@pytest.mark.parametrize(
    ('name', 'value', 'meant'),
    [
        ('front.length', 965.2, 'millimetres? 965.2 mm is 0.9652 m; centimetres? 965.2 cm is 9.652 m'),
        ('front.length', 96.52, 'millimetres? 96.52 mm is 0.09652 m; centimetres? 96.52 cm is 0.9652 m'),
        ('rear.mass', 10000, 'grams? 10000 g is 10 kg'),
        ('S0', 965.2, 'millimetres? 965.2 mm is 0.9652 m; centimetres? 965.2 cm is 9.652 m'),
        ('D0', 1200, 'millimetres? 1200 mm is 1.2 m; centimetres? 1200 cm is 12 m'),
        ('theta1', 15, 'degrees? 15° is 0.261799 rad'),
        ('stale_after', 1000, 'milliseconds? 1000 ms is 1 s'),
        ('gravity', 9810, ''),
    ],
)
def test_a_value_in_another_unit_is_refused_with_what_it_would_be(tmp_path, name, value, meant):
    (tmp_path / 'rig.yaml').write_text(f'/**:\n  ros__parameters: {{{name}: {value}}}\n')
    with pytest.raises(ValueError, match=rf'{name} must be .*, got {value}.*') as caught:
        chosen('--rig', str(tmp_path / 'rig.yaml'))
    assert f'got {value}{": " if meant else ""}{meant} ({tmp_path}' in str(caught.value)


@pytest.mark.parametrize('name', TAKE_A_RIG)
def test_every_command_that_takes_a_rig_takes_the_options(name):
    parser = CommandLine(COMMANDS, '', '').commands[name]
    parser.load()
    assert {*RIG_OPTIONS, '--rig', '--preset'} <= set(parser.option_strings)

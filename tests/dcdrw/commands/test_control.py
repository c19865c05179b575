"""`dcdrw control`: gains that the node accepts, and a loop that is stable with them."""

import json

import pytest

from dcdrw.cli import main
from dcdrw_control.sync.synchronizer import SynchronizerParams
from dcdrw_msgs_py.quantity import build
from dcdrw_msgs_py.yaml_file import read_yaml


@pytest.mark.parametrize('law', ['hold', 'rear'])
def test_its_gains_are_the_nodes_parameters(tmp_path, capsys, law):
    out = tmp_path / 'gains.yaml'
    assert main(['control', '--law', law, '--k', '16', '--b', '10', '--out', str(out)]) == 0
    told = capsys.readouterr().out
    assert 'multipliers' in told
    assert 'unstable' in told
    given = read_yaml(out)['/**']['ros__parameters']
    params = build(SynchronizerParams, {name: tuple(v) if isinstance(v, list) else v for name, v in given.items()})
    params.check_law()
    assert params.law == law
    assert main(['control', '--out', str(out)]) == 2  # it exists
    assert main(['control', '--out', str(out), '--force']) == 0


@pytest.mark.parametrize('options', [[], ['--method', 'lqr'], ['--target', 'angle'], ['--delay', '0.05']])
def test_the_loop_is_stable_and_its_edges_are_told(options, capsys):
    assert main(['control', '--json', *options]) == 0
    found = json.loads(capsys.readouterr().out)
    assert max(found['closed_loop_multipliers']) < max(found['open_loop_multipliers']) < 1.0
    assert found['unstable_gain_factor'] > 1.0


def test_a_pair_without_a_limit_cycle_is_told_so(capsys):
    assert main(['control', '--slope-deg', '1.3']) == 2
    assert 'dcdrw control:' in capsys.readouterr().err

"""`--help` of a node is answered, and nothing starts."""

import pytest

from dcdrw import entry
from dcdrw.suite.executables import EXECUTABLES
from dcdrw_msgs_py.quantity import fields

NODES = {node.name: node for node in EXECUTABLES}


@pytest.mark.parametrize('name', [name for name in entry.EXECUTABLES if name != 'dcdrw'])
def test_help_of_a_node_tells_what_it_takes(name, monkeypatch, capsys):
    monkeypatch.setattr('sys.argv', [name, '--help'])
    monkeypatch.setenv('COLUMNS', '80')
    assert entry.run(name) == 0
    told = capsys.readouterr().out
    assert max(map(len, told.splitlines())) <= 80
    known = [field.name for params in NODES[name].parameters for field in fields(params)] if name in NODES else NODES
    assert set(known) <= {line.split()[0] for line in told.splitlines() if line.startswith('  ')}

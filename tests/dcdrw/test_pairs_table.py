"""The table of pairs of parts says what it does not tell."""

from dcdrw.pairs_table import pair_lines, pair_records
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.study.design import Task
from dcdrw_sim.study.parts import Part, rank

PARTS = [Part('spring', 12.0), Part('spring', 16.0), Part('dashpot', 10.0)]


def test_a_stall_slope_that_was_not_sought_is_said():
    pairs = rank(Task(RigParams().resolved(), 60.0), PARTS, 0.0)
    assert all(pair.stall_slope_sought for pair in pairs)
    assert not any('only' in line for line in pair_lines(pairs, 9))
    fewer = [pairs[0], pairs[1]._replace(stall_slope_sought=False)]
    assert any('the best 1 only' in line for line in pair_lines(fewer, 9))
    assert [record['stall_slope_sought'] for record in pair_records(fewer)] == [True, False]

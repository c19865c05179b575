"""Several nodes in one process, over DDS."""

import pytest

from dcdrw.nodes.suite import DEFAULT, make_nodes
from dcdrw_msgs_py.topics import JOINT_STATES, PHASE_STATE, SYNC_ERROR, SYNCHRONIZER_STATE

pytestmark = pytest.mark.processes


def test_estimator_monitor_and_synchronizer_work_in_one_process(bench):
    bench.start('simulator', rate=100)
    joints, phases, errors = bench.hear(JOINT_STATES), bench.hear(PHASE_STATE), bench.hear(SYNC_ERROR)
    states = bench.hear(SYNCHRONIZER_STATE)
    bench.start('suite', '-p', 'phase_estimator:S0:=1.25', '-p', 'sync_monitor:band_percent:=7.0')
    bench.wait(lambda: len(errors) > 100, 'a second of errors')
    assert len(joints) >= len(phases) >= len(errors)
    assert states[-1].data == 'disabled'
    assert {name for name, _ in bench.node.get_node_names_and_namespaces()} >= set(DEFAULT)


def test_a_node_that_does_not_exist_is_named():
    with pytest.raises(ValueError, match='phase_estimater is not a node of the suite; there are simulator, '):
        make_nodes(('phase_estimater',))

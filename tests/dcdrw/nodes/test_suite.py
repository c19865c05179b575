"""Several nodes in one process, over DDS."""

import pytest

from dcdrw.nodes.suite import make_nodes
from dcdrw.suite.executables import HOSTED
from dcdrw_msgs_py.messages import stamp_ns
from dcdrw_msgs_py.topics import JOINT_STATES, PHASE_STATE, SYNC_STATE, SYNCHRONIZER_STATE

pytestmark = pytest.mark.processes


def test_estimator_monitor_and_synchronizer_work_in_one_process(bench):
    bench.start('simulator', rate=100)
    joints, phases, errors = bench.hear(JOINT_STATES), bench.hear(PHASE_STATE), bench.hear(SYNC_STATE)
    states = bench.hear(SYNCHRONIZER_STATE)
    bench.start('suite', '-p', 'phase_estimator:S0:=1.25', '-p', 'sync_monitor:band_percent:=7.0')
    bench.wait(lambda: min(len(joints), len(phases), len(errors)) > 100, 'a second of each')
    sampled, estimated = ([stamp_ns(one.header.stamp) for one in some] for some in (joints, phases))
    judged = [stamp_ns(one.header.stamp) for one in errors]
    common = max(sampled[0], estimated[0], judged[0])  # each topic is heard from another moment on
    assert {stamp for stamp in judged if stamp >= common} <= set(estimated)
    assert {stamp for stamp in estimated if common <= stamp <= sampled[-1]} <= set(sampled)
    listeners = {listener.node_name for listener in bench.node.get_subscriptions_info_by_topic('/phase_state')}
    assert listeners == {'bench'}  # the monitor and the synchronizer are handed the samples directly
    assert states[-1].data == 'disabled'
    assert {name for name, _ in bench.node.get_node_names_and_namespaces()} >= set(HOSTED)


def test_a_node_that_does_not_exist_is_named():
    with pytest.raises(ValueError, match='phase_estimater is not a node of the suite; there are simulator, '):
        make_nodes(('phase_estimater',))

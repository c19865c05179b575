"""The SROS2 policy grants each node what it declares, and no more."""

from xml.etree import ElementTree

import pytest

from dcdrw.suite.executables import EXECUTABLES, RECORDED, RECORDER
from dcdrw_msgs_py.topics import COUPLER_FORCE_COMMAND, ENABLE, REAR_TORQUE_COMMAND
from tests import ROOT

POLICY = ElementTree.parse(ROOT / 'config' / 'sros2_policy.xml').getroot()
COMMANDS = (COUPLER_FORCE_COMMAND, REAR_TORQUE_COMMAND, ENABLE)
OF_ROS = {'/parameter_events', '/rosout'}
OF_PARAMETERS = {
    f'~/{name}'
    for name in (
        'describe_parameters',
        'get_parameter_types',
        'get_parameters',
        'get_type_description',
        'list_parameters',
        'set_parameters',
        'set_parameters_atomically',
    )
}


def allowed(enclave: str, act: str) -> set[str]:
    """The names for which an enclave has leave: to publish, subscribe, reply or request."""
    return {
        name.text or ''
        for group in POLICY.findall(f"enclaves/enclave[@path='/dcdrw/{enclave}']/profiles/profile/*[@{act}='ALLOW']")
        for name in group
    }


@pytest.mark.parametrize('node', EXECUTABLES, ids=lambda node: node.name)
def test_each_node_may_do_what_it_declares_and_no_more(node):
    records = node is RECORDER
    heard = {topic.name for topic in (*node.subscribes, *(RECORDED if records else ()))}
    asked = {f'{other.name}/get_parameters' for other in EXECUTABLES if other is not node} if records else set()
    assert allowed(node.name, 'publish') == {topic.name for topic in node.publishes} | OF_ROS
    assert allowed(node.name, 'subscribe') == heard | {'/clock', '/parameter_events'}
    assert allowed(node.name, 'reply') == {service.split()[0] for service in node.services} | OF_PARAMETERS
    assert allowed(node.name, 'request') == asked


def test_only_the_synchronizer_commands_and_only_the_operator_enables():
    enclaves = [path.rpartition('/')[2] for one in POLICY.iter('enclave') if (path := one.get('path'))]
    may = {topic.name: [name for name in enclaves if topic.name in allowed(name, 'publish')] for topic in COMMANDS}
    assert may == {
        COUPLER_FORCE_COMMAND.name: ['synchronizer'],
        REAR_TORQUE_COMMAND.name: ['synchronizer'],
        ENABLE.name: ['operator'],
    }

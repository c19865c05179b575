"""The layouts for RViz, Foxglove, PlotJuggler and rqt show what the nodes publish."""

import json
import math
import re
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from dcdrw.drawings.rig_markers import MarkerParams
from dcdrw.suite.executables import EXECUTABLES
from dcdrw_msgs_py.messages import JointSampleWriter, PhaseSampleWriter
from dcdrw_msgs_py.node import message_type
from dcdrw_msgs_py.samples import CouplerSample, JointSample, PhaseSample, Turn
from dcdrw_msgs_py.topics import DIAGNOSTICS, JOINT_STATES, PHASE_STATE, Topic
from tests import ROOT

TOPICS = {f'/{topic.name.lstrip("/")}': topic for node in EXECUTABLES for topic in (*node.subscribes, *node.publishes)}
JOINTS = {
    JOINT_STATES: JointSampleWriter().write(
        JointSample(1, Turn(1.0, 2.0), Turn(3.0, 4.0), CouplerSample(5.0, 6.0, 7.0))
    ),
    PHASE_STATE: PhaseSampleWriter().write(PhaseSample(1, Turn(0.1, 1.0), Turn(0.2, 2.0), Turn(0.3, 3.0), 4)),
}


def content(topic: Topic) -> Any:
    return JOINTS.get(topic) or message_type(topic)()


def foxglove() -> dict[str, Any]:
    return json.loads((ROOT / 'config' / 'foxglove_layout.json').read_text(encoding='utf-8'))


def message_path(path: str) -> tuple[Topic, Any]:
    """The topic of a Foxglove message path, and what the path finds in a message."""
    match = re.fullmatch(r'(/[a-z_/]+)((?:\.[a-z_]+(?:\[\d+\])?)+)(?:\.@rad2deg)?', path)
    assert match, path
    topic = TOPICS[match[1]]
    value = content(topic)
    for name, index in re.findall(r'\.([a-z_]+)(?:\[(\d+)\])?', match[2]):
        value = getattr(value, name)
        if index:
            value = value[int(index)]
    return topic, value


def leaves(tree: Any) -> list[str]:
    return [tree] if isinstance(tree, str) else [*leaves(tree['first']), *leaves(tree['second'])]


def test_foxglove_places_each_of_its_panels_once():
    layout = foxglove()
    assert sorted(leaves(layout['layout'])) == sorted(layout['configById'])


def test_foxglove_plots_what_its_labels_say():
    panels = foxglove()['configById']
    plotted = {
        series['label']: message_path(series['value'])[1]
        for name, panel in panels.items()
        if name.startswith('Plot')
        for series in panel['paths']
        if series['value'].startswith('/')
    }
    assert plotted == {'error': 0.0, 'φ': 0.0, 'θ1 front': 0.1, 'θ2 rear': 0.2, 'F': 7.0}
    for name, panel in panels.items():
        for series in panel.get('paths', ()):
            if series['value'].startswith('/'):
                topic, value = message_path(series['value'])
                assert isinstance(value, (int, float)), (name, series)
                stamped = 'header' in content(topic).get_fields_and_field_types()
                assert series['timestampMethod'] == ('headerStamp' if stamped else 'receiveTime')
            else:
                assert math.isfinite(float(series['value']))  # a line across the plot


def test_foxglove_shows_verdict_health_and_rig():
    panels = foxglove()['configById']
    verdict = panels['Indicator!synchronized']
    assert message_path(verdict['path'])[1] is False
    assert {rule['rawValue'] for rule in verdict['rules']} == {'true', 'false'}
    rig = panels['3D!rig']
    assert rig['followTf'] == MarkerParams().frame
    assert TOPICS['/rig_markers'].type.endswith('MarkerArray')
    assert rig['topics']['/rig_markers']['visible']
    assert {panel['topicToRender'] for panel in panels.values() if 'topicToRender' in panel} == {DIAGNOSTICS.name}
    assert panels['DiagnosticStatusPanel!monitor']['selectedName'] in {node.name for node in EXECUTABLES}
    assert TOPICS[panels['Image!camera']['imageMode']['imageTopic']].type.endswith('Image')


def test_plotjuggler_curves_are_named_as_its_ros2_parser_names_them():
    """JointState: TOPIC/JOINT/FIELD, by the joint's name; else TOPIC and the field's path, separated by slashes."""
    root = ElementTree.parse(ROOT / 'config' / 'plotjuggler_layout.xml').getroot()
    curves = [curve.get('name') for curve in root.iter('curve')]
    assert len(curves) >= 10
    for curve in curves:
        name = max((name for name in TOPICS if curve.startswith(f'{name}/')), key=len)
        path, message = curve[len(name) + 1 :].split('/'), content(TOPICS[name])
        if TOPICS[name] in JOINTS:
            joint, field = path
            value = getattr(message, field)[list(message.name).index(joint)]
            assert math.isfinite(value), curve
        else:
            for field in path:
                message = getattr(message, field)
            assert isinstance(message, (int, float)), curve
    chosen = root.find("Plugins/plugin[@ID='ROS2 Topic Subscriber']/selected_topics").get('value').split(';')
    assert {max((name for name in TOPICS if curve.startswith(f'{name}/')), key=len) for curve in curves} <= set(chosen)
    assert set(chosen) <= set(TOPICS)


def test_plotjuggler_splitters_have_a_size_for_each_plot():
    root = ElementTree.parse(ROOT / 'config' / 'plotjuggler_layout.xml').getroot()
    assert root.tag == 'root'
    splitters = list(root.iter('DockSplitter'))
    assert len(splitters) == 2
    for splitter in splitters:
        sizes = [float(size) for size in splitter.get('sizes').split(';')]
        assert len(sizes) == int(splitter.get('count')) == len(splitter.findall('DockArea/plot'))
        assert sum(sizes) == pytest.approx(1.0, abs=1e-4)


def test_rviz_displays_the_topics_of_the_suite_in_the_frame_of_the_markers():
    manager = yaml.safe_load((ROOT / 'rviz' / 'dcdrw.rviz').read_text(encoding='utf-8'))['Visualization Manager']
    assert manager['Global Options']['Fixed Frame'] == MarkerParams().frame
    displays = {display['Class'].removeprefix('rviz_default_plugins/'): display for display in manager['Displays']}
    assert set(displays) == {'MarkerArray', 'RobotModel', 'TF', 'Image', 'Grid'}
    for kind in ('MarkerArray', 'Image'):
        assert TOPICS[displays[kind]['Topic']['Value']].type.endswith(f'/{kind}')
    assert displays['MarkerArray']['Enabled']
    description = displays['RobotModel']['Description Topic']  # as robot_state_publisher publishes it
    assert description['Value'] == '/robot_description'
    assert description['Durability Policy'] == 'Transient Local'


def test_the_aggregator_has_a_place_for_every_node():
    analyzers = yaml.safe_load((ROOT / 'config' / 'diagnostic_aggregator.yaml').read_text(encoding='utf-8'))
    groups = [group['contains'] for group in analyzers['analyzers']['ros__parameters'].values() if 'contains' in group]
    for node in EXECUTABLES:
        if DIAGNOSTICS in node.publishes:
            assert sum(part in node.name for parts in groups for part in parts) == 1, node.name

"""`dcdrw urdf`: what robot_state_publisher makes of it is what the model says."""

import math
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dcdrw.cli import main
from dcdrw.commands.urdf import make_urdf
from dcdrw.drawings.rig_markers import MarkerParams
from dcdrw.suite.parameter_file import TrialParams
from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_msgs_py.topics import COUPLER, FRONT_WHEEL, REAR_WHEEL

UNEQUAL = TrialParams.of_rig(RigParams(WheelParams(0.9, 10.0, 12.0), WheelParams(0.7, 8.0, 10.0), slope=0.1))
FORM = '/**:\n  ros__parameters:\n    {}\n'


def vector(element: Element | None, name: str) -> np.ndarray:
    text = '0 0 0' if element is None else element.get(name, '0 0 0')
    return np.array([float(number) for number in text.split()])


def pose(element: Element) -> np.ndarray:
    """The matrix of a joint's or visual's origin (URDF: rpy are turns about the fixed axes x, y, z)."""
    origin, matrix = element.find('origin'), np.eye(4)
    matrix[:3, :3] = Rotation.from_euler('xyz', vector(origin, 'rpy')).as_matrix()
    matrix[:3, 3] = vector(origin, 'xyz')
    return matrix


def place(robot: Element, link: str, state: dict[str, float]) -> np.ndarray:
    """The matrix of a link in the root: forward kinematics by the rules of URDF."""
    joint = next((joint for joint in robot.findall('joint') if joint.find('child').get('link') == link), None)
    if joint is None:
        return np.eye(4)
    motion, axis = np.eye(4), vector(joint.find('axis'), 'xyz')
    value = state.get(joint.get('name'), 0.0)
    if joint.get('type') == 'continuous':
        motion[:3, :3] = Rotation.from_rotvec(axis * value).as_matrix()
    elif joint.get('type') == 'prismatic':
        motion[:3, 3] = axis * value
    return place(robot, joint.find('parent').get('link'), state) @ pose(joint) @ motion


def spokes(robot: Element, wheel: str, state: dict[str, float]) -> list[np.ndarray]:
    """Tips of a wheel's spokes in the frame of its hub, turned as the root is."""
    link = next(link for link in robot.findall('link') if link.get('name') == wheel)
    turn = place(robot, wheel, state)[:3, :3]
    tips = []
    for visual in link.findall('visual'):
        half = float(visual.find('geometry/cylinder').get('length')) / 2.0
        ends = [(pose(visual) @ (0.0, 0.0, z, 1.0))[:3] for z in (-half, half)]
        hub, tip = sorted(ends, key=np.linalg.norm)
        np.testing.assert_allclose(hub, 0.0, atol=1e-8)
        tips.append(turn @ tip)
    return tips


@given(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(0.0, 5.0))
def test_joint_states_move_it_as_the_model(psi1, psi2, D):
    robot, rig = ElementTree.fromstring(make_urdf(UNEQUAL)), UNEQUAL.rig
    state = {FRONT_WHEEL: psi1, REAR_WHEEL: psi2, COUPLER: D}
    hubs = [place(robot, f'{wheel}_hub', state)[:3, 3] for wheel in ('front', 'rear')]
    downhill = np.array([math.cos(rig.slope), 0.0, -math.sin(rig.slope)])
    np.testing.assert_allclose(hubs[0] - hubs[1], D * downhill, atol=1e-8)
    for wheel, shape, psi in (('front_wheel', rig.front, psi1), ('rear_wheel', rig.rear, psi2)):
        tips = spokes(robot, wheel, state)
        assert len(tips) == shape.spokes
        for j, tip in enumerate(tips):
            # Spoke j stands, its foot below the hub, when ψ = −2αj: hub = foot + ℓ (sin θ, cos θ) in slope axes.
            theta = psi + 2.0 * shape.alpha * j + rig.slope
            np.testing.assert_allclose(-tip / shape.length, (math.sin(theta), 0.0, math.cos(theta)), atol=1e-7)


def test_with_the_coupler_at_rest_the_feet_reach_the_slope_below_the_frame():
    robot, rig = ElementTree.fromstring(make_urdf(TrialParams())), RigParams().resolved()
    state = {COUPLER: rig.D0}
    hubs = [place(robot, f'{wheel}_hub', state)[:3, 3] for wheel in ('front', 'rear')]
    normal = np.array([math.sin(rig.slope), 0.0, math.cos(rig.slope)])
    np.testing.assert_allclose(0.5 * (hubs[0] + hubs[1]), rig.front.length * normal, atol=1e-8)


@pytest.mark.parametrize('fixed', [False, True])
def test_it_is_one_tree_of_the_joints_that_sources_publish(fixed):
    robot = ElementTree.fromstring(make_urdf(TrialParams(), fixed))
    links = [link.get('name') for link in robot.findall('link')]
    children = [joint.find('child').get('link') for joint in robot.findall('joint')]
    assert len(set(links)) == len(links)
    assert sorted(children) == sorted(set(links) - {MarkerParams().frame})  # the frame of the markers is the root
    moving = {joint.get('name'): joint for joint in robot.findall('joint') if joint.get('type') != 'fixed'}
    assert set(moving) == {FRONT_WHEEL, REAR_WHEEL} | (set() if fixed else {COUPLER})
    assert {moving[name].get('type') for name in (FRONT_WHEEL, REAR_WHEEL)} == {'continuous'}
    if not fixed:
        limit = moving[COUPLER].find('limit')
        assert float(limit.get('lower')) <= 0.0 < RigParams().resolved().D0 < float(limit.get('upper'))
        assert {'effort', 'velocity'} <= set(limit.keys())
    materials = {material.get('name') for material in robot.findall('material')}
    assert {material.get('name') for material in robot.findall('link/visual/material')} <= materials


def test_command_writes_a_rig_with_joint_names_of_its_own(tmp_path, capsys):
    (tmp_path / 'rig.yaml').write_text(FORM.format('front_joint: hub_a\n    front.length: 0.5'))
    out = tmp_path / 'rig.urdf'
    assert main(['urdf', '--rig', str(tmp_path / 'rig.yaml'), '--out', str(out)]) == 0
    assert capsys.readouterr().out == ''
    robot = ElementTree.parse(out).getroot()
    assert {joint.get('name') for joint in robot.findall('joint')} >= {'hub_a', REAR_WHEEL, COUPLER}
    assert main(['urdf']) == 0
    assert capsys.readouterr().out == make_urdf(TrialParams())


@pytest.mark.parametrize('names', ['front_joint: rear_wheel', "coupler_joint: ''"])
def test_joints_without_names_of_their_own_are_told_in_one_line(tmp_path, capsys, names):
    path = Path(tmp_path) / 'rig.yaml'
    path.write_text(FORM.format(names))
    assert main(['urdf', '--rig', str(path)]) == 2
    assert capsys.readouterr().err.startswith('dcdrw urdf: joints of a URDF need names of their own')


def test_wheels_weigh_what_they_weigh_and_turn_as_heavily():
    rig = RigParams(WheelParams(mass=8.0, gyration=0.5), WheelParams(mass=12.0))
    robot = ElementTree.fromstring(make_urdf(TrialParams.of_rig(rig)).encode())
    for name, mass, axle in (('front_wheel', 8.0, 8.0 * (0.5 * rig.front.length) ** 2), ('rear_wheel', 12.0, 0.0)):
        inertial = robot.find(f"link[@name='{name}']/inertial")
        assert float(inertial.find('mass').get('value')) == mass
        assert float(inertial.find('inertia').get('iyy')) == pytest.approx(axle)

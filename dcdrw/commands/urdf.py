"""`dcdrw urdf`: the rig as a URDF, for robot_state_publisher and what reads its transforms."""

import argparse
import math
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from dcdrw.drawings.rig_markers import MarkerParams
from dcdrw.files import add_force, write_text
from dcdrw.suite.parameter_file import TrialParams, add_rig_options, chosen_params
from dcdrw_msgs_py.rig import FRONT, REAR, WheelParams

LONGEST = 10.0
"""Limit of the coupler's joint, in lengths of a leg; a URDF must name limits, though the rig has none."""

_EPILOG = """\
The joints are those of joint_states: front_wheel and rear_wheel turn about y, positive rolling downhill, and coupler
is the distance of the hubs along the slope. A URDF stands where it stands: it shows how the wheels turn and how far
apart they are, not that they roll; the hubs keep one height. The node rig_markers draws the rig as it moves. The model
is for display, without inertia. Spoke 0, which stands at zero rotation, is black.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Write a URDF with the dimensions of a rig.'
    parser.epilog = _EPILOG
    add_rig_options(parser)
    parser.add_argument('--out', type=Path, metavar='FILE.urdf', help='where to write (default: print)')
    add_force(parser)
    parser.add_argument(
        '--fixed-coupler',
        action='store_true',
        help="hubs at the coupler's rest length, for a source that does not tell its length",
    )


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    text = make_urdf(chosen_params(options), options.fixed_coupler)
    if options.out:
        write_text(options.out, text, options.force)
    else:
        print(text, end='')
    return 0


def make_urdf(params: TrialParams, fixed_coupler: bool = False) -> str:
    """The URDF of a rig: root `rig`, x horizontal and downhill, y left, z up, on the slope below the hubs' middle.

    Raises:
        ValueError: a joint has no name, or two have the same.

    """
    rig, names = params.rig.resolved(), params.phase
    joints = (names.front_joint, names.rear_joint, names.coupler_joint)
    if '' in joints or len(set(joints)) < len(joints):
        raise ValueError(
            f'joints of a URDF need names of their own, got {", ".join(map(repr, joints))} '
            '(front_joint, rear_joint, coupler_joint)'
        )
    size = max(rig.front.length, rig.rear.length)
    robot = Element('robot', name='dcdrw')
    for name, rgba in _MATERIALS.items():
        SubElement(SubElement(robot, 'material', name=name), 'color', rgba=rgba)
    SubElement(robot, 'link', name=MarkerParams().frame)
    ground = SubElement(robot, 'link', name='slope')
    _visual(
        ground, 'ground', ('box', {'size': _numbers(6.0 * size, 0.6 * size, 0.02 * size)}), (0.0, 0.0, -0.01 * size)
    )
    _joint(robot, 'inclination', 'fixed', MarkerParams().frame, 'slope', pitch=rig.slope)
    for hub, radius, sign in (('rear_hub', 0.03 * size, 1.0), ('front_hub', 0.02 * size, -1.0)):
        link, half = SubElement(robot, 'link', name=hub), 0.3 * rig.D0  # a tube, and a rod that slides in it
        _visual(link, 'coupler', _cylinder(2.0 * half, radius), (sign * half, 0.0, 0.0), 0.5 * math.pi)
    _joint(robot, 'rear_mount', 'fixed', 'slope', 'rear_hub', (-0.5 * rig.D0, 0.0, size))
    if fixed_coupler:
        _joint(robot, names.coupler_joint, 'fixed', 'rear_hub', 'front_hub', (rig.D0, 0.0, 0.0))
    else:
        coupler = _joint(robot, names.coupler_joint, 'prismatic', 'rear_hub', 'front_hub', axis=(1.0, 0.0, 0.0))
        SubElement(coupler, 'limit', lower='0', upper=_numbers(LONGEST * size), effort='1e6', velocity='1e3')
    for wheel, shape, joint, side in (
        (FRONT, rig.front, names.front_joint, 0.1 * size),
        (REAR, rig.rear, names.rear_joint, -0.1 * size),
    ):
        link = SubElement(robot, 'link', name=f'{wheel}_wheel')
        _inertial(link, shape)
        _spokes(link, wheel, shape, 0.01 * size)
        _joint(robot, joint, 'continuous', f'{wheel}_hub', f'{wheel}_wheel', (0.0, side, 0.0), axis=(0.0, 1.0, 0.0))
    ElementTree.indent(robot)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(robot, "unicode")}\n'


def _inertial(link: Element, wheel: WheelParams) -> None:
    """Mass and moments about the hub: m (r ℓ)² about the axle and, as of a flat wheel, half of it across."""
    inertial = SubElement(link, 'inertial')
    SubElement(inertial, 'mass', value=_numbers(wheel.mass))
    axle = wheel.mass * (wheel.gyration * wheel.length) ** 2
    SubElement(
        inertial,
        'inertia',
        ixx=_numbers(0.5 * axle),
        iyy=_numbers(axle),
        izz=_numbers(0.5 * axle),
        ixy='0',
        ixz='0',
        iyz='0',
    )


def _spokes(link: Element, wheel: str, shape: WheelParams, radius: float) -> None:
    """Spoke j's tip is at ℓ (−sin 2αj, −cos 2αj) from the hub, in the axes of the slope at zero rotation."""
    for j in range(int(shape.spokes)):
        angle, half = 2.0 * shape.alpha * j, 0.5 * shape.length
        _visual(
            link,
            wheel if j else 'zero',
            _cylinder(shape.length, radius),
            (-half * math.sin(angle), 0.0, -half * math.cos(angle)),
            angle,
        )


def _joint(
    robot: Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    at: tuple[float, float, float] = (0.0, 0.0, 0.0),
    pitch: float = 0.0,
    axis: tuple[float, float, float] | None = None,
) -> Element:
    joint = SubElement(robot, 'joint', name=name, type=kind)
    SubElement(joint, 'origin', xyz=_numbers(*at), rpy=_numbers(0.0, pitch, 0.0))
    SubElement(joint, 'parent', link=parent)
    SubElement(joint, 'child', link=child)
    if axis:
        SubElement(joint, 'axis', xyz=_numbers(*axis))
    return joint


def _cylinder(length: float, radius: float) -> tuple[str, dict[str, str]]:
    return 'cylinder', {'length': _numbers(length), 'radius': _numbers(radius)}


def _visual(
    link: Element,
    material: str,
    geometry: tuple[str, dict[str, str]],
    at: tuple[float, float, float] = (0.0, 0.0, 0.0),
    pitch: float = 0.0,
) -> None:
    visual = SubElement(link, 'visual')
    SubElement(visual, 'origin', xyz=_numbers(*at), rpy=_numbers(0.0, pitch, 0.0))
    shape, attributes = geometry
    SubElement(SubElement(visual, 'geometry'), shape, attributes)
    SubElement(visual, 'material', name=material)


def _numbers(*values: float) -> str:
    return ' '.join(f'{value:.9g}' for value in values)


# As the markers and figures have them.
_MATERIALS = {
    FRONT: '0 0.447 0.698 1',
    REAR: '0.835 0.369 0 1',
    'zero': '0 0 0 1',
    'coupler': '0.6 0.6 0.6 1',
    'ground': '0.467 0.467 0.467 1',
}

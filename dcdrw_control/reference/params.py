"""What the reference of the robot's legs can be told."""

from typing import Annotated, NamedTuple

from dcdrw_control.heartbeat import ENABLE_TIMEOUT, EnableTimeout
from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import REAR, WheelPitch, WheelShape

LEGS, WHEEL = 'legs', 'wheel'


class ReferenceParams(NamedTuple):
    """Whom the robot's legs follow, by which joints, and within which limits."""

    person: Annotated[
        str, Quantity('what tells of the person: leg_phases (legs), or phase_state (wheel)', choices=(LEGS, WHEEL))
    ] = LEGS
    front: WheelPitch = WheelPitch()
    rear: WheelShape = WheelShape()
    table: Annotated[
        str, Quantity('CSV file of the joint angles over a stride [rad]; empty: hip and knee of a recorded person')
    ] = ''
    prefix: Annotated[
        str, Quantity("of the joints' names: prefix, left_ or right_, and the name of the table's column")
    ] = f'{REAR}_'
    standing: Annotated[
        tuple[float, ...], Quantity('joint angles while it stands, in the order of the table; empty: all 0', 'rad')
    ] = ()
    max_speed: Annotated[float, Quantity('of every joint', 'rad/s', above=0.0, high=100.0)] = 10.0
    ramp_strides: Annotated[float, Quantity('from standing to the whole gait, and back', low=0.5, high=20.0)] = 2.0
    approach: Annotated[
        float, Quantity('from wherever the joints are to standing, before the first stride', 's', low=0.1, high=60.0)
    ] = 2.0
    lead: Annotated[
        float,
        Quantity('that a trajectory needs to the joints: its first point lies so far ahead', 's', above=0.0, high=0.5),
    ] = 0.05
    horizon: Annotated[float, Quantity('that a trajectory which is not renewed goes on', 's', low=0.1, high=2.0)] = 0.3
    brake: Annotated[float, Quantity('in which it then comes to rest', 's', low=0.1, high=2.0)] = 0.3
    settling: Annotated[
        float, Quantity('time constant with which the phase follows the person', 's', low=0.05, high=2.0)
    ] = 0.1
    rate: Annotated[float, Quantity('trajectories per second at most', 'Hz', above=0.0, high=50.0)] = 25.0
    enable_timeout: EnableTimeout = ENABLE_TIMEOUT

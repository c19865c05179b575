"""What the leg tracker can be told."""

from typing import Annotated, Literal, NamedTuple

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import FRONT, REAR, WheelPitch
from dcdrw_msgs_py.topics import SIDES

Kind = Literal['imu', 'contact', 'wrench', 'hip']
"""What kind of sensor a leg wears."""
HIPS = tuple(f'{half}_{side}_hip' for half in (FRONT, REAR) for side in SIDES)


class LegParams(NamedTuple):
    """What the leg tracker can be told; all else it learns from the sensors."""

    front: WheelPitch = WheelPitch()
    rear: WheelPitch = WheelPitch()
    silence: Annotated[
        float,
        Quantity(
            'a sensor silent for longer leaves a gap: its leg is unknown until it strikes again',
            's',
            above=0.0,
            high=60.0,
            live=True,
        ),
    ] = 0.2
    rate: Annotated[
        float, Quantity('samples that are published per second at most', 'Hz', above=0.0, high=10_000.0, live=True)
    ] = 250.0
    hip_joints: Annotated[
        tuple[str, ...], Quantity('names of the hips in leg_joint_states: front left and right, rear left and right')
    ] = HIPS
    hip_lead: Annotated[
        float,
        Quantity(
            'how long before the heel strikes a hip is flexed most, share of a stride', low=0.0, high=0.5, live=True
        ),
    ] = 0.0
    max_future: Annotated[
        float, Quantity('a stamp further ahead of the clock is refused', 's', low=0.0, high=60.0, live=True)
    ] = 0.5

    def check_hips(self) -> None:
        """Refuse what names no hips.

        Raises:
            ValueError: there are not four names, each its own.

        """
        if len(set(self.hip_joints)) != len(self.hip_joints) or len(self.hip_joints) != 4:
            raise ValueError(f'hip_joints must be four names, each its own, got {list(self.hip_joints)}')

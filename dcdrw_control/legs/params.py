"""What the leg tracker can be told."""

from typing import Annotated, Literal, NamedTuple, get_args

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import WheelPitch

Kind = Literal['imu', 'contact', 'wrench', 'hip']
"""What kind of sensor a leg wears."""
KINDS: tuple[Kind, ...] = get_args(Kind)


class LegParams(NamedTuple):
    """What the leg tracker can be told; all else it learns from the sensors."""

    front: WheelPitch = WheelPitch()
    rear: WheelPitch = WheelPitch()
    silence: Annotated[
        float,
        Quantity('a sensor silent for longer leaves a gap: its leg is unknown until it strikes again', 's', above=0.0),
    ] = 0.2
    rate: Annotated[float, Quantity('samples that are published per second at most', 'Hz', above=0.0)] = 250.0
    max_future: Annotated[float, Quantity('a stamp further ahead of the clock is refused', 's', low=0.0, live=True)] = (
        0.5
    )

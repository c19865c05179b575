"""Between messages and the reference's samples, by their fields alone."""

import math
from typing import Any

from dcdrw_control.reference.order import FRONT_FEET, REAR_FEET
from dcdrw_control.reference.person import GaitSample
from dcdrw_msgs_py.words import names_and_positions


def leg_sample(stamp_ns: int, message: Any) -> GaitSample | None:
    """The legs in a message of leg_phases; None where a leg of the person is unknown.

    Raises:
        ValueError: positions and names disagree.

    """
    if len(message.position) != len(message.name):
        raise ValueError(names_and_positions(len(message.name), len(message.position), 'leg'))
    phases = {name: angle / math.tau for name, angle in zip(message.name, message.position, strict=True)}
    person, robot = ([phases[foot.leg] for foot in feet if foot.leg in phases] for feet in (FRONT_FEET, REAR_FEET))
    if len(person) < 2:
        return None
    return GaitSample(stamp_ns, (person[0], person[1]), (robot[0], robot[1]) if len(robot) == 2 else None)

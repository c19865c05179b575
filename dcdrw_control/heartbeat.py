"""The heartbeat `enable`: whoever lets the robot move says so again and again; what is expired counts as false."""

import math
from typing import Annotated

from dcdrw_msgs_py.quantity import Quantity

EnableTimeout = Annotated[
    float, Quantity('an enable that is not renewed for this long counts as false', 's', above=0.0, high=1.0)
]
ENABLE_TIMEOUT = 0.15
"""Its default: a heartbeat of 10 Hz may come half a period late [s]."""


class Heartbeat:
    """The last heartbeat. Times are a steady clock's [s]."""

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._at = -math.inf

    def take(self, now: float, on: bool) -> None:
        """Take one; false ends it at once."""
        self._at = now if on else -math.inf

    def lasts(self, now: float) -> bool:
        """Whether it has been renewed in time."""
        return now - self._at <= self._timeout

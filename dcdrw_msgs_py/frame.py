"""A frame: one picture of a camera, with the time at which it was taken."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
"""Grey (height, width) or blue, green, red (height, width, 3)."""


class Frame(NamedTuple):
    """One picture and its stamp."""

    stamp_ns: int
    image: Picture

"""How a sensor is mounted: which axis is the leg's sagittal one, and which way round, learned from the first steps."""

import math

import numpy as np

Vector = tuple[float, float, float]

GROWTH = 1.05
"""The axis is looked for anew when the turning seen has grown by this."""
CLEAR = 4.0
"""How many times the acceleration must jump more, to be certain: in people it is ten to a hundred times."""
MEMORY = 0.25
"""Weight of the last crossing."""
TINY = 1e-12
FORGET = 0.95
"""What a strike leaves of the turning seen before: some twenty strides count."""


class SagittalAxis:
    """The axis about which a segment turns most: people walk by turning their legs in the sagittal plane.

    It is the first principal axis of the angular rate; which of its two directions is forward is not told by it.
    """

    def __init__(self) -> None:
        self._scatter = [0.0] * 6
        self._looked = 0.0
        self.axis: Vector = (0.0, 0.0, 0.0)
        """A unit vector in the sensor's frame; zero before anything has turned."""

    def update(self, rate: Vector, dt: float) -> None:
        """Take an angular rate [rad/s] that held for dt [s]."""
        x, y, z = rate
        products = (x * x, y * y, z * z, x * y, x * z, y * z)
        self._scatter = [seen + dt * product for seen, product in zip(self._scatter, products, strict=True)]
        seen = sum(self._scatter[:3])
        if seen > GROWTH * self._looked:
            self._looked = seen
            self.axis = self._principal()

    def part(self, rate: Vector) -> float:
        """The part of an angular rate about the axis as known now [rad/s]."""
        x, y, z = rate
        u, v, w = self.axis
        return u * x + v * y + w * z

    def _principal(self) -> Vector:
        """The first principal axis, nearer to the one before than to its opposite."""
        xx, yy, zz, xy, xz, yz = self._scatter
        axis = np.linalg.eigh(np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))))[1][:, -1]
        u, v, w = (axis if axis @ np.array(self.axis) >= 0.0 else -axis).tolist()
        return u, v, w

    def forget(self) -> None:
        """A stride is over: what was seen before counts less."""
        self._scatter = [seen * FORGET for seen in self._scatter]
        self._looked *= FORGET


class Direction:
    """Which direction about the axis is the swing: the one that ends with the foot's impact on the ground.

    Each zero crossing of the rate ends a swing or, taken the other way round, a push-off or the slap of the foot. The
    acceleration tells them apart, whatever its unit and however the sensor is turned: it is smooth in swing and jumps
    as the heel meets the ground, while push-off and slap are as rough before the crossing as after it.
    """

    def __init__(self) -> None:
        self._contrasts = {+1: 0.0, -1: 0.0}
        self._seen = {+1: 0, -1: 0}
        self.sign = 0
        """+1 or −1 times the axis turns forward in swing; 0 while that is not known."""

    def learn(self, sign: int, before: float, after: float) -> None:
        """Take the largest jumps of the acceleration before and after a crossing, which is a strike if this sign is."""
        self._seen[sign] += 1
        contrast = math.log(max(after, TINY) / max(before, TINY))
        self._contrasts[sign] += max(MEMORY, 1.0 / self._seen[sign]) * (contrast - self._contrasts[sign])
        difference = self._contrasts[+1] - self._contrasts[-1]
        if abs(difference) > math.log(CLEAR):
            self.sign = 1 if difference > 0.0 else -1

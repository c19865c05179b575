"""How finely a rotation is told: the count of a coarse encoder, learned from how the rotation changes."""

import math

FINEST = 1e-3
"""Rotations that come in smaller counts, or in none, are told finely enough for any band [rad]."""
MANY_UNEVEN = 10
"""So many times must a wheel seem to change its speed, by whole counts, before these are the encoder's."""


class Resolution:
    """The largest angle of which all changes of a rotation are multiples.

    An even motion whose changes are all alike tells nothing of an encoder, however its samples are stamped: they must
    differ, by whole counts.
    """

    def __init__(self) -> None:
        self._count = math.inf
        self._moved = self._rate = math.nan
        self._uneven = 0

    def take(self, moved: float, dt: float) -> None:
        """Take the change of the rotation [rad] over dt seconds."""
        if self.is_fine or abs(moved) > math.pi:  # a rotation that wraps has not turned so far
            return
        if moved:
            self._count = common_divisor(self._count, abs(moved), FINEST)
        if min(abs(moved - self._rate * dt), abs(moved - self._moved)) > 0.5 * self._count:
            self._uneven += 1
        self._moved, self._rate = moved, moved / dt

    @property
    def is_fine(self) -> bool:
        """Whether the rotation is known to come in no count that matters."""
        return self._count < FINEST

    @property
    def count(self) -> float:
        """The count [rad]; 0 where there is none that could be seen, or it is not known yet."""
        return self._count if self._uneven >= MANY_UNEVEN and not self.is_fine else 0.0


def common_divisor(one: float, other: float, least: float) -> float:
    """The largest angle of which both are multiples, to a tenth of the least that is looked for; 0 where it is less.

    Where one of them is infinite, the other one.
    """
    if math.isinf(one):
        return other
    if not one:
        return 0.0
    while other > 0.1 * least:
        one, other = other, abs(math.remainder(one, other))
    return one if one > least else 0.0

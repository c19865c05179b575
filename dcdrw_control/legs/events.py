"""What a sensor on a leg tells: when the foot leaves the ground, and when the heel strikes it."""

from typing import Literal, NamedTuple

LIFT: Literal['lift'] = 'lift'
"""The foot leaves the ground: toe off."""
STRIKE: Literal['strike'] = 'strike'
"""The foot meets the ground: heel strike, or the flat foot's contact where no heel strikes."""

SHORTEST_SWING = 0.15
"""A foot that leaves the ground for less has bounced, or slaps: even a sprinter's swing takes about 0.25 s [s]."""

SHORTEST_STANCE = 0.1
"""A foot that touches the ground for less has scuffed it: even a sprinter's stance takes about as long [s]."""


class Event(NamedTuple):
    """One event of a leg."""

    kind: Literal['lift', 'strike']
    stamp_ns: int
    """Stamp of the event itself, interpolated between samples; it is known a few samples later."""


def crossing_ns(before_ns: int, before: float, after_ns: int, after: float, level: float = 0.0) -> int:
    """When a signal that is on either side of a level at two samples crosses it, by interpolation [ns]."""
    share = (level - before) / (after - before) if after != before else 1.0
    return before_ns + round(min(max(share, 0.0), 1.0) * (after_ns - before_ns))

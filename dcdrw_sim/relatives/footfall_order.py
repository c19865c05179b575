"""The footfalls of a quadruped from two planar wheels: each wheel stands for a left and a right leg in turn.

A step of a wheel is half a stride, and each foot stands for one step. With the phase p by which the front wheel is
ahead, the rear foot falls p/2 of a stride after the front one. A planar model does not tell which rear foot that is;
here the rear right one follows the front left one. That is the lateral sequence: each rear foot falls (1 − p)/2 of a
stride before the front foot of its own side, a quarter at p = 0.5. Feet are numbered as by McGhee and Frank (1968).
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from dcdrw_sim.motion.ends import Strike

FEET = {1: 'front left', 2: 'front right', 3: 'rear left', 4: 'rear right'}
_FRONT, _REAR = (1, 2), (4, 3)
TOGETHER = 1e-6
"""Feet that fall closer together than this fraction of a stride fall as one."""


class Contact(NamedTuple):
    """A foot on the ground."""

    foot: int
    """1 to 4, as in `FEET`."""
    start: float
    """Its fall, in s or strides."""
    end: float
    """Its lift-off, which is the fall of the other foot of the pair."""


def rear_lead(phase: float) -> float:
    """Part of a stride by which a rear foot falls before the front foot of its side: (1 − p)/2."""
    return (1.0 - phase) / 2.0


def steady_contacts(phase: float, strides: int = 1) -> list[Contact]:
    """The contacts of a steady gait in its first strides, by time of fall, in strides; foot 1 falls at 0.

    The first ones began before 0, the last end after the last stride.

    Raises:
        ValueError: a phase out of [0, 1).

    """
    if not 0.0 <= phase < 1.0:
        raise ValueError(f'phase must be in [0, 1), got {phase}')
    return sorted(
        (
            Contact(foot, start, delay + (step + 1) / 2.0)  # to the bit when the other foot falls
            for pair, delay in ((_FRONT, 0.0), (_REAR, phase / 2.0))
            for step in range(-2, 2 * strides)
            for foot, start in ((pair[step % 2], delay + step / 2.0),)
            if start > -0.5
        ),
        key=_fall,
    )


def contacts(strikes: Iterable[Strike], until: float) -> list[Contact]:
    """The contacts in a run, each wheel's from its first strike on, to a time at which the last ones are cut [s].

    The first strike of the front wheel is foot 1, the next of the rear wheel foot 4; then the feet of a pair take
    turns, also where a wheel rocks back. A wheel that slips a step changes the sequence.
    """
    strikes = sorted(strikes, key=lambda strike: (strike.t, strike.wheel))
    front = [strike.t for strike in strikes if strike.wheel == 1]
    rear = [strike.t for strike in strikes if strike.wheel == 2]
    before = sum(t < front[0] for t in rear) if front else 0
    found = []
    for pair, times, shift in ((_FRONT, front, 0), (_REAR, rear, before)):
        for step, (start, end) in enumerate(zip(times, [*times[1:], until], strict=True)):
            found.append(Contact(pair[(step - shift) % 2], start, end))
    return sorted(found, key=_fall)


def order(falls: Sequence[Contact]) -> str:
    """The feet of the last whole stride in the order of their falls, from foot 1 on: 1-4-2-3, say, or 1+4-2+3.

    Empty where there is no whole stride.
    """
    firsts = [i for i, contact in enumerate(falls) if contact.foot == 1]
    for i in reversed(firsts):
        stride = falls[i : i + 4]
        if sorted(contact.foot for contact in stride) == [1, 2, 3, 4]:
            length = 2.0 * (stride[0].end - stride[0].start)
            text = '1'
            for earlier, later in pairwise(stride):
                text += f'{"+" if later.start - earlier.start < TOGETHER * length else "-"}{later.foot}'
            return text
    return ''


def _fall(contact: Contact) -> tuple[float, int]:
    return contact.start, contact.foot

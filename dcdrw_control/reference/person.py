"""The person's legs, as far as the robot's follow them."""

import math
from collections import deque
from typing import NamedTuple

from dcdrw_control.reference.plan import LEADS_BY
from dcdrw_msgs_py.samples import SECOND, PhaseSample

RATE_STRIDES = 0.125
"""Over so much of a stride the pace is taken: longer than what one event moves the phase on, shorter than a step."""
LONGEST_MEMORY = 2.0
"""[s]"""
STANDING_SECONDS = 0.5
"""A person who has hardly moved for so long stands [s]: the longest pause within a stride takes half of that."""
HARDLY = 0.02
"""[strides]"""
IN_TURN = 0.25
"""Legs that are nearer to half a stride apart go on in turn [strides]."""
LEAP = 0.5
"""More than that within one sample is no step, but another source [strides]."""


class GaitSample(NamedTuple):
    """Where the legs are in their strides, left and right: whole at each heel strike, and unbounded."""

    stamp_ns: int
    person: tuple[float, float]
    robot: tuple[float, float] | None = None
    """None where the robot's legs have no sensors, or are unknown."""

    @property
    def strides(self) -> bool:
        """Whether the person's legs go on in turn; else the person turns, or steps on the spot: there is no order."""
        left, right = self.person
        return abs((left - right) % 1.0 - 0.5) < IN_TURN


class WheelGait:
    """Legs from wheels: their strikes are of the left and the right leg in turn."""

    def __init__(self, alpha1: float, alpha2: float) -> None:
        self._alpha1, self._alpha2 = alpha1, alpha2
        self._run: int | None = None
        self._side = 0.0

    def read(self, sample: PhaseSample) -> GaitSample:
        """The legs in a sample; which of the robot's is left is decided by its first one, as near as can be."""
        left = 0.5 * (sample.front_steps + (sample.front.angle + self._alpha1) / (2.0 * self._alpha1))
        rear = 0.5 * (sample.rear_steps + (sample.rear.angle + self._alpha2) / (2.0 * self._alpha2))
        if sample.restarts != self._run:
            self._run = sample.restarts
            self._side = 0.5 * round(2.0 * (left + LEADS_BY - rear))
        return GaitSample(sample.stamp_ns, (left, left - 0.5), (rear + self._side, rear + self._side - 0.5))


class Person:
    """Where the person's legs are, and how fast they go on."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Know nothing."""
        self._samples: deque[GaitSample] = deque()
        self._moved_ns, self._moved_from = 0, 0.0

    @property
    def last(self) -> GaitSample | None:
        """The newest sample."""
        return self._samples[-1] if self._samples else None

    def update(self, sample: GaitSample) -> bool:
        """Take the next sample; whether it goes on from the one before. Where it does not, all begins anew."""
        last = self.last
        goes_on = last is None or (
            sample.stamp_ns > last.stamp_ns
            and all(abs(now - before) < LEAP for now, before in zip(sample.person, last.person, strict=True))
        )
        if not goes_on:
            self.reset()
        samples = self._samples
        if not samples or _middle(sample) - self._moved_from > HARDLY:
            self._moved_ns, self._moved_from = sample.stamp_ns, _middle(sample)
        samples.append(sample)
        while len(samples) > 2 and (
            _middle(sample) - _middle(samples[1]) > RATE_STRIDES
            or sample.stamp_ns - samples[1].stamp_ns > LONGEST_MEMORY * SECOND
        ):
            samples.popleft()
        return goes_on

    @property
    def rate(self) -> float:
        """Strides per second of late; 0 where it is unknown."""
        if len(self._samples) < 2:
            return 0.0
        first, last = self._samples[0], self._samples[-1]
        return max((_middle(last) - _middle(first)) / (last.stamp_ns - first.stamp_ns) * SECOND, 0.0)

    @property
    def walks(self) -> bool:
        """Whether the person walks: moves, and the pace is known."""
        if not self._samples:
            return False
        first, last = self._samples[0], self._samples[-1]
        known = _middle(last) - _middle(first) > 0.5 * RATE_STRIDES
        return known and last.stamp_ns - self._moved_ns < STANDING_SECONDS * SECOND

    def ahead(self, stamp_ns: int) -> tuple[float, float]:
        """Where both legs will be at a time, at the pace of late [strides]; NaN where nothing is known."""
        if self.last is None:
            return math.nan, math.nan
        further = self.rate * (stamp_ns - self.last.stamp_ns) / SECOND
        left, right = self.last.person
        return left + further, right + further


def _middle(sample: GaitSample) -> float:
    return 0.5 * sum(sample.person)

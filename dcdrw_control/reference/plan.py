"""The rolling plan of the robot's legs: their phases, and how far the gait has grown, at even ticks of time.

The ticks lie on one grid for all plans. A plan begins at a tick of the one before it, with what that one has there, so
that positions and speeds never jump from one to the next; and it ends at rest.
"""

import math
from typing import NamedTuple

import numpy as np

from dcdrw_control.reference.joint_table import JointTable
from dcdrw_control.reference.params import ReferenceParams
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.values import Floats

TICK = 0.02
"""From tick to tick [s]: cubic splines between them differ from the table's by less than 1e-3 rad."""
TICK_NS = round(TICK * SECOND)
KEPT = 100
"""Ticks that a plan keeps of what was done."""
LEADS_BY = 0.25
"""The robot's legs are ahead of the person's [strides]."""
SLOWEST_RAMP = 0.5
"""A ramp goes on as if there were so many strides per second, though the person stands."""
WITHIN = 0.98
"""Share of the largest speed that is used: a spline between two ticks goes a little above both."""


class Legs(NamedTuple):
    """The robot's legs at one tick."""

    strides: tuple[float, float]
    """Phase of left and right: whole at each heel strike."""
    rates: tuple[float, float]
    """[strides/s]"""
    ramp: float
    """0 where it stands, 1 in the whole gait."""
    growth: float = 0.0
    """Of the ramp [1/s]."""


class Trajectory(NamedTuple):
    """Joints at times: what joint_trajectory carries."""

    first_ns: int
    """Of the first point; the others follow every TICK_NS."""
    positions: Floats
    """[rad], (N, 2J): the joints of the left leg, then those of the right."""
    speeds: Floats
    """[rad/s]"""


class Plan(NamedTuple):
    """Legs at the ticks from `first` on; the last ones are at rest, and stay so."""

    first: int
    legs: list[Legs]
    start: int
    """The tick from which on it was planned; before that, it keeps what was done."""

    def at(self, tick: int) -> Legs:
        """The legs at a tick, no earlier than the first."""
        return self.legs[min(tick - self.first, len(self.legs) - 1)]

    def goes_on_at(self, tick: int) -> bool:
        """Whether it has not come to rest there."""
        return tick - self.first < len(self.legs)

    @property
    def ahead(self) -> list[Legs]:
        """The legs from `start` on."""
        return self.legs[self.start - self.first :]

    @property
    def stands(self) -> bool:
        """Whether the robot stands from `start` on."""
        return not any(one.ramp for one in self.ahead)

    def renewed(self, later: 'Plan') -> 'Plan':
        """A later plan, that keeps what is done of this one."""
        first = max(self.first, later.start - KEPT)
        return Plan(first, [self.at(tick) for tick in range(first, later.start)] + later.legs, later.start)

    def between(self, stamp_ns: int) -> Legs:
        """The legs at a time, no earlier than the first tick."""
        tick, rest_ns = divmod(stamp_ns, TICK_NS)
        legs, after, share = self.at(tick), self.at(tick + 1), rest_ns / TICK_NS
        rates = [before + share * (later - before) for before, later in zip(legs.rates, after.rates, strict=True)]
        strides = [
            phase + 0.5 * share * TICK * (before + now)
            for phase, before, now in zip(legs.strides, legs.rates, rates, strict=True)
        ]
        return Legs((strides[0], strides[1]), (rates[0], rates[1]), legs.ramp, legs.growth)


class Target(NamedTuple):
    """What the legs follow: a phase at a tick, and its pace."""

    tick: int
    strides: tuple[float, float]
    rate: float

    def at(self, tick: int) -> tuple[float, float]:
        """The phases at a tick."""
        further = self.rate * (tick - self.tick) * TICK
        return self.strides[0] + further, self.strides[1] + further


class Planner:
    """Makes plans, and joints of them."""

    def __init__(self, params: ReferenceParams, table: JointTable) -> None:
        self._params, self._table = params, table
        self.standing = np.array(params.standing or (0.0,) * len(table.names))
        everywhere = np.linspace(0.0, 1.0, 1000)
        swing = float(np.abs(table.slopes(everywhere)).max())
        reach = float(np.abs(table.angles(everywhere) - self.standing).max())
        # |q̇| ≤ A |q'| r + |A'| |q − q0|, with A' at most 1.5 r / ramp_strides
        self.fastest = WITHIN * params.max_speed / (swing + 1.5 * reach / params.ramp_strides)
        """Strides per second at which no joint exceeds its largest speed."""

    def plan(self, first: int, legs: Legs, target: Target, walk: bool) -> Plan:
        """The plan from a tick on.

        Args:
            first: its first tick.
            legs: there.
            target: what to follow.
            walk: whether the gait is to grow, or to end.

        """
        made = [legs]
        for tick in range(first + 1, first + 1 + round(self._params.horizon / TICK)):
            made.append(self._next(made[-1], target, tick, walk))
        end, steps = made[-1], round(self._params.brake / TICK)
        for j in range(1, steps + 1):
            share = j / steps
            pace = 1.0 - share * share * (3.0 - 2.0 * share)
            made.append(_moved(made[-1], (end.rates[0] * pace, end.rates[1] * pace), end.growth * pace))
        return Plan(first, made, first)

    def _next(self, legs: Legs, target: Target, tick: int, walk: bool) -> Legs:
        """The legs a tick later: their phases go to the target's as a critically damped spring does."""
        settling, rates = self._params.settling, []
        for phase, rate, aim in zip(legs.strides, legs.rates, target.at(tick - 1), strict=True):
            error, error_rate = math.remainder(phase - aim, 1.0), rate - target.rate
            rate -= TICK * (2.0 * error_rate / settling + error / settling**2)
            rates.append(min(max(rate, 0.0), self.fastest))
        pace = max(0.5 * sum(rates), min(SLOWEST_RAMP, self.fastest))
        growth = (1.0 if walk else -1.0) * pace / self._params.ramp_strides
        return _moved(legs, (rates[0], rates[1]), growth)

    def joints(self, plan: Plan) -> Trajectory:
        """The joints' positions and speeds at the ticks of a plan."""
        strides, rates = (np.array([one[i] for one in plan.ahead])[:, :, None] for i in (0, 1))
        ramp, growth = (np.array([one[i] for one in plan.ahead])[:, None, None] for i in (2, 3))
        size, size_rate = ramp**2 * (3.0 - 2.0 * ramp), 6.0 * ramp * (1.0 - ramp) * growth
        angles = self._table.angles(strides[:, :, 0]) - self.standing
        positions = self.standing + size * angles
        speeds = size * self._table.slopes(strides[:, :, 0]) * rates + size_rate * angles
        rows = len(positions)
        return Trajectory(plan.start * TICK_NS, positions.reshape(rows, -1), speeds.reshape(rows, -1))


def _moved(legs: Legs, rates: tuple[float, float], growth: float) -> Legs:
    """The legs a tick later, with rates that have changed evenly."""
    left, right = (
        phase + 0.5 * TICK * (before + after)
        for phase, before, after in zip(legs.strides, legs.rates, rates, strict=True)
    )
    ramp = legs.ramp + 0.5 * TICK * (legs.growth + growth)
    if not 0.0 < ramp < 1.0:
        ramp, growth = float(ramp >= 1.0), 0.0
    return Legs((left, right), rates, ramp, growth)


def first_tick(stamp_ns: int) -> int:
    """The first tick that is not before a time."""
    return -(-stamp_ns // TICK_NS)

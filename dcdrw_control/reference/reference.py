"""The reference of the robot's legs: from the person's to trajectories, step by step. Plain data in, plain data out."""

import math
from collections.abc import Iterator
from enum import Enum
from itertools import pairwise
from typing import Any, Literal, NamedTuple, get_args

from dcdrw_control.heartbeat import Heartbeat
from dcdrw_control.reference.joint_table import JointTable
from dcdrw_control.reference.order import FRONT_FEET, REAR_FEET, Crossings, Fall, FootfallOrder, OrderStatus
from dcdrw_control.reference.params import ReferenceParams
from dcdrw_control.reference.person import GaitSample, Person
from dcdrw_control.reference.plan import (
    LEADS_BY,
    TICK_NS,
    Legs,
    Plan,
    Planner,
    Target,
    Trajectory,
    first_tick,
)
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.topics import SIDES

Refusal = Literal['unreadable', 'not finite', 'old', 'future']
"""Why a sample is refused: it makes no sense, a value is no number, or its stamp is far from the clock."""
LONGEST_AGE = 0.25
"""A sample that is older, or as far ahead of the clock, tells nothing of where the person is now [s]."""


class State(str, Enum):
    """What the reference does; the values are what `/diagnostics` carries."""

    OFF = 'off'
    """Not enabled: it publishes no trajectory."""
    WAITING = 'waiting'
    """Enabled, but the person does not walk, or is unknown."""
    STARTING = 'starting'
    """The gait grows."""
    WALKING = 'walking'
    STOPPING = 'stopping'
    """The gait ends: it is enabled no more, the person stands, or was unknown for too long."""


class Update(NamedTuple):
    """What a sample brings."""

    stamp_ns: int
    legs: Legs
    """Where the robot's legs shall be at the sample's time."""
    trajectory: Trajectory | None
    """Renewed; None where it is not due, or the robot stands."""
    falls: tuple[Fall, ...]
    """Footfalls that are now certain to be planned."""


class ReferenceStatus(NamedTuple):
    """A snapshot, for diagnostics."""

    state: State
    order: OrderStatus
    rate: float
    """Of the person [strides/s]."""
    fastest: float
    """That the robot's joints allow [strides/s]."""
    refused: dict[Refusal, int]
    stamp_ns: int
    """Of the newest sample; 0 before the first."""


class LegReference:
    """Follows the person a quarter stride ahead. Times `now` are a steady clock's [s]."""

    def __init__(self, params: ReferenceParams, table: JointTable) -> None:
        """Take parameters and table.

        Raises:
            ValueError: the standing angles are not as many as the table's joints.

        """
        if params.standing and len(params.standing) != len(table.names):
            raise ValueError(
                f'standing must have an angle for each joint of the table ({", ".join(table.names)}), '
                f'got {list(params.standing)}'
            )
        self.joints = [f'{params.prefix}{side}_{name}' for side in SIDES for name in table.names]
        """Their names, in the order of a trajectory's columns."""
        self.order = FootfallOrder()
        self._params = params
        self._planner = Planner(params, table)
        self._heartbeat = Heartbeat(params.enable_timeout)
        self._person = Person()
        self._refused: dict[Refusal, int] = dict.fromkeys(get_args(Refusal), 0)
        self._state = State.OFF
        self._let_go()
        self._forget()

    def enable(self, now: float, on: bool) -> None:
        """Take a heartbeat; false ends it at once."""
        self._heartbeat.take(now, on)

    def refuse(self, why: Refusal) -> None:
        """Count a sample that is of no use; callers report what they cannot even convert (`unreadable`)."""
        self._refused[why] += 1

    def update(self, sample: GaitSample, now: float, now_ns: int) -> Update | None:
        """Take the next sample; None where it is refused.

        Args:
            sample: of the legs.
            now: of a steady clock [s].
            now_ns: of the clock by which samples are stamped.

        """
        if not all(-1e9 < phase < 1e9 for phase in (*sample.person, *(sample.robot or ()))):
            self.refuse('not finite')
            return None
        age = (now_ns - sample.stamp_ns) / SECOND
        if abs(age) > LONGEST_AGE:
            self.refuse('old' if age > 0.0 else 'future')
            return None
        if not self._person.update(sample):
            self._forget()
        planned = self._plan(max(sample.stamp_ns, now_ns), self._heartbeat.lasts(now))
        self._see(sample)
        return Update(sample.stamp_ns, self._legs(sample.stamp_ns), *planned)

    def status(self) -> ReferenceStatus:
        """A snapshot."""
        last = self._person.last
        return ReferenceStatus(
            self._state,
            self.order.status(),
            self._person.rate,
            self._planner.fastest,
            self._refused.copy(),
            last.stamp_ns if last else 0,
        )

    def _let_go(self) -> None:
        """No trajectory is under way: the robot stands, or somebody else has it."""
        self._current: Plan | None = None
        self._due = 0
        self._ready = 0
        self._interrupted = False

    def _forget(self) -> None:
        """Another source, or a new run: what was seen before has nothing to do with it; nor has a stride under way."""
        self._crossings: Any = {foot: Crossings(foot) for foot in (*FRONT_FEET, *REAR_FEET)}
        self._waiting: list[Fall] = []
        self._interrupted = self._current is not None
        self.order.begin()

    def _target(self, tick: int) -> Target:
        left, right = self._person.ahead(tick * TICK_NS)
        return Target(tick, (left + LEADS_BY, right + LEADS_BY), self._person.rate)

    def _plan(self, from_ns: int, enabled: bool) -> tuple[Trajectory | None, tuple[Fall, ...]]:
        """Renew the plan where that is due."""
        start = first_tick(from_ns + round(self._params.lead * SECOND))
        before = self._current
        if before and not before.goes_on_at(start):
            self._interrupted = True
        walk = enabled and self._person.walks and not self._interrupted
        self._state = self._judge(enabled, walk, start)
        if start < self._due or (before is None and not walk):
            return None, ()
        if before and before.stands and not walk:
            self._let_go()
            return None, ()
        if before is None:
            self._ready = start + round(self._params.approach * SECOND / TICK_NS)
        first = max(start, self._ready)
        target = self._target(first)
        if before is None or start <= self._ready:
            self._current = self._planner.plan(first, Legs(target.strides, (target.rate,) * 2, 0.0), target, walk)
            falls: tuple[Fall, ...] = ()
        else:
            falls = tuple(_falls(before, first))
            self._current = before.renewed(self._planner.plan(first, before.at(first), target, walk))
        self._due = start + max(round(SECOND / (self._params.rate * TICK_NS)), 1)
        for fall in falls:
            self.order.plan(fall)
        self._waiting += falls
        return self._planner.joints(self._current), falls

    def _judge(self, enabled: bool, walk: bool, tick: int) -> State:
        if self._current is None and not walk:
            return State.WAITING if enabled else State.OFF
        if not walk:
            return State.STOPPING
        whole = self._current is not None and tick >= self._ready and self._current.at(tick).ramp == 1.0
        return State.WALKING if whole else State.STARTING

    def _see(self, sample: GaitSample) -> None:
        """Judge the footfalls since the last sample, while the robot walks and the person strides."""
        seen = [
            fall
            for foot, phase in zip((*FRONT_FEET, *REAR_FEET), (*sample.person, *(sample.robot or ())), strict=False)
            if (fall := self._crossings[foot].update(sample.stamp_ns, phase))
        ]
        if sample.robot is None:
            seen += [fall for fall in self._waiting if fall.stamp_ns <= sample.stamp_ns]
        self._waiting = [fall for fall in self._waiting if fall.stamp_ns > sample.stamp_ns]
        if self._state is not State.WALKING or not sample.strides:
            self.order.begin()
            return
        for fall in sorted(seen, key=lambda one: one.stamp_ns):
            self.order.see(fall)

    def _legs(self, stamp_ns: int) -> Legs:
        """Where the legs shall be: on the plan, and a quarter stride ahead where there is none yet."""
        plan, tick = self._current, stamp_ns // TICK_NS
        if plan and tick >= plan.first:
            return plan.between(stamp_ns)
        left, right = self._person.ahead(stamp_ns)
        return Legs((left + LEADS_BY, right + LEADS_BY), (self._person.rate,) * 2, 0.0)


def _falls(plan: Plan, until: int) -> Iterator[Fall]:
    """Footfalls of the robot on a plan up to a tick; where it stands, nothing falls."""
    ticks = range(plan.start, until)
    for tick, (legs, after) in zip(
        ticks, pairwise(plan.at(tick) for tick in range(plan.start, until + 1)), strict=True
    ):
        for foot, phase, later in zip(REAR_FEET, legs.strides, after.strides, strict=True):
            whole = math.floor(later)
            if phase < whole <= later and after.ramp:
                yield Fall(foot, round((tick + (whole - phase) / (later - phase)) * TICK_NS))

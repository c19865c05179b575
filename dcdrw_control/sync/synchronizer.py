"""The synchronizer: laws and safety put together. Plain data in, the command out; no clock of its own."""

import math
from typing import Annotated, Literal, NamedTuple, get_args

from dcdrw_control.heartbeat import ENABLE_TIMEOUT, EnableTimeout, Heartbeat
from dcdrw_control.sync.hold import HoldGains, HoldLaw
from dcdrw_control.sync.rear import HubGains, RearLaw
from dcdrw_control.sync.safety import Fault, Limits, Safety, State
from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import StanceDistance, WheelShape
from dcdrw_msgs_py.samples import PhaseSample

LawName = Literal['off', 'hold', 'rear']
LAWS: tuple[LawName, ...] = get_args(LawName)
MOST_STEPS_APART = 1
"""|n| beyond this is a slipped step."""
LONGEST_PAUSE = 2.5
"""A longer time from command to command, in periods, is a pause of this process, and no silence of its input."""


class SynchronizerParams(NamedTuple):
    """The rig as the synchronizer needs it, its law, its limits and its patience."""

    law: Annotated[str, Quantity('what computes the force, or the torque', choices=LAWS)] = 'off'
    hold: HoldGains = HoldGains()
    hub: HubGains = HubGains()
    damping: Annotated[
        float,
        Quantity(
            'damping that the force adds to the coupler, where its own would stall the pair', 'N·s/m', low=0.0, high=1e6
        ),
    ] = 0.0
    front: WheelShape = WheelShape()
    rear: WheelShape = WheelShape()
    S0: StanceDistance = math.nan
    limits: Limits = Limits()
    rate: Annotated[float, Quantity('commands per second', 'Hz', low=50.0, high=2000.0)] = 500.0
    stale_after: Annotated[
        float, Quantity('without a sample for this long the input is stale: a fault', 's', above=0.0, high=0.08)
    ] = 0.055
    enable_timeout: EnableTimeout = ENABLE_TIMEOUT
    stall_after: Annotated[
        float, Quantity('a wheel without a strike for this long has stalled: a fault', 's', above=0.0, high=10.0)
    ] = 2.0

    def check_law(self) -> None:
        """Refuse a law that has no gains.

        Raises:
            ValueError: the parameter is named.

        """
        if self.law == 'hold':
            self.hold.check_sizes()
        elif self.law == 'rear':
            self.hub.check_sizes()


class Command(NamedTuple):
    """What is commanded at one instant."""

    force: float
    """Force of the coupler [N], tension positive."""
    torque: float
    """Torque on the rear hub [N·m], positive where it rolls it downhill."""
    state: State
    stamp_ns: int
    """Stamp of the sample that the command came from; 0 where there was none."""


class Synchronizer:
    """Takes samples and heartbeats as they come, and gives a command whenever it is asked.

    Times `now` are a steady clock's [s].
    """

    _last: PhaseSample | None
    _heard: float
    _silence: float
    _asked: float
    _struck: list[float]

    def __init__(self, params: SynchronizerParams) -> None:
        self.params = params
        self.drives_hub = params.law == 'rear'
        """Whether it commands a torque on the rear hub, in the place of the coupler's force."""
        self.safety = Safety(params.limits, self.drives_hub)
        alphas = params.front.alpha, params.rear.alpha
        self._law = RearLaw(params.hub, *alphas) if self.drives_hub else HoldLaw(params.hold, *alphas)
        self._heartbeat = Heartbeat(params.enable_timeout)
        self._forget()
        self.refused = 0
        """Messages that could not be read, or that had no place."""
        self.work = 0.0
        """Work on the pair so far, ∫ |F Ḋ| dt or ∫ |T θ2′| dt [J]."""

    def configure(self, params: SynchronizerParams) -> None:
        """Take changed limits at once."""
        self.params = params
        self.safety.limits = params.limits

    def enable(self, now: float, on: bool) -> None:
        """Take a heartbeat that came at a time; false ends it at once."""
        self._heartbeat.take(now, on)

    def refuse(self) -> None:
        """A message was not a sample: a wheel is missing, or a value is not a number."""
        self.refused += 1
        self.safety.trip('not finite')

    def conflict(self, fault: Fault) -> None:
        """The node saw what no sample tells: another publisher, or a clock that went back."""
        self.safety.trip(fault)

    def update(self, sample: PhaseSample, now: float) -> None:
        """Take the next sample, which came at a time."""
        values = (*sample.front, *sample.rear)
        if not all(map(math.isfinite, values)):
            self.refuse()
            return
        last = self._last
        if last and sample.restarts != last.restarts:
            self.safety.trip('new run')
            self._forget()
        elif last and sample.stamp_ns < last.stamp_ns:
            self.safety.trip('clock')
            self._forget()
        elif last and sample.stamp_ns == last.stamp_ns:
            self.refused += 1
            return
        if abs(sample.step_difference) > MOST_STEPS_APART:
            self.safety.trip('slipped')
        for i, (turn, wheel) in enumerate(((sample.front, self.params.front), (sample.rear, self.params.rear))):
            before = (last.front, last.rear)[i] if last else turn
            if abs(turn.angle - before.angle) > wheel.alpha:
                if not self._walks:
                    self._struck = [now, now]
                self._struck[i] = now
        if self.params.law != 'off':
            self._law.update(sample)
        self._last, self._heard, self._silence = sample, now, 0.0

    def command(self, now: float) -> Command:
        """The command at a time.

        A silent input takes the force away at once, and is a fault where commands were asked for meanwhile: a process
        that could not run for a while, or a machine that paused, has yet to hear what was said.
        """
        is_stale = now - self._heard > self.params.stale_after
        asked_ago = now - self._asked if math.isfinite(self._asked) else 0.0
        self._silence += min(asked_ago, LONGEST_PAUSE / self.params.rate)
        if self._silence > self.params.stale_after:
            self.safety.trip('stale')
        has_stalled = self._walks and not is_stale and now - min(self._struck) > self.params.stall_after
        if has_stalled:
            self.safety.trip('stalled')
        wanted = self._law.wanted(now)
        ready = (
            self.params.law != 'off'
            and self._walks  # wheels that are held are not pushed
            and not is_stale
            and not has_stalled
            and math.isfinite(wanted)
            and self._last is not None
            and abs(self._last.step_difference) <= MOST_STEPS_APART
        )
        state = self.safety.update(now, self._heartbeat.lasts(now), ready)
        if self.drives_hub:
            rate = self._last.rear.rate if self._last else math.nan
        else:
            rate = self._coupler_rate()
            wanted += self.params.damping * rate if self.params.damping else 0.0
        effort = self.safety.let_go(now) if is_stale else self.safety.command(now, wanted, rate)
        self._law.act(now, effort)
        if math.isfinite(self._asked) and math.isfinite(rate):
            self.work += abs(effort * rate) * (now - self._asked)
        self._asked = now
        force, torque = (0.0, effort) if self.drives_hub else (effort, 0.0)
        return Command(force, torque, state, self._last.stamp_ns if self._last else 0)

    @property
    def _walks(self) -> bool:
        """Whether a wheel has struck since the input began."""
        return math.isfinite(min(self._struck))

    def _forget(self) -> None:
        """Know nothing of the input any more."""
        self._last = None
        self._heard = -math.inf
        self._silence = math.inf
        self._asked = math.nan
        self._struck = [-math.inf, -math.inf]
        self._law.reset()

    def _coupler_rate(self) -> float:
        """Ḋ [m/s] from stance angles and speeds; NaN where it is unknown (contract §1)."""
        if self._last is None:
            return math.nan
        (theta1, omega1), (theta2, omega2) = self._last.front, self._last.rear
        front, rear = self.params.front, self.params.rear
        S0 = front.length if math.isnan(self.params.S0) else self.params.S0
        S = S0 + (front.step_length if theta1 < theta2 else 0.0)  # the front wheel has struck since the rear one
        x = front.length * math.sin(theta1) - rear.length * math.sin(theta2) + S
        y = front.length * math.cos(theta1) - rear.length * math.cos(theta2)
        x_rate = front.length * math.cos(theta1) * omega1 - rear.length * math.cos(theta2) * omega2
        y_rate = rear.length * math.sin(theta2) * omega2 - front.length * math.sin(theta1) * omega1
        return (x * x_rate + y * y_rate) / max(math.hypot(x, y), 1e-9)

"""Safety: when the synchronizer may push, how hard, and how it stops.

    disabled ──enable──▶ armed ──ready──▶ active ──enable ends, stop──▶ ramp_down ──▶ disabled
                                             └──────────any fault─────────▶ fault ──reset_fault──▶ disabled

A force leaves only in `active`; in `ramp_down` it goes to zero within RAMP_SECONDS; in every other state it is zero. A
fault is latched. After a stop, and after a fault was reset, `enable` must be released before it counts again, so that
nothing starts by itself.
"""

import math
from enum import Enum
from typing import Annotated, Literal, NamedTuple

from dcdrw_msgs_py.quantity import Quantity

RAMP_SECONDS = 0.05
"""Time of the ramp from the largest force to none [s]: with the period of the commands, well within 100 ms."""

Fault = Literal['stale', 'not finite', 'new run', 'stalled', 'slipped', 'second publisher', 'clock']
"""Why a synchronizer stops: no sample for too long, a value that is not a number, a source that started anew, a wheel
that does not strike any more, |n| beyond 1, somebody else who commands as well, or a clock that went back."""


class State(Enum):
    """What the synchronizer does; the values are what `synchronizer_state` carries."""

    DISABLED = 'disabled'
    ARMED = 'armed'
    ACTIVE = 'active'
    RAMP_DOWN = 'ramp_down'
    FAULT = 'fault'


class Limits(NamedTuple):
    """What no command ever exceeds."""

    max_force: Annotated[float, Quantity('largest force', 'N', above=0.0, high=1e4, live=True)] = 20.0
    max_torque: Annotated[float, Quantity('largest torque on the rear hub', 'N·m', above=0.0, high=1e4, live=True)] = (
        20.0
    )
    max_slew: Annotated[
        float, Quantity('fastest change of force or torque', 'N/s or N·m/s', above=0.0, high=1e6, live=True)
    ] = 2000.0
    max_power: Annotated[
        float,
        Quantity(
            'largest power into or out of the coupler, |F Ḋ|, or the rear hub', 'W', above=0.0, high=1e4, live=True
        ),
    ] = 20.0


class Safety:
    """The state, and the force that may be commanded in it. Time is a steady clock's [s].

    Where the rear hub is driven, force is to be read as torque, N as N·m, and m/s as rad/s.
    """

    def __init__(self, limits: Limits, drives_hub: bool = False) -> None:
        self.limits = limits
        self._drives_hub = drives_hub
        self.state = State.DISABLED
        self.reason: Fault | None = None
        """Why the state is `fault`; None where it is not."""
        self.force = 0.0
        """What is commanded now [N]."""
        self._locked = False
        self._now = -math.inf

    def stop(self) -> None:
        """Let go of the pair now; `enable` must be released before it counts again."""
        self._locked = True
        self._leave()

    def trip(self, fault: Fault) -> None:
        """Stop for a fault, wherever something could move; without force and enable there is nothing to latch."""
        if self.state in (State.ACTIVE, State.RAMP_DOWN):
            self.state, self.reason, self.force, self._locked = State.FAULT, fault, 0.0, True

    def reset_fault(self) -> bool:
        """Forget a fault; whether there was one. A heartbeat that has come back meanwhile does not count yet."""
        if self.state is not State.FAULT:
            return False
        self.state, self.reason, self._locked = State.DISABLED, None, True
        return True

    def update(self, now: float, enabled: bool, ready: bool) -> State:
        """Go on to a time.

        Args:
            now: of a steady clock [s].
            enabled: whether a fresh heartbeat says so.
            ready: whether the input is fresh and sound, and the law has something to say.

        """
        if not enabled:
            self._locked = False
            self._leave()
        elif self.state is State.DISABLED and not self._locked:
            self.state = State.ARMED
        if self.state is State.ARMED and ready:
            self.state = State.ACTIVE
        if self.state is State.RAMP_DOWN and self.force == 0.0:
            self.state = State.DISABLED
        return self.state

    def command(self, now: float, wanted: float, rate: float) -> float:
        """The force that may be commanded at a time, towards the one that is wanted [N].

        Args:
            now: of a steady clock [s]; where it goes back, nothing is allowed to change.
            wanted: by the law [N]; what is not a number counts as none.
            rate: Ḋ of the coupler [m/s]; NaN where it is unknown, and power then is not limited.

        """
        elapsed = min(max(now - self._now, 0.0), 1.0) if math.isfinite(self._now) else 0.0
        self._now = max(now, self._now)
        full = most = self.limits.max_torque if self._drives_hub else self.limits.max_force
        slew = self.limits.max_slew
        if rate:  # NaN fails the comparison below
            power = self.limits.max_power / abs(rate)
            most = power if power < full else full
        if self.state is State.ACTIVE and math.isfinite(wanted):
            goal = max(-most, min(most, wanted))
            self.force += max(-slew * elapsed, min(slew * elapsed, goal - self.force))
        elif self.state in (State.ACTIVE, State.RAMP_DOWN):
            self.force = math.copysign(max(abs(self.force) - full / RAMP_SECONDS * elapsed, 0.0), self.force)
        else:
            self.force = 0.0
        self.force = max(-most, min(most, self.force))
        return self.force

    def let_go(self, now: float) -> float:
        """No force at a time [s] of a steady clock, whatever the state, and none is left to ramp down."""
        self._now, self.force = max(now, self._now), 0.0
        if self.state is State.RAMP_DOWN:
            self.state = State.DISABLED
        return self.force

    def _leave(self) -> None:
        if self.state is State.ACTIVE:
            self.state = State.RAMP_DOWN
        elif self.state is State.ARMED:
            self.state = State.DISABLED

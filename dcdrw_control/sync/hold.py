"""The law `hold`: a force that is set at every strike of the front wheel, and held until the next.

A rig that is not quite the one that the gains were computed for walks in step at another θ2, where its phase swings as
far to either side of 50 %. The aim follows it there: by half of what the last step's swing was off its middle, once
that swing is no transient any more. And a pair that is in step is left where it is, but for that.
"""

import math
from typing import Annotated, NamedTuple

from dcdrw_msgs_py.in_step import BAND_PERCENT
from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.samples import PhaseSample

SHARE = 0.5
"""Of a step's swing off its middle, so much is taken into the aim: all of it would overdo it in the next step."""
IN_STEP = 0.9 * BAND_PERCENT / 100.0
"""A pair whose error has not left this within a step is in step [steps]."""
NEAR = 2.0 * BAND_PERCENT / 100.0
"""A swing within this, and off its middle by less than half of it, tells of the rig; any other of the start [steps]."""
WHOLE = 0.9
"""So much of a step must have been seen for its swing to count."""


class HoldGains(NamedTuple):
    """u = force − gain · (x − state) − gain_before (u_before − force), as `dcdrw control` computes it for a rig.

    x is [θ1′, θ2, θ2′] at the instant before a strike of the front wheel.
    """

    state: Annotated[
        tuple[float, ...], Quantity('what is aimed at: θ1′ [rad/s], θ2 [rad] and θ2′ [rad/s] at the strike')
    ] = ()
    gain: Annotated[tuple[float, ...], Quantity('by θ1′ [N·s/rad], θ2 [N/rad] and θ2′ [N·s/rad]')] = ()
    force: Annotated[float, Quantity('that keeps the pair at its aim', 'N')] = 0.0
    gain_before: Annotated[float, Quantity('by the force that was held before: what a delay asks for')] = 0.0
    middle: Annotated[float, Quantity('of the swing of p − 0.5 within a step, at the aim', 'steps')] = 0.0

    def check_sizes(self) -> None:
        """Refuse gains that nobody computed.

        Raises:
            ValueError: state and gain are not three numbers each.

        """
        if len(self.state) != 3 or len(self.gain) != 3:
            raise ValueError(
                f'hold.state and hold.gain must be three numbers each, got {list(self.state)} and {list(self.gain)}: '
                'let `dcdrw control --rig RIG.yaml --out gains.yaml` compute them, and give --params-file gains.yaml'
            )


class HoldLaw:
    """Turns phase samples into a force, which only strikes of the front wheel change."""

    _last: PhaseSample | None
    _low: float
    _high: float
    force: float
    """Wanted now [N]; NaN before the first strike."""

    def __init__(self, gains: HoldGains, alpha1: float, alpha2: float) -> None:
        self._gains, self._alpha1, self._alpha2 = gains, alpha1, alpha2
        self.reset()

    def reset(self) -> None:
        """Forget what was."""
        self._last, self.force = None, math.nan
        self._shift = 0.0
        """Of the aim [rad]."""
        self._begin(math.nan)

    def update(self, sample: PhaseSample) -> float:
        """Take the next sample, with rates, and return the wanted force [N]."""
        last, self._last = self._last, sample
        theta1, theta2 = sample.front.angle, sample.rear.angle
        if last is None:
            self._begin(theta1)
        elif theta1 < last.front.angle - self._alpha1:  # it stands on the next spoke
            self.force = self._answer(last)
            self._begin(theta1)
        error = math.remainder(theta1 / (2.0 * self._alpha1) - theta2 / (2.0 * self._alpha2) - 0.5, 1.0)
        self._low, self._high = min(self._low, error), max(self._high, error)
        return self.force

    def wanted(self, now: float) -> float:
        """The force [N] to be commanded at a time; NaN before the first strike."""
        return self.force

    def act(self, now: float, force: float) -> None:
        """Note what was commanded: nothing here depends on it."""

    def _begin(self, theta1: float) -> None:
        """Begin to watch a step, at a stance angle of the front wheel."""
        self._from = theta1
        self._low, self._high = math.inf, -math.inf

    def _answer(self, last: PhaseSample) -> float:
        """The force that answers the strike after a sample."""
        omega1, omega2 = last.front.rate, last.rear.rate
        until = (self._alpha1 - last.front.angle) / omega1 if omega1 > 0.0 else 0.0
        aim1, aim2, aim_rate2 = self._gains.state
        theta2 = math.remainder(last.rear.angle + omega2 * until - aim2, 2.0 * self._alpha2)
        off, widest = 0.5 * (self._low + self._high) - self._gains.middle, max(-self._low, self._high)
        is_whole = last.front.angle - self._from > WHOLE * 2.0 * self._alpha1
        if is_whole and widest < IN_STEP:
            self._shift = theta2
            omega1, omega2 = aim1, aim_rate2
        if is_whole and widest < NEAR and abs(off) < 0.5 * NEAR:
            self._shift += SHARE * off * 2.0 * self._alpha2
        theta2 -= self._shift
        gain1, gain2, gain3 = self._gains.gain
        before = self.force - self._gains.force if math.isfinite(self.force) else 0.0
        return (
            self._gains.force
            - (gain1 * (omega1 - aim1) + gain2 * theta2 + gain3 * (omega2 - aim_rate2))
            - self._gains.gain_before * before
        )

"""The law `hold`: a force that is set at every strike of the front wheel, and held until the next."""

import math
from typing import Annotated, NamedTuple

from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.samples import PhaseSample


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
    force: float
    """Wanted now [N]; NaN before the first strike."""

    def __init__(self, gains: HoldGains, alpha1: float, alpha2: float) -> None:
        self._gains, self._alpha1, self._alpha2 = gains, alpha1, alpha2
        self.reset()

    def reset(self) -> None:
        """Forget what was."""
        self._last, self.force = None, math.nan

    def update(self, sample: PhaseSample) -> float:
        """Take the next sample, with rates, and return the wanted force [N]."""
        last, self._last = self._last, sample
        if last and sample.front.angle < last.front.angle - self._alpha1:  # it stands on the next spoke
            self.force = self._answer(last)
        return self.force

    def wanted(self, now: float) -> float:
        """The force [N] to be commanded at a time; NaN before the first strike."""
        return self.force

    def act(self, now: float, force: float) -> None:
        """Note what was commanded: nothing here depends on it."""

    def _answer(self, last: PhaseSample) -> float:
        """The force that answers the strike after a sample."""
        omega1, omega2 = last.front.rate, last.rear.rate
        until = (self._alpha1 - last.front.angle) / omega1 if omega1 > 0.0 else 0.0
        aim1, aim2, aim_rate2 = self._gains.state
        theta2 = math.remainder(last.rear.angle + omega2 * until - aim2, 2.0 * self._alpha2)
        gain1, gain2, gain3 = self._gains.gain
        before = self.force - self._gains.force if math.isfinite(self.force) else 0.0
        return (
            self._gains.force
            - (gain1 * (omega1 - aim1) + gain2 * theta2 + gain3 * (omega2 - aim_rate2))
            - self._gains.gain_before * before
        )

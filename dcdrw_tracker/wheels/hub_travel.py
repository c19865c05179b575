"""How far a hub travels as its wheel rolls: what tells, after an occlusion, how often the wheel has turned."""

from dcdrw_msgs_py.rig import WheelShape
from dcdrw_msgs_py.rolling import hub_travel

MEMORY = 60
"""Views over which the mean place is taken."""


class HubTravel:
    """Learns where a hub is at ψ = 0, so that its place tells ψ to well within half a turn."""

    def __init__(self, shape: WheelShape) -> None:
        self._shape = shape
        self._count = 0
        self._start = 0.0
        self.steady = True
        """The hub travels as the wheel rolls, within a step: else the camera moves, or slope or length are wrong."""

    def learn(self, place: float, psi: float) -> None:
        """Take a hub's place [m] at a known ψ [rad]."""
        self._count = min(self._count + 1, MEMORY)
        error = place - hub_travel(self._shape, psi) - self._start
        self._start += error / self._count
        self.steady = self._count == 1 or abs(error) < self._shape.step_length

    def psi(self, place: float) -> float | None:
        """About ψ where the hub is at a place; None where that is not known."""
        if not (self._count and self.steady):
            return None
        return (place - self._start) / self._shape.step_length * 2.0 * self._shape.alpha

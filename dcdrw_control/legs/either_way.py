"""A rate whose sign is not known yet: swings are looked for both ways, and told once it is."""

from dcdrw_control.legs.events import Event
from dcdrw_control.legs.swing import SwingDetector
from dcdrw_msgs_py.samples import SECOND

BACKLOG_NS = 5 * SECOND
"""Events of the first strides, which are told once the sign is known, reach back so far."""


class EitherWay:
    """Two detectors of swings: one takes the rate as it is, the other with its sign turned round."""

    def __init__(self) -> None:
        self.detectors = {+1: SwingDetector(), -1: SwingDetector()}
        self._untold: dict[int, list[Event]] = {+1: [], -1: []}

    def reset(self) -> None:
        """Go on after samples are missing."""
        self._untold = {+1: [], -1: []}
        for detector in self.detectors.values():
            detector.reset()

    def update(self, stamp_ns: int, rate: float) -> dict[int, list[Event]]:
        """Take the next sample [ns, rad/s]; the events that it makes certain for either sign."""
        found = {sign: detector.update(stamp_ns, sign * rate) for sign, detector in self.detectors.items()}
        for sign, events in found.items():
            if events:
                recent = [event for event in self._untold[sign] if stamp_ns - event.stamp_ns <= BACKLOG_NS]
                self._untold[sign] = recent + events
        return found

    def tell(self, sign: int) -> list[Event]:
        """The events of the sign that has turned out to be right, each once; none while it is 0."""
        events = self._untold.get(sign, [])
        if events:
            self._untold = {+1: [], -1: []}
        return events

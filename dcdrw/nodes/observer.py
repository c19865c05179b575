"""The listener of a trial: what the nodes publish, as far as a person wants to see it live. The recorder keeps it."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from rclpy.node import Node
from std_msgs.msg import Bool

from dcdrw.suite.executables import SYNC_MONITOR
from dcdrw_msgs_py.diagnosis import Diagnosis, PairState
from dcdrw_msgs_py.messages import PhaseSampleReader, diagnoses, footfall
from dcdrw_msgs_py.node import Age, advertise, listen, steady_clock
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import PhaseSample
from dcdrw_msgs_py.topics import DIAGNOSTICS, ENABLE, FOOTFALLS, PHASE_STATE, SYNC_ERROR
from dcdrw_tracker.gait.rest import moves
from dcdrw_tracker.gait.sync import SyncMonitor, SyncParams

HEARTBEAT_SECONDS = 0.04
"""Period of the heartbeat on `enable` [s]."""


class Observer(Node):
    """Hears what a trial comes to."""

    def __init__(self, params: SyncParams, **kwargs: Any) -> None:
        super().__init__('trial', **kwargs)
        self.monitor = SyncMonitor(params)
        """Sees the wheels from the last sample before they move."""
        self.heard: set[str] = set()
        """Topics of which a message has come."""
        self.strikes = {FRONT: 0, REAR: 0}
        self.moving = False
        """The wheels have been let go."""
        self.diagnoses: dict[str, Diagnosis] = {}
        """What each node said of itself last."""
        self.age = Age()
        self._first: PhaseSample | None = None
        self._last: PhaseSample | None = None
        self._reader = PhaseSampleReader()
        for topic, callback in (
            (PHASE_STATE, self._on_phase),
            (SYNC_ERROR, self._on_error),
            (FOOTFALLS[FRONT], lambda message: self._on_footfall(message, FRONT)),
            (FOOTFALLS[REAR], lambda message: self._on_footfall(message, REAR)),
            (DIAGNOSTICS, self._on_diagnostics),
        ):
            listen(self, topic, self._bearing(topic.name, callback))

    @property
    def state(self) -> PairState | None:
        """What the pair does, by the monitor's word; None before its first."""
        said = self.diagnoses.get(SYNC_MONITOR.name)
        return said.state(PairState) if said else None

    @property
    def seconds(self) -> float:
        """How long the wheels have been moving, by the stamps [s]."""
        if not (self.moving and self._first and self._last):
            return 0.0
        return (self._last.stamp_ns - self._first.stamp_ns) * 1e-9

    def _bearing(self, name: str, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """A callback that passes over what it cannot read: on a shared domain others may publish, too."""

        def bear(message: Any) -> None:
            with suppress(ValueError):
                callback(message)
                self.heard.add(name)

        return bear

    def _on_phase(self, message: Any) -> None:
        phase = self._reader.read(message)
        self.age.renew()
        if not self.moving:
            self.moving = moves(phase)
            if self.moving:
                self._first = self._last or phase
                self.monitor.update(self._first)
        if self.moving:
            self.monitor.update(phase)
        self._last = phase

    def _on_error(self, message: Any) -> None:
        """That it comes is all."""

    def _on_footfall(self, message: Any, wheel: str) -> None:
        if self.moving:
            self.strikes[footfall(message, wheel).wheel] += 1

    def enable_when_moving(self) -> None:
        """Enable the synchronizer from when the wheels have been let go, by a heartbeat."""
        publisher = advertise(self, ENABLE)
        self.create_timer(HEARTBEAT_SECONDS, lambda: publisher.publish(Bool(data=self.moving)), clock=steady_clock())

    def _on_diagnostics(self, message: Any) -> None:
        self.diagnoses |= diagnoses(message)

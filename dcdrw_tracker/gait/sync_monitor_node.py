"""The node `sync_monitor`: phase in; synchronization error, verdict and diagnosis out."""

import sys
from typing import Any

from rclpy.node import Node
from std_msgs.msg import Bool

from dcdrw_msgs_py.diagnosis import REFUSED, Diagnosis, Level, PairState, contested
from dcdrw_msgs_py.messages import PhaseSampleReader, turns_message
from dcdrw_msgs_py.node import Age, Parameters, advertise, listen, publish_diagnosis, publishers, run, steady_clock
from dcdrw_msgs_py.samples import PhaseSample, Turn
from dcdrw_msgs_py.topics import (
    JOINT_STATES,
    PHASE_JOINT,
    PHASE_STATE,
    SYNC_ERROR,
    SYNC_ERROR_JOINT,
    SYNC_ERROR_PERCENT,
    SYNC_STATE,
    SYNCHRONIZED,
)
from dcdrw_msgs_py.wire import float_bytes
from dcdrw_tracker.gait.diagnostics import diagnose_sync
from dcdrw_tracker.gait.pair_state import judge
from dcdrw_tracker.gait.sync import SyncMonitor, SyncParams

WATCH_SECONDS = 0.1
"""How often the age of the input and the state of the pair are looked at."""


class SyncMonitorNode(Node):
    """Converts messages for the `SyncMonitor`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('sync_monitor', **kwargs)
        self._settings = Parameters(self, SyncParams, lambda params: self._monitor.configure(params))
        self._monitor = SyncMonitor(self._settings.value)
        self._reader = PhaseSampleReader()
        self._error = advertise(self, SYNC_ERROR)
        self._error_percent = advertise(self, SYNC_ERROR_PERCENT)
        self._synchronized = advertise(self, SYNCHRONIZED)
        self._sync_state = advertise(self, SYNC_STATE)
        self._pitch = self._settings.value.front.alpha + self._settings.value.rear.alpha
        self._unreadable, self._sources = 0, 1
        self._age = Age()
        self._verdict: bool | None = None
        self._state: PairState | None = None
        self._tell(False)
        self._report = publish_diagnosis(self, self._diagnose)
        self.create_timer(WATCH_SECONDS, self._watch, clock=steady_clock())
        listen(self, PHASE_STATE, self._on_message, take_sample=self._on_phase, misses_nothing=True)

    def _on_message(self, message: Any) -> None:
        try:
            phase = self._reader.read(message)
        except ValueError as error:
            self._unreadable += 1
            self.get_logger().warning(f'phase_state: {error}', throttle_duration_sec=1.0)
            return
        self._on_phase(phase)

    def _on_phase(self, phase: PhaseSample) -> None:
        sync = self._monitor.update(phase)
        if sync is None:
            self._unreadable += 1
            return
        self._age.renew()
        self._sources = phase.sources
        if self._sync_state.is_heard:
            p_rate = phase.phi.rate / self._pitch
            turns = {
                PHASE_JOINT: Turn(0.5 + 0.01 * sync.error_percent, p_rate),
                SYNC_ERROR_JOINT: Turn(sync.error, phase.phi.rate),
            }
            self._sync_state.publish(turns_message(sync.stamp_ns, turns))
        self._error.publish_sample(sync.error, float_bytes)
        self._error_percent.publish_sample(sync.error_percent, float_bytes)
        self._tell(sync.synchronized)

    def _watch(self) -> None:
        """Nobody knows whether a pair that is not seen is still in step. A change of the state is told at once."""
        fresh = self._age.seconds <= self._settings.value.stale_after
        if self._verdict and not fresh:
            self._tell(False)
        state = judge(self._monitor.status(), fresh)
        if state != self._state:
            self._state = state
            self._report()

    def say_last_words(self) -> None:
        """A monitor that has ended vouches for nothing."""
        self._tell(False)

    def _tell(self, synchronized: bool) -> None:
        if synchronized != self._verdict:
            self._verdict = synchronized
            self._synchronized.publish(Bool(data=synchronized))
            self.get_logger().info(self._diagnose().message)

    def _diagnose(self) -> Diagnosis:
        diagnosis = diagnose_sync(self._monitor.status(), self._age.seconds, self._settings.value.stale_after)
        diagnosis = diagnosis._replace(values={**diagnosis.values, REFUSED: self._unreadable})
        if self._sources > 1 and diagnosis.level != Level.STALE:  # by the word of the estimator, who knows the joints
            nodes = publishers(self, JOINT_STATES)  # unless the estimator's topic was remapped
            nodes = nodes if len(nodes) > 1 else ['see phase_estimator'] * self._sources
            return contested(diagnosis, JOINT_STATES.name, nodes)
        return contested(diagnosis, PHASE_STATE.name, publishers(self, PHASE_STATE))


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run('sync_monitor', SyncMonitorNode, args)


if __name__ == '__main__':
    sys.exit(main())

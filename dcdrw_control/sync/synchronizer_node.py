"""The node `synchronizer`: phase in; a bounded force or torque out, while somebody enables it."""

import math
import sys
import time
from typing import Any

from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

from dcdrw_control.sync.diagnosis import diagnose_synchronizer
from dcdrw_control.sync.safety import State
from dcdrw_control.sync.synchronizer import Command, Synchronizer, SynchronizerParams
from dcdrw_msgs_py.diagnosis import Diagnosis
from dcdrw_msgs_py.messages import PhaseSampleReader
from dcdrw_msgs_py.node import Parameters, advertise, clock_ns, listen_aged, publish_diagnosis, run, steady_clock
from dcdrw_msgs_py.samples import PhaseSample
from dcdrw_msgs_py.topics import (
    COUPLER_FORCE_COMMAND,
    COUPLER_WRENCH,
    ENABLE,
    PHASE_STATE,
    REAR_TORQUE_COMMAND,
    SYNCHRONIZER_STATE,
)
from dcdrw_msgs_py.wire import float_bytes, wrench_bytes

SOON = 0.85
"""A sample that comes after so much of the time from command to command is answered at once: less latency, and one
waking up less."""
LATE = 1.25
"""So much of that time after an answer, at least, the timer waits: the next sample comes first, unless it is late."""
WATCH_SECONDS = 0.1
"""How often other publishers and the clock are looked at [s]."""
REPEAT_SECONDS = 1.0
"""The state is told again after so long: of a message that was lost DDS knows only when the next one comes."""


class SynchronizerNode(Node):
    """Converts messages for the `Synchronizer`, and asks it for a command at a fixed rate."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('synchronizer', **kwargs)
        settings = Parameters(self, SynchronizerParams, self._configure, SynchronizerParams.check_law)
        self._core = Synchronizer(settings.value)
        self._reader = PhaseSampleReader()
        self._told: State | None = None
        self._command = Command(0.0, 0.0, State.DISABLED, 0)
        self._last_clock = 0
        self._period, self._due = 1.0 / settings.value.rate, 0.0
        self._effort = advertise(self, REAR_TORQUE_COMMAND if self._core.drives_hub else COUPLER_FORCE_COMMAND)
        self._wrench = advertise(self, COUPLER_WRENCH)
        self._state = advertise(self, SYNCHRONIZER_STATE)
        self.create_service(Trigger, '~/stop', self._on_stop)
        self.create_service(Trigger, '~/reset_fault', self._on_reset_fault)
        listen_aged(self, ENABLE, lambda message, age: self._core.enable(time.monotonic() - age, message.data))
        listen_aged(self, PHASE_STATE, self._on_message, take_sample=self._on_phase)
        publish_diagnosis(self, self._diagnose)
        self._timer = self.create_timer(self._period, self._tick, clock=steady_clock())
        self.create_timer(WATCH_SECONDS, self._watch, clock=steady_clock())
        self.create_timer(REPEAT_SECONDS, self._tell_state, clock=steady_clock())
        self._tick()

    def say_last_words(self) -> None:
        """Leave no force behind."""
        self._core.safety.stop()
        self._publish(Command(0.0, 0.0, State.DISABLED, self._command.stamp_ns))

    def _configure(self, params: SynchronizerParams) -> None:
        self._core.configure(params)

    def _on_message(self, message: Any, age: float) -> None:
        try:
            sample = self._reader.read(message)
        except ValueError as error:
            self._core.refuse()
            self.get_logger().warning(f'phase_state: {error}', throttle_duration_sec=1.0)
            return
        self._on_phase(sample, age)

    def _on_phase(self, sample: PhaseSample, age: float = 0.0) -> None:
        now = time.monotonic()
        self._core.update(sample, now - age)
        if now >= self._due and age < self._period:  # an older one is of many that wait: read these first
            if self._timer.time_until_next_call() < LATE * self._period * 1e9:
                self._timer.handle.call_timer()  # a period later; to reset it would end the executor's next wait
            self._tick()

    def _tick(self) -> None:
        now = time.monotonic()
        self._due = now + SOON * self._period
        self._publish(self._core.command(now))

    def _publish(self, command: Command) -> None:
        self._command = command
        self._effort.publish_sample(command.torque if self._core.drives_hub else command.force, float_bytes)
        if self._wrench.is_heard:
            self._wrench.publish(wrench_bytes(command.stamp_ns, command.force, command.torque))
        if command.state is not self._told:
            self._told = command.state
            self._tell_state()
            reason = self._core.safety.reason
            self.get_logger().info(command.state.value + (f': {reason}' if reason else ''))

    def _tell_state(self) -> None:
        self._state.publish(String(data=self._command.state.value))

    def _watch(self) -> None:
        """See what no sample tells."""
        if self.count_publishers(self._effort.topic_name) > 1:
            self._core.conflict('second publisher')
        now = clock_ns(self)
        if now < self._last_clock:
            self._core.conflict('clock')
        self._last_clock = now

    def _on_stop(self, request: Any, response: Any) -> Any:
        self._core.safety.stop()
        response.success, response.message = True, 'stopped; release enable, then renew it to go on'
        return response

    def _on_reset_fault(self, request: Any, response: Any) -> Any:
        response.success = self._core.safety.reset_fault()
        response.message = 'release enable, then renew it to go on' if response.success else 'there is no fault'
        return response

    def _diagnose(self) -> Diagnosis:
        now_ns = clock_ns(self)
        stamp = self._command.stamp_ns
        age = (now_ns - stamp) * 1e-9 if stamp else math.nan
        return diagnose_synchronizer(self._core, self._command, age)


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run('synchronizer', SynchronizerNode, args)


if __name__ == '__main__':
    sys.exit(main())

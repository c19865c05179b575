"""The node `phase_estimator`: joint states in; phase, step difference and footfalls out."""

import sys
from typing import Any

from rclpy.node import Node

from dcdrw_msgs_py.diagnosis import Diagnosis, contested
from dcdrw_msgs_py.messages import (
    JointSampleReader,
    PhaseSampleWriter,
    footfall_message,
)
from dcdrw_msgs_py.node import (
    Age,
    Parameters,
    advertise,
    clock_ns,
    follow_runs,
    listen,
    publish_diagnosis,
    publishers,
    run,
)
from dcdrw_msgs_py.rig import FRONT
from dcdrw_msgs_py.samples import LoneWheel
from dcdrw_msgs_py.topics import FOOTFALLS, JOINT_STATES, PHASE_STATE, PHI, STEP_DIFFERENCE
from dcdrw_msgs_py.wire import float_bytes, integer_bytes
from dcdrw_tracker.gait.diagnostics import diagnose_phase
from dcdrw_tracker.gait.pairing import WheelPairs
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams, PhaseUpdate
from dcdrw_tracker.gait.rivals import Rivals

STALE_AFTER = 1.0
"""Age of the last accepted sample from which the input is stale [s]."""


class PhaseEstimatorNode(Node):
    """Converts messages for the `PhaseEstimator`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('phase_estimator', **kwargs)
        parameters = Parameters(self, PhaseParams, lambda params: self._estimator.configure(params))
        params = parameters.value
        self._estimator = PhaseEstimator(params)
        self._reader = JointSampleReader(params.front_joint, params.rear_joint, params.coupler_joint)
        self._joints = params.front_joint, params.rear_joint
        self._pairs = WheelPairs()
        self._rivals, self._sources = Rivals(self._joints), 1
        self._writer = PhaseSampleWriter()
        self._phase = advertise(self, PHASE_STATE)
        self._phi = advertise(self, PHI)
        self._step_difference = advertise(self, STEP_DIFFERENCE)
        self._footfalls = {wheel: advertise(self, topic) for wheel, topic in FOOTFALLS.items()}
        self._age = Age()
        publish_diagnosis(self, self._diagnose)
        follow_runs(self, self._reader.runs)
        listen(self, JOINT_STATES, self._on_joints, misses_nothing=True)
        self.get_logger().info(f'waiting for the joints {params.front_joint} and {params.rear_joint}')

    def _on_joints(self, message: Any) -> None:
        self._rivals.hear(message.name)
        try:
            read = self._reader.read_any(message)
        except ValueError as error:
            if any(joint in message.name for joint in self._joints):
                self._estimator.refuse('unreadable')
            else:
                self._estimator.note_foreign()
                if self._estimator.accepted:  # another robot's, beside ours
                    return
            self.get_logger().warning(f'joint_states: {error}', throttle_duration_sec=1.0)
            return
        if isinstance(read, LoneWheel):
            unpaired = self._pairs.unpaired
            samples = self._pairs.take(read)
            if missing := self._pairs.unpaired - unpaired:
                self._estimator.refuse('unpaired', missing)
                other = self._joints[read.wheel == FRONT]
                self.get_logger().warning(
                    f'joint_states: joint {other} is missing; the message names {", ".join(message.name)}',
                    throttle_duration_sec=1.0,
                )
        else:
            samples = [read]
        now_ns = clock_ns(self)
        for joints in samples:
            if update := self._estimator.update(joints, now_ns):
                self._publish(update)

    def _publish(self, update: PhaseUpdate) -> None:
        self._age.renew()
        for phase in (*update.held, update.phase):
            if self._sources > 1:
                phase = phase._replace(sources=self._sources)
            self._phase.publish_sample(phase, self._writer.write)
        self._phi.publish_sample(update.phase.phi.angle, float_bytes)
        self._step_difference.publish_sample(update.phase.step_difference, integer_bytes)
        for footfall in update.footfalls:
            self._footfalls[footfall.wheel].publish(footfall_message(footfall))

    def _diagnose(self) -> Diagnosis:
        rivals = self._rivals.among(publishers(self, JOINT_STATES))
        self._sources = max(len(rivals), 1)
        diagnosis = diagnose_phase(self._estimator.status(), self._age.seconds, STALE_AFTER)
        return contested(diagnosis, JOINT_STATES.name, rivals)


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run('phase_estimator', PhaseEstimatorNode, args)


if __name__ == '__main__':
    sys.exit(main())

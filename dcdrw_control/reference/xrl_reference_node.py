"""The node `xrl_reference`: the person's legs in; what the robot's legs shall do out, while somebody enables it."""

import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from dcdrw_control.reference.conversion import leg_sample
from dcdrw_control.reference.diagnosis import diagnose_reference
from dcdrw_control.reference.joint_table import DEFAULT, read_joint_table
from dcdrw_control.reference.order import REAR_FEET, Fall
from dcdrw_control.reference.params import LEGS, ReferenceParams
from dcdrw_control.reference.person import GaitSample, WheelGait
from dcdrw_control.reference.plan import TICK_NS, Trajectory
from dcdrw_control.reference.reference import LegReference
from dcdrw_msgs_py.diagnosis import Diagnosis
from dcdrw_msgs_py.messages import PhaseSampleReader, stamp_ns, to_stamp, turns_message
from dcdrw_msgs_py.node import Age, Parameters, advertise, clock_ns, listen, publish_diagnosis, run
from dcdrw_msgs_py.samples import SECOND, Turn
from dcdrw_msgs_py.topics import (
    ENABLE,
    JOINT_TRAJECTORY,
    LEG_PHASES,
    PHASE_STATE,
    PLANNED_FOOTFALLS,
    SLOPE_FRAME,
    XRL_LEG_PHASES,
)

STALE_AFTER = 1.0
"""Age of the last accepted sample from which the input is stale [s]."""
HALF_TRACK = 0.1
"""Feet are planned so far to the left and to the right of the middle [m]."""


class XrlReferenceNode(Node):
    """Converts messages for the `LegReference`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('xrl_reference', **kwargs)
        params = Parameters(self, ReferenceParams).value
        table = read_joint_table(Path(params.table) if params.table else DEFAULT)
        self._core = LegReference(params, table)
        self._step_length, self._steps = params.rear.step_length, 0
        self._age = Age()
        self._phases = advertise(self, XRL_LEG_PHASES)
        self._trajectory = advertise(self, JOINT_TRAJECTORY)
        self._footfalls = advertise(self, PLANNED_FOOTFALLS)
        listen(self, ENABLE, lambda message: self._core.enable(time.monotonic(), message.data))
        if params.person == LEGS:
            listen(self, LEG_PHASES, self._reading(lambda message: leg_sample(stamp_ns(message.header.stamp), message)))
        else:
            reader, wheels = PhaseSampleReader(), WheelGait(params.front.alpha, params.rear.alpha)
            listen(self, PHASE_STATE, self._reading(lambda message: wheels.read(reader.read(message))))
        publish_diagnosis(self, self._diagnose)

    def _reading(self, read: Callable[[Any], GaitSample | None]) -> Callable[[Any], None]:
        """What takes the messages of a topic."""

        def take(message: Any) -> None:
            try:
                sample = read(message)
            except ValueError as error:
                self._core.refuse('unreadable')
                self.get_logger().warning(str(error), throttle_duration_sec=1.0)
                return
            if sample:
                self._take(sample)

        return take

    def _take(self, sample: GaitSample) -> None:
        update = self._core.update(sample, time.monotonic(), clock_ns(self))
        if update is None:
            return
        self._age.renew()
        turns = {
            foot.leg: Turn(math.tau * phase, math.tau * rate)
            for foot, phase, rate in zip(REAR_FEET, update.legs.strides, update.legs.rates, strict=True)
        }
        self._phases.publish(turns_message(update.stamp_ns, turns))
        for fall in update.falls:
            self._footfalls.publish(self._footfall_message(fall))
        if update.trajectory:
            self._trajectory.publish(self._trajectory_message(update.stamp_ns, update.trajectory))

    def _trajectory_message(self, stamp: int, trajectory: Trajectory) -> Any:
        message = JointTrajectory(joint_names=self._core.joints)
        message.header.stamp = to_stamp(stamp)
        rows = zip(trajectory.positions.tolist(), trajectory.speeds.tolist(), strict=True)
        for row, (positions, speeds) in enumerate(rows):
            seconds, nanoseconds = divmod(trajectory.first_ns + row * TICK_NS - stamp, SECOND)
            message.points.append(
                JointTrajectoryPoint(
                    positions=positions,
                    velocities=speeds,
                    time_from_start=Duration(sec=seconds, nanosec=nanoseconds),
                )
            )
        return message

    def _footfall_message(self, fall: Fall) -> Any:
        self._steps += 1
        message = PointStamped()
        message.header.stamp = to_stamp(fall.stamp_ns)
        message.header.frame_id = SLOPE_FRAME
        message.point.x = self._steps * self._step_length
        message.point.y = HALF_TRACK if fall.foot is REAR_FEET[0] else -HALF_TRACK
        return message

    def _diagnose(self) -> Diagnosis:
        return diagnose_reference(self._core.status(), self._age.seconds, STALE_AFTER)


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run('xrl_reference', XrlReferenceNode, args)


if __name__ == '__main__':
    sys.exit(main())

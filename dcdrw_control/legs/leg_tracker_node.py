"""The node `leg_tracker`: sensors on legs in; the phase of each leg, and the halves as wheels, out."""

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node

from dcdrw_control.legs.conversion import READERS, hip_readings
from dcdrw_control.legs.diagnosis import diagnose_legs
from dcdrw_control.legs.params import LegParams
from dcdrw_control.legs.samples import Leg, LegReading, Reading
from dcdrw_control.legs.tracker import LegTracker
from dcdrw_msgs_py.diagnosis import Diagnosis
from dcdrw_msgs_py.messages import stamp_ns, turns_message
from dcdrw_msgs_py.node import Age, Parameters, advertise, clock_ns, listen, publish_diagnosis, run
from dcdrw_msgs_py.topics import JOINT_STATES, LEG_JOINT_STATES, LEG_PHASES, LEG_SENSORS

STALE_AFTER = 1.0
"""Age of the last accepted reading from which the input is stale [s]."""


class LegTrackerNode(Node):
    """Converts messages for the `LegTracker`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('leg_tracker', **kwargs)
        parameters = Parameters(self, LegParams, lambda params: self._tracker.configure(params), LegParams.check_hips)
        self._tracker = LegTracker(parameters.value)
        self._phases = advertise(self, LEG_PHASES)
        self._joints = advertise(self, JOINT_STATES)
        self._age = Age()
        publish_diagnosis(self, self._diagnose)
        for (half, side, kind), topic in LEG_SENSORS.items():
            listen(self, topic, partial(self._on_sensor, Leg(half, side), READERS[kind]))
        listen(self, LEG_JOINT_STATES, self._on_hips)
        self.get_logger().info('waiting for the sensors of the legs')

    def _on_sensor(self, leg: Leg, read: Callable[[Any], Reading], message: Any) -> None:
        # A Bool has no stamp of its own: it is of now.
        stamp = stamp_ns(message.header.stamp) if hasattr(message, 'header') else clock_ns(self)
        self._take(stamp, leg, read(message))

    def _on_hips(self, message: Any) -> None:
        try:
            hips = hip_readings(message, self._tracker.params.hip_joints)
        except ValueError as error:
            self._tracker.refuse('unreadable')
            self.get_logger().warning(f'{LEG_JOINT_STATES.name}: {error}', throttle_duration_sec=1.0)
            return
        for leg, reading in hips:
            self._take(stamp_ns(message.header.stamp), leg, reading)

    def _take(self, stamp: int, leg: Leg, reading: Reading) -> None:
        update = self._tracker.update(LegReading(stamp, leg, reading), clock_ns(self))
        if self._tracker.refusal is None:
            self._age.renew()
        if update is None:
            return
        if update.legs:
            legs = {str(one): turn for one, turn in update.legs.items()}
            self._phases.publish(turns_message(update.stamp_ns, legs))
        if update.wheels:
            self._joints.publish(turns_message(update.stamp_ns, update.wheels))

    def _diagnose(self) -> Diagnosis:
        return diagnose_legs(self._tracker.status(), self._age.seconds, STALE_AFTER)


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run('leg_tracker', LegTrackerNode, args)


if __name__ == '__main__':
    sys.exit(main())

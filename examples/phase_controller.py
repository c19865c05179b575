"""A controller on the phase in twenty lines: a force that follows the error, on top of spring and damper.

Run it beside a suite, for instance `ros2 launch dcdrw trial.launch.py`. The simulator drops a command that is older
than its `command_timeout`, so this node must keep talking; the node `synchronizer` does it better, and safely.
"""

from contextlib import suppress

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Float64

GAIN, LIMIT = 1.5, 20.0  # N per percent of a step; N


class PhaseController(Node):
    def __init__(self) -> None:
        super().__init__('phase_controller')
        self.force = self.create_publisher(Float64, 'coupler_force_command', 10)
        self.create_subscription(Float64, 'sync_error_percent', self.on_error, 10)

    def on_error(self, error: Float64) -> None:
        self.force.publish(Float64(data=max(-LIMIT, min(LIMIT, GAIN * error.data))))


if __name__ == '__main__':
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(PhaseController())

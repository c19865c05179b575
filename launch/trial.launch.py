"""A trial in simulation: `ros2 launch dcdrw trial.launch.py`, with the arguments of dcdrw.launch.py."""

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.substitutions import ThisLaunchFileDir


def generate_launch_description():
    """Simulator, estimator and monitor."""
    return LaunchDescription(
        [IncludeLaunchDescription([ThisLaunchFileDir(), '/dcdrw.launch.py'], launch_arguments=[('source', 'sim')])]
    )

"""The XRL's stack in simulation: a person in front, the robot behind, the synchronizer and the robot's legs.

`ros2 launch dcdrw xrl.launch.py`, with the arguments of dcdrw.launch.py; nothing pushes until `enable` is renewed.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.substitutions import PathJoinSubstitution, ThisLaunchFileDir
from launch_ros.substitutions import FindPackageShare

CHOSEN = {'source': 'sim', 'person': 'true', 'xrl_reference': 'true'}


def generate_launch_description():
    """Person, simulator, estimator, monitor, synchronizer and xrl_reference; the whole ends when one of them does."""
    rig = PathJoinSubstitution([FindPackageShare('dcdrw'), 'config', 'xrl.yaml'])
    return LaunchDescription(
        [
            DeclareLaunchArgument('params_file', default_value=rig),
            DeclareLaunchArgument('on_exit', default_value='end'),
            IncludeLaunchDescription([ThisLaunchFileDir(), '/dcdrw.launch.py'], launch_arguments=list(CHOSEN.items())),
        ]
    )

"""A rig before a camera: `ros2 launch dcdrw rig.launch.py params_file:=my_rig.yaml camera:=0 calibration:=camera.yaml`.

The arguments are those of dcdrw.launch.py.
"""

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.substitutions import ThisLaunchFileDir


def generate_launch_description():
    """Tag tracker, estimator and monitor."""
    return LaunchDescription(
        [IncludeLaunchDescription([ThisLaunchFileDir(), '/dcdrw.launch.py'], launch_arguments=[('source', 'rig')])]
    )

"""A trial in simulation: `ros2 launch dcdrw trial.launch.py`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = {
    'params_file': ('', 'a parameter file for all nodes, as share/dcdrw/config/rig.yaml'),
    'initial_phase_percent': ('', 'phase at the start, percent of a step'),
    'real_time_factor': ('', 'simulated seconds per second, 0: as fast as possible; implies simulated_time'),
    'simulated_time': ('false', 'true: the simulator publishes /clock, and the other nodes follow it'),
    'namespace': ('', 'of all nodes'),
}


def _nodes(context):
    chosen = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    file = [chosen['params_file']] if chosen['params_file'] else []
    numbers = {name: float(chosen[name]) for name in ('initial_phase_percent', 'real_time_factor') if chosen[name]}
    simulated = chosen['simulated_time'].lower() == 'true' or 'real_time_factor' in numbers
    settings = {
        'sync_monitor': {'use_sim_time': simulated},
        'phase_estimator': {'use_sim_time': simulated},
        'simulator': {'publish_clock': simulated, **numbers},
    }
    return [
        Node(package='dcdrw', executable=name, name=name, namespace=chosen['namespace'], output='screen',
             parameters=[*file, parameters])
        for name, parameters in settings.items()
    ]


def generate_launch_description():
    """The three nodes, with arguments."""
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=doc)
          for name, (default, doc) in ARGUMENTS.items()),
        OpaqueFunction(function=_nodes),
    ])

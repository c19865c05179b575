"""The suite around any source of joint states: `ros2 launch dcdrw dcdrw.launch.py source:=sim rviz:=true`."""

from argparse import ArgumentTypeError
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, ExecuteProcess, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import ExecutableInPackage, FindPackageShare

from dcdrw.commands.urdf import make_urdf
from dcdrw.console import phase_percent
from dcdrw.suite.hub_gains import hub_gains
from dcdrw.suite.parameter_file import TrialParams, given, read_parameter_file

SOURCES = ('sim', 'rig', 'legs', 'recording')
SWITCH = ('true', 'false')
ARGUMENTS = {
    'source': (
        'sim',
        'sim: the simulator; rig: a camera and the tag tracker; legs: sensors on legs and the leg tracker; '
        'recording: replayed',
        SOURCES,
    ),
    'recording': ('', 'the recording to replay', None),
    'camera': (
        '',
        'rig: a camera (0, /dev/video0, rtsp://…) or a video file that the tag tracker opens itself '
        '(default: the topic image_raw)',
        None,
    ),
    'calibration': ('', 'rig: a camera_info file, which `camera` needs (default: the topic camera_info)', None),
    'params_file': ('', 'a parameter file for all nodes, as share/dcdrw/config/rig.yaml', None),
    'namespace': ('', 'of all nodes', None),
    'initial_phase_percent': ('', 'sim: phase at the start, percent of a step', None),
    'real_time_factor': (
        '',
        'sim, recording: seconds of the rig per second; sim: 0 is as fast as possible, and it implies simulated_time',
        None,
    ),
    'simulated_time': (
        'false',
        'sim: the simulator publishes /clock, and the other nodes follow it; a recording always does',
        SWITCH,
    ),
    'record': ('false', 'record all topics of the suite', SWITCH),
    'folder': ('', 'of what is recorded (default: recordings/DATE-TIME)', None),
    'live': ('false', 'serve the page of `dcdrw live`; its button starts the recorder', SWITCH),
    'one_process': (
        'false',
        'estimator, monitor and synchronizer in one process; the synchronizer stays idle until enabled',
        SWITCH,
    ),
    'xrl_reference': (
        'false',
        "plan the robot's legs a quarter stride ahead of the person's: of legs, or of the front wheel",
        SWITCH,
    ),
    'enclaves': (
        'false',
        "each node in the SROS2 enclave /dcdrw/NAME, the page in the operator's (see docs/security.md)",
        SWITCH,
    ),
    'on_exit': (
        'ignore',
        'when a node ends: ignore, the others go on; end, they end too; respawn, it starts again after a second',
        ('ignore', 'end', 'respawn'),
    ),
    'synchronizer': ('false', 'run the synchronizer, idle until enabled; its gains from params_file', SWITCH),
    'person': (
        'false',
        'sim: the front wheel walks as a person does, and the synchronizer drives the rear hub while it is enabled',
        SWITCH,
    ),
    'markers': ('false', 'draw the rig for RViz and Foxglove; rviz implies it', SWITCH),
    'rviz': ('false', 'show the rig in RViz, with its URDF in robot_state_publisher (needs both packages)', SWITCH),
}


def _actions(context):
    chosen = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    on = {name: chosen[name] == 'true' for name, (_, _, choices) in ARGUMENTS.items() if choices is SWITCH}
    source, pace = chosen['source'], chosen['real_time_factor']
    if source == 'recording' and not chosen['recording']:
        raise ValueError('source:=recording needs recording:=FOLDER')
    if on['enclaves'] and (on['one_process'] or on['rviz'] or source == 'recording'):
        raise ValueError('enclaves:=true has none for one_process, rviz and source:=recording (see docs/security.md)')
    simulated = source == 'recording' or (source == 'sim' and (on['simulated_time'] or bool(pace)))

    person = source == 'sim' and on['person']
    gains = _hub_gains(chosen) if person else {}

    def node(name, **parameters):
        return start(name, name, parameters)

    def hosted():
        """Several nodes in one process: each keeps its own name."""
        return start('suite', None, gains)

    def start(executable, name, parameters):
        file = [chosen['params_file']] if chosen['params_file'] else []
        return Node(
            package='dcdrw',
            executable=executable,
            name=name,
            namespace=chosen['namespace'],
            output='screen',
            parameters=[*file, {'use_sim_time': simulated, **parameters}],
            ros_arguments=['--enclave', f'/dcdrw/{executable}'] if on['enclaves'] else None,
            respawn=chosen['on_exit'] == 'respawn',
            respawn_delay=1.0,
        )

    def texts(**arguments):
        """Parameters from the arguments that are given; a text stays one, were it a number."""
        return {
            name: ParameterValue(chosen[argument], value_type=str)
            for name, argument in arguments.items()
            if chosen[argument]
        }

    def command(name, *arguments, namespace='--namespace'):
        space = [namespace, chosen['namespace']] if chosen['namespace'] else []
        return ExecuteProcess(
            cmd=[ExecutableInPackage('dcdrw', 'dcdrw'), name, *arguments, *space],
            output='screen',
            additional_env={'ROS_SECURITY_ENCLAVE_OVERRIDE': '/dcdrw/operator'} if on['enclaves'] else None,
        )

    # First what may not be installed: a launch that fails must not leave nodes behind.
    actions = _rviz(chosen, simulated) if on['rviz'] else []
    actions += [hosted()] if on['one_process'] else [node('sync_monitor'), node('phase_estimator')]
    if (on['synchronizer'] or person) and not on['one_process']:  # which hosts it anyway
        actions.append(node('synchronizer', **gains))
    if on['record'] or on['live']:
        actions.append(node('recorder', record=on['record'], **texts(folder='folder')))
    if on['markers'] or on['rviz']:
        actions.append(node('rig_markers'))
    if on['xrl_reference']:
        actions.append(node('xrl_reference', person='legs' if source == 'legs' else 'wheel'))
    if on['live']:
        actions.append(command('live', *(['--rig', chosen['params_file']] if chosen['params_file'] else [])))
    if source == 'rig':
        actions.append(node('tag_tracker', **texts(source='camera', camera='calibration')))
    elif source == 'legs':
        actions.append(node('leg_tracker'))
    elif source == 'recording':
        rate = ['--rate', pace] if pace else []
        actions.append(command('replay', chosen['recording'], *rate, namespace='--into'))
    else:
        numbers = {
            name: parse(chosen[name])
            for name, parse in {'initial_phase_percent': _phase, 'real_time_factor': float}.items()
            if chosen[name]
        }
        walk = {'person.walks': True} if person else {}
        actions.append(node('simulator', use_sim_time=False, publish_clock=simulated, **numbers, **walk))
    return [*actions, *map(_ends_all, actions)] if chosen['on_exit'] == 'end' else actions


def _phase(text):
    try:
        return phase_percent(text)
    except ArgumentTypeError as error:
        raise ValueError(f'initial_phase_percent {error}') from None


def _ends_all(action):
    """Ends the launch when this process has ended; with a status other than 0, the reason says so."""
    return RegisterEventHandler(
        OnProcessExit(
            target_action=action,
            on_exit=lambda event, _: EmitEvent(
                event=Shutdown(reason=f'{event.process_name} ended with status {event.returncode}')
            ),
        )
    )


def _trial_params(chosen):
    file = chosen['params_file']
    return read_parameter_file(Path(file), TrialParams(), chosen['namespace']) if file else TrialParams()


def _hub_gains(chosen):
    """What makes the synchronizer drive the rear hub: for this rig, as `dcdrw trial --person` does."""
    return {
        'law': 'rear',
        **{f'hub.{name}': value for name, value in given(hub_gains(_trial_params(chosen).rig)).items()},
    }


def _rviz(chosen, simulated):
    """RViz, and the URDF's transforms. Only the simulator is sure to tell the coupler's length."""
    namespace = chosen['namespace']
    urdf = make_urdf(_trial_params(chosen), fixed_coupler=chosen['source'] != 'sim')
    config = PathJoinSubstitution([FindPackageShare('dcdrw'), 'rviz', 'dcdrw.rviz'])
    return [
        Node(
            package='robot_state_publisher',
            executable='robot_state_publisher',
            namespace=namespace,
            output='screen',
            parameters=[{'robot_description': ParameterValue(urdf, value_type=str), 'use_sim_time': simulated}],
        ),
        Node(
            package='rviz2',
            executable='rviz2',
            namespace=namespace,
            arguments=['-d', config],
            output='screen',
            parameters=[{'use_sim_time': simulated}],
            remappings=[(f'/{topic}', topic) for topic in ('rig_markers', 'robot_description', 'debug_image')],
        ),
    ]


def generate_launch_description():
    """Estimator and monitor, the source that is asked for, and the tools that are switched on."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=doc, choices=choices)
                for name, (default, doc, choices) in ARGUMENTS.items()
            ),
            OpaqueFunction(function=_actions),
        ]
    )

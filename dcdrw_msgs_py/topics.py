"""The topics: name, message type and quality of service, declared once (contract §5)."""

from typing import NamedTuple

from dcdrw_msgs_py.rig import FRONT, REAR


class Topic(NamedTuple):
    """A topic of the suite. Names are relative, so that namespaces and remapping work."""

    name: str
    type: str
    """Package and message, as `ros2 interface show` takes it."""
    doc: str
    depth: int = 10
    """Messages that a publisher keeps for a subscriber that lags."""
    latched: bool = False
    """A late subscriber gets the last message."""


SIDES = ('left', 'right')
"""Sides of the person in front and of the robot behind."""
# 1000 messages are a second at 1 kHz: a reader that stalls for 50 ms loses nothing.
SAMPLE_DEPTH = 1000

JOINT_STATES = Topic(
    'joint_states',
    'sensor_msgs/msg/JointState',
    'rotation and speed of both wheels; the coupler where known',
    SAMPLE_DEPTH,
)
RUNS = Topic(
    'run',
    'std_msgs/msg/Header',
    'the source starts anew: stamp of the first sample, run_N as frame_id; within a run no turn is lost',
    1,
    latched=True,
)
COUPLER_FORCE_COMMAND = Topic(
    'coupler_force_command', 'std_msgs/msg/Float64', 'force added to the coupler, N; zero when stale'
)
REAR_TORQUE_COMMAND = Topic(
    'rear_torque_command',
    'std_msgs/msg/Float64',
    'torque on the rear hub, N·m, positive rolls downhill; zero when stale',
)
PERSON_FORCE = Topic(
    'person_force',
    'geometry_msgs/msg/WrenchStamped',
    "the coupler's force on the person, stamped: force.x in N, positive where it pushes forward",
    SAMPLE_DEPTH,
)
ENABLE = Topic('enable', 'std_msgs/msg/Bool', 'heartbeat of at least 10 Hz that lets the robot push; expired is false')
COUPLER_WRENCH = Topic(
    'coupler_wrench',
    'geometry_msgs/msg/WrenchStamped',
    'what is commanded, stamped: force.x in N, tension positive; torque.y on the rear hub in N·m',
)
SYNCHRONIZER_STATE = Topic(
    'synchronizer_state', 'std_msgs/msg/String', 'disabled, armed, active, ramp_down or fault', 1, latched=True
)
PHASE_STATE = Topic('phase_state', 'sensor_msgs/msg/JointState', 'stance angles, φ and steps', SAMPLE_DEPTH)
PHI = Topic('phi', 'std_msgs/msg/Float64', 'φ, rad', SAMPLE_DEPTH)
STEP_DIFFERENCE = Topic('step_difference', 'std_msgs/msg/Int32', 'n = n1 − n2', SAMPLE_DEPTH)
FOOTFALLS = {
    wheel: Topic(
        f'{wheel}_footfalls',
        'geometry_msgs/msg/PointStamped',
        f"one per strike of the {wheel} wheel, at the strike's own time: the new stance foot in the frame slope",
        SAMPLE_DEPTH,
    )
    for wheel in (FRONT, REAR)
}
SYNC_STATE = Topic(
    'sync_state', 'sensor_msgs/msg/JointState', 'stamped: phase (steps) and sync_error (rad), with rates', SAMPLE_DEPTH
)
SYNC_ERROR = Topic('sync_error', 'std_msgs/msg/Float64', 'e, rad', SAMPLE_DEPTH)
SYNC_ERROR_PERCENT = Topic('sync_error_percent', 'std_msgs/msg/Float64', 'e, percent of a step', SAMPLE_DEPTH)
SYNCHRONIZED = Topic('synchronized', 'std_msgs/msg/Bool', 'whether the pair walks in step', 1, latched=True)
LEG_SENSORS = {
    (half, side, kind): Topic(
        f'{half}/{side}_{kind}', f'{type_}', f'{doc} of the {half} half, on the {side}', SAMPLE_DEPTH
    )
    for half in (FRONT, REAR)
    for kind, type_, doc in (
        ('imu', 'sensor_msgs/msg/Imu', 'inertial sensor on the foot or the shank'),
        ('contact', 'std_msgs/msg/Bool', 'whether the foot touches the ground'),
        ('wrench', 'geometry_msgs/msg/WrenchStamped', 'vertical force under the foot, force.z'),
    )
    for side in SIDES
}
LEG_JOINT_STATES = Topic(
    'leg_joint_states', 'sensor_msgs/msg/JointState', 'hip angles, by the names in hip_joints', SAMPLE_DEPTH
)
LEG_PHASES = Topic(
    'leg_phases',
    'sensor_msgs/msg/JointState',
    'phase of each leg that is known, front_left and so on: 2π per stride, 0 at heel strike, rad, and its rate',
    SAMPLE_DEPTH,
)
XRL_LEG_PHASES = Topic(
    'xrl_leg_phases',
    'sensor_msgs/msg/JointState',
    "phase that the robot's legs shall have, rear_left and rear_right: as leg_phases, a quarter stride ahead",
    SAMPLE_DEPTH,
)
JOINT_TRAJECTORY = Topic(
    'joint_trajectory',
    'trajectory_msgs/msg/JointTrajectory',
    "what the robot's joints shall do next; renewed before it ends, at rest where it ends",
)
PLANNED_FOOTFALLS = Topic(
    'xrl_reference/rear_footfalls',
    'geometry_msgs/msg/PointStamped',
    "one per planned footfall of the robot, at its own time, in the frame slope: y > 0 is the left foot's",
    SAMPLE_DEPTH,
)
RIG_MARKERS = Topic('rig_markers', 'visualization_msgs/msg/MarkerArray', 'the rig, drawn, at most 30 Hz')
IMAGE_RAW = Topic('image_raw', 'sensor_msgs/msg/Image', 'the rig as a camera on its left sees it', 2)
CAMERA_INFO = Topic('camera_info', 'sensor_msgs/msg/CameraInfo', 'lens and sensor of that camera', 2)
IMAGE_COMPRESSED = Topic(
    'image_raw/compressed',
    'sensor_msgs/msg/CompressedImage',
    'the same, as JPEG or PNG; follows the name of image_raw',
    2,
)
FRONT_POSE = Topic(
    'front_pose',
    'geometry_msgs/msg/PoseStamped',
    'front wheel as motion capture sees it: hub and turn, z up',
    SAMPLE_DEPTH,
)
REAR_POSE = Topic('rear_pose', 'geometry_msgs/msg/PoseStamped', 'rear wheel, likewise', SAMPLE_DEPTH)
TAG_DETECTIONS = Topic(
    'tag_detections',
    'visualization_msgs/msg/ImageMarker',
    'one per tag of a frame: ns the wheel, id the tag, points its corners in pixels',
    SAMPLE_DEPTH,
)
DEBUG_IMAGE = Topic(
    'debug_image',
    'sensor_msgs/msg/Image',
    'tags, hubs, spokes and stance legs drawn over the picture, while somebody subscribes',
    2,
)
DIAGNOSTICS = Topic('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', 'health, 1 Hz')
CLOCK = Topic('/clock', 'rosgraph_msgs/msg/Clock', 'simulated time, when asked')
ROSOUT = Topic('/rosout', 'rcl_interfaces/msg/Log', 'what the nodes log', SAMPLE_DEPTH)
PARAMETER_EVENTS = Topic(
    '/parameter_events', 'rcl_interfaces/msg/ParameterEvent', 'changes of parameters', SAMPLE_DEPTH
)

# Names of the joints in joint_states and phase_state.
FRONT_WHEEL, REAR_WHEEL, COUPLER = 'front_wheel', 'rear_wheel', 'coupler'
FRONT_STANCE, REAR_STANCE, PHI_JOINT, STEP_DIFFERENCE_JOINT = 'front_stance', 'rear_stance', 'phi', 'step_difference'
FRONT_STEPS, REAR_STEPS, RESTARTS = 'front_steps', 'rear_steps', 'restarts'
SOURCES_JOINT = 'sources'
"""Only where several nodes send the joint states of the same wheels: how many."""
RESOLUTION_JOINT = 'resolution'
"""Only where encoders are coarse: how far their counts leave the phase open, in steps."""
# Names of the joints in sync_state.
PHASE_JOINT, SYNC_ERROR_JOINT = 'phase', 'sync_error'
SLOPE_FRAME = 'slope'
"""x down the slope from the rear wheel's first foothold, y to the left, z along the normal: in the URDF, too."""

"""The executables of the suite: what each is for, its parameters, topics and services. Tests hold it to the nodes."""

from typing import Any, NamedTuple

from dcdrw import entry
from dcdrw.drawings.rig_markers import MarkerParams
from dcdrw.suite.recorder_params import RecorderParams
from dcdrw_control.legs.params import LegParams
from dcdrw_control.reference.params import ReferenceParams
from dcdrw_control.sync.synchronizer import SynchronizerParams
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.tagging import TagParams
from dcdrw_msgs_py.topics import (
    CAMERA_INFO,
    CLOCK,
    COUPLER_FORCE_COMMAND,
    COUPLER_WRENCH,
    DEBUG_IMAGE,
    DIAGNOSTICS,
    ENABLE,
    FOOTFALLS,
    FRONT_POSE,
    IMAGE_COMPRESSED,
    IMAGE_RAW,
    JOINT_STATES,
    JOINT_TRAJECTORY,
    LEG_JOINT_STATES,
    LEG_PHASES,
    LEG_SENSORS,
    PARAMETER_EVENTS,
    PERSON_FORCE,
    PHASE_STATE,
    PHI,
    PLANNED_FOOTFALLS,
    REAR_POSE,
    REAR_TORQUE_COMMAND,
    RIG_MARKERS,
    ROSOUT,
    RUNS,
    STEP_DIFFERENCE,
    SYNC_ERROR,
    SYNC_ERROR_PERCENT,
    SYNC_STATE,
    SYNCHRONIZED,
    SYNCHRONIZER_STATE,
    TAG_DETECTIONS,
    XRL_LEG_PHASES,
    Topic,
)
from dcdrw_sim.camera.render import LookParams
from dcdrw_sim.camera.scene import SceneParams, ViewParams
from dcdrw_sim.camera.shutter import ShutterParams
from dcdrw_sim.rig.simulator import SimulatorParams
from dcdrw_tracker.gait.phase import PhaseParams
from dcdrw_tracker.gait.sync import SyncParams
from dcdrw_tracker.node.tracker_source import SourceParams
from dcdrw_tracker.tags.wheel_view import PairViewParams
from dcdrw_tracker.wheels.poses import PoseParams
from dcdrw_tracker.wheels.wheel_track import TrackParams


class Executable(NamedTuple):
    """One node."""

    name: str
    doc: str
    parameters: tuple[type[tuple[Any, ...]], ...]
    subscribes: tuple[Topic, ...]
    publishes: tuple[Topic, ...]
    services: tuple[str, ...] = ()
    by_choice: tuple[Topic, ...] = ()
    """Those of the topics that the default parameters leave out."""

    @property
    def module(self) -> str:
        """The module of its node."""
        return entry.EXECUTABLES[self.name]


SIMULATOR = Executable(
    'simulator',
    'the rig in simulation, in the place of the real one',
    (RigParams, SimulatorParams),
    (COUPLER_FORCE_COMMAND, REAR_TORQUE_COMMAND),
    (JOINT_STATES, RUNS, PERSON_FORCE, CLOCK, DIAGNOSTICS),
    ('~/reset (std_srvs/srv/Trigger)', '~/pause (std_srvs/srv/SetBool)'),
    by_choice=(PERSON_FORCE,),
)
PHASE_ESTIMATOR = Executable(
    'phase_estimator',
    'from wheel rotations to phase, steps and footfalls',
    (PhaseParams,),
    (JOINT_STATES, RUNS),
    (PHASE_STATE, PHI, STEP_DIFFERENCE, *FOOTFALLS.values(), DIAGNOSTICS),
)
SYNC_MONITOR = Executable(
    'sync_monitor',
    'how far from walking in step, and whether it stays there',
    (SyncParams,),
    (PHASE_STATE,),
    (SYNC_STATE, SYNC_ERROR, SYNC_ERROR_PERCENT, SYNCHRONIZED, DIAGNOSTICS),
)

MARKERS = Executable(
    'rig_markers',
    'the rig as markers, for RViz and Foxglove',
    (MarkerParams,),
    (JOINT_STATES, RUNS, PERSON_FORCE, LEG_PHASES, DIAGNOSTICS),
    (RIG_MARKERS, DIAGNOSTICS),
)

RECORDER = Executable(
    'recorder',
    'while it records: every topic but images and markers, into a recording',
    (RecorderParams,),
    (),
    (DIAGNOSTICS,),
    ('~/record (std_srvs/srv/SetBool)',),
)

VIRTUAL_CAMERA = Executable(
    'virtual_camera',
    'pictures of the rig, as a camera on its left would take them',
    (SceneParams, ViewParams, LookParams, TagParams, ShutterParams),
    (JOINT_STATES, RUNS),
    (IMAGE_RAW, CAMERA_INFO, DIAGNOSTICS),
)

TAG_TRACKER = Executable(
    'tag_tracker',
    "from a camera's pictures, or motion capture, to wheel rotations",
    (TagParams, PairViewParams, TrackParams, PoseParams, SourceParams),
    (IMAGE_RAW, IMAGE_COMPRESSED, CAMERA_INFO, FRONT_POSE, REAR_POSE),
    (JOINT_STATES, RUNS, TAG_DETECTIONS, DEBUG_IMAGE, DIAGNOSTICS),
    by_choice=(IMAGE_COMPRESSED, FRONT_POSE, REAR_POSE),
)

LEG_TRACKER = Executable(
    'leg_tracker',
    "from sensors on people's legs to the phase of each leg, and to wheel rotations",
    (LegParams,),
    (*LEG_SENSORS.values(), LEG_JOINT_STATES),
    (LEG_PHASES, JOINT_STATES, DIAGNOSTICS),
)

SYNCHRONIZER = Executable(
    'synchronizer',
    'from the phase to a bounded force, or torque, that brings the pair into step, while somebody enables it',
    (SynchronizerParams,),
    (PHASE_STATE, ENABLE),
    (COUPLER_FORCE_COMMAND, REAR_TORQUE_COMMAND, COUPLER_WRENCH, SYNCHRONIZER_STATE, DIAGNOSTICS),
    ('~/stop (std_srvs/srv/Trigger)', '~/reset_fault (std_srvs/srv/Trigger)'),
    by_choice=(REAR_TORQUE_COMMAND,),
)

XRL_REFERENCE = Executable(
    'xrl_reference',
    "from the person's legs to what the robot's shall do, a quarter stride ahead, while somebody enables it",
    (ReferenceParams,),
    (LEG_PHASES, PHASE_STATE, ENABLE),
    (XRL_LEG_PHASES, JOINT_TRAJECTORY, PLANNED_FOOTFALLS, DIAGNOSTICS),
    by_choice=(PHASE_STATE,),
)

TRIAL = (SIMULATOR, PHASE_ESTIMATOR, SYNC_MONITOR)
"""The nodes of a trial in simulation."""
HOSTED = (PHASE_ESTIMATOR.name, SYNC_MONITOR.name, SYNCHRONIZER.name)
"""The nodes that `suite` hosts in one process unasked."""
EXECUTABLES = (*TRIAL, TAG_TRACKER, LEG_TRACKER, SYNCHRONIZER, XRL_REFERENCE, VIRTUAL_CAMERA, MARKERS, RECORDER)

RECORDED = (
    *dict.fromkeys(
        topic
        for node in EXECUTABLES
        for topic in (*node.subscribes, *node.publishes)
        if not topic.type.endswith(('Image', 'MarkerArray'))
    ),
    PARAMETER_EVENTS,
    ROSOUT,
)
"""The topics that a recorder keeps unasked: no pictures, and no drawings of what the others tell."""

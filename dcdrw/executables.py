"""The executables of the suite: what each is for, its parameters, topics and services. Tests hold it to the nodes."""

from typing import Any, NamedTuple

from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.topics import (
    CLOCK,
    COUPLER_FORCE_COMMAND,
    DIAGNOSTICS,
    FOOTFALLS,
    JOINT_STATES,
    PHASE_STATE,
    PHI,
    STEP_DIFFERENCE,
    SYNC_ERROR,
    SYNC_ERROR_PERCENT,
    SYNCHRONIZED,
    Topic,
)
from dcdrw_sim.simulator import SimulatorParams
from dcdrw_tracker.phase import PhaseParams
from dcdrw_tracker.sync import SyncParams


class Executable(NamedTuple):
    """One node."""

    name: str
    module: str
    doc: str
    parameters: tuple[type[tuple[Any, ...]], ...]
    subscribes: tuple[Topic, ...]
    publishes: tuple[Topic, ...]
    services: tuple[str, ...] = ()


SIMULATOR = Executable(
    'simulator', 'dcdrw_sim.simulator_node', 'the rig in simulation, in the place of the real one',
    (RigParams, SimulatorParams), (COUPLER_FORCE_COMMAND,), (JOINT_STATES, CLOCK, DIAGNOSTICS),
    ('~/reset (std_srvs/srv/Trigger)', '~/pause (std_srvs/srv/SetBool)'))
PHASE_ESTIMATOR = Executable(
    'phase_estimator', 'dcdrw_tracker.phase_estimator_node', 'from wheel rotations to phase, steps and footfalls',
    (PhaseParams,), (JOINT_STATES,), (PHASE_STATE, PHI, STEP_DIFFERENCE, FOOTFALLS, DIAGNOSTICS))
SYNC_MONITOR = Executable(
    'sync_monitor', 'dcdrw_tracker.sync_monitor_node', 'how far from walking in step, and whether it stays there',
    (SyncParams,), (PHASE_STATE,), (SYNC_ERROR, SYNC_ERROR_PERCENT, SYNCHRONIZED, DIAGNOSTICS))

EXECUTABLES = (SIMULATOR, PHASE_ESTIMATOR, SYNC_MONITOR)

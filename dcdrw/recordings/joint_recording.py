"""Joint samples into a recording, as if a recorder had heard the source publish them: knows no ROS."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from dcdrw.recordings.recorder import PARAMETERS, Recorder, offered_qos
from dcdrw.suite.parameter_file import given, write_changed
from dcdrw_msgs_py.samples import RUN, JointSample
from dcdrw_msgs_py.topics import JOINT_STATES, RUNS
from dcdrw_tracker.gait.phase import PhaseParams

TOPIC = f'/{JOINT_STATES.name}'
RUNS_TOPIC = f'/{RUNS.name}'


def record_joints(
    folder: Path,
    samples: Iterable[JointSample],
    names: PhaseParams,
    params: Iterable[tuple[Any, ...]],
    about: dict[str, str],
) -> None:
    """Write a recording.

    Args:
        folder: of the recording; must not exist.
        samples: in the order of time.
        names: of the joints.
        params: parameter sets to keep with it.
        about: what else to keep with it.

    Raises:
        ValueError: the folder exists, or a library is missing.
        OSError: the disk is full, say.

    """
    recorder = Recorder(folder, about)
    # For every node, as a rig file has them: no simulator took part.
    values = {name: value for one in params for name, value in given(one).items()}
    write_changed(None, values, folder / PARAMETERS, 'What the joint states were made with.')
    states = recorder.add_topic(TOPIC, JOINT_STATES.type, [offered_qos(True, False, JOINT_STATES.depth)])
    runs = recorder.add_topic(RUNS_TOPIC, RUNS.type, [offered_qos(True, True, RUNS.depth)])
    serialize, announce = serializers(names)
    run = 0
    for sample in samples:
        if sample.run != run:
            run = sample.run
            recorder.write(runs, announce(sample), sample.stamp_ns)
        recorder.write(states, serialize(sample), sample.stamp_ns)
    recorder.close()


def serializers(names: PhaseParams) -> tuple[Any, Any]:
    """What makes a joint state's bytes, and those of the run that it begins."""
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_JAZZY)
    state, header, time = (
        types.types[name] for name in (JOINT_STATES.type, 'std_msgs/msg/Header', 'builtin_interfaces/msg/Time')
    )

    def serialize(sample: JointSample) -> bytes:
        (psi1, omega1), (psi2, omega2) = sample.front, sample.rear
        message = state(
            header(time(*divmod(sample.stamp_ns, 10**9)), ''),
            [names.front_joint, names.rear_joint],
            np.array((psi1, psi2)),
            np.array((omega1, omega2)),
            np.empty(0),
        )
        return bytes(types.serialize_cdr(message, JOINT_STATES.type))

    def announce(sample: JointSample) -> bytes:
        message = header(time(*divmod(sample.stamp_ns, 10**9)), f'{RUN}{sample.run}')
        return bytes(types.serialize_cdr(message, RUNS.type))

    return serialize, announce

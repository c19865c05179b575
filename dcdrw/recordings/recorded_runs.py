"""The runs that a source announced in a recording: knows no ROS."""

from collections.abc import Iterator

import numpy as np

from dcdrw.recordings.bag_file import Stream
from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.recordings.recording import Recording
from dcdrw_msgs_py.samples import SECOND, Runs
from dcdrw_msgs_py.topics import RUNS


def runs_topic(joints: str) -> Stream:
    """Where the source of joint states announces its runs: in the same namespace."""
    return Stream(joints.rpartition('/')[0] + f'/{RUNS.name}', RUNS.type)


def recorded_runs(recording: Recording, joints: str) -> Runs:
    """The runs of the source of a topic of joint states; none where it announced none."""
    runs = Runs()
    for _, _, header in recording.decoded([runs_topic(joints)]):
        runs.announce(header.stamp.sec * SECOND + header.stamp.nanosec, header.frame_id)
    return runs


def with_runs(batches: Iterator[JointBatch], runs: Runs) -> Iterator[JointBatch]:
    """The same batches, each message with its run."""
    for batch in batches:
        yield batch._replace(run=np.array([runs.of(stamp) for stamp in batch.stamp_ns.tolist()], np.int64))

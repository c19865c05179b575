"""What the trials of these tests have in common."""

import math
from collections.abc import Sequence

import numpy as np

from dcdrw.recordings.joint_batch import JointBatch
from dcdrw_msgs_py.samples import JointSample
from dcdrw_msgs_py.topics import COUPLER, FRONT_WHEEL, REAR_WHEEL

FIRST = 'dcdrw trial --rig my_rig.yaml --out trials/first'
"""As the docs have it: what `live_trial` runs, with a rig and options of its own."""
STIFF = '/**:\n  ros__parameters:\n    k: 60\n    rate: 200\n'


def batch(samples: Sequence[JointSample], force: float = math.nan) -> JointBatch:
    """Joint states as a recording has them, which came when their stamps say."""
    stamps = np.array([sample.stamp_ns for sample in samples], np.int64)
    turns = np.array([(*sample.front, *sample.rear) for sample in samples])
    nothing = np.full((len(samples), 1), math.nan)
    return JointBatch(
        '',
        (FRONT_WHEEL, REAR_WHEEL, COUPLER),
        stamps,
        np.hstack([turns[:, [0, 2]], nothing]),
        np.hstack([turns[:, [1, 3]], nothing]),
        np.hstack([np.full((len(samples), 2), math.nan), np.full_like(nothing, force)]),
        log_ns=stamps,
    )

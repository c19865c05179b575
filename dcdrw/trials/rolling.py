"""The part of a recorded trial in which both wheels roll by themselves, as samples to identify a rig from."""

import math

import numpy as np

from dcdrw.trials.analysis import Analysis
from dcdrw.trials.motion import MotionTable
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.identification.samples import Samples, free_rolling


def rolling_samples(
    trial: Analysis, motion: MotionTable, rig: RigParams, begin: float = 0.0, end: float = math.inf
) -> Samples:
    """The samples of the last run of a trial, from one time to another, as far as both wheels roll.

    Args:
        trial: as it was analyzed.
        motion: all its samples.
        rig: whose wheels they are.
        begin: time in the trial [s].
        end: likewise.

    Raises:
        ValueError: there are too few.

    """
    if trial.resumed:
        motion = motion.rows(motion.row >= trial.resumed.row)
    if not len(motion.stamp_ns):
        raise ValueError(trial.why_not_run or 'there are no joint states')
    seconds = motion.seconds
    chosen = (motion.restarts == motion.restarts[-1]) & (seconds >= begin) & (seconds <= end)
    return free_rolling(rig, seconds[chosen], np.column_stack([motion.rotation1, motion.rotation2])[chosen])

"""A simulated rig before a virtual camera: the parameters of both, and how far off the truth the tracked wheels are."""

import argparse
import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.suite.parameter_file import TrialParams, with_rig_options
from dcdrw.trials.motion import MotionTable
from dcdrw_msgs_py.rig import WheelShape
from dcdrw_msgs_py.rolling import phi_pitch, steps_ahead
from dcdrw_msgs_py.tagging import TagParams, mounts
from dcdrw_msgs_py.topics import FRONT_WHEEL, REAR_WHEEL
from dcdrw_msgs_py.words import counted
from dcdrw_sim.camera.render import LookParams
from dcdrw_sim.camera.scene import SceneParams, ViewParams
from dcdrw_sim.camera.shutter import ShutterParams
from dcdrw_tracker.tags.wheel_view import PairViewParams
from dcdrw_tracker.wheels.wheel_track import TrackParams


class FilmedRig(NamedTuple):
    """The parameters of `virtual_camera` and of `tag_tracker`."""

    scene: SceneParams = SceneParams()
    view: ViewParams = ViewParams()
    look: LookParams = LookParams()
    shutter: ShutterParams = ShutterParams()
    tags: TagParams = TagParams()
    pair_view: PairViewParams = PairViewParams()
    track: TrackParams = TrackParams()


def filmed_rig(options: argparse.Namespace, params: TrialParams) -> FilmedRig:
    """The camera and the tracker for a rig; what --rig says of them counts.

    Raises:
        ValueError, OSError: as `read_parameter_file`; impossible tags, encoding or occluder, or no such camera file.

    """
    rig = params.rig
    front, rear = (WheelShape(wheel.length, wheel.spokes) for wheel in (rig.front, rig.rear))
    filmed = FilmedRig(
        SceneParams(front, rear, rig.S0, rig.slope), track=TrackParams(front, rear, rig.slope, rig.gravity)
    )
    filmed = with_rig_options(options, filmed)
    mounts(filmed.tags)
    filmed.look.check_occluder()
    filmed.shutter.check_encoding()
    filmed.view.make_camera()
    return filmed._replace(track=filmed.track._replace(camera_follows=filmed.view.follow))


class TruthError(NamedTuple):
    """How far the tracked wheels are off the simulated ones."""

    phi_deg: float
    """Root mean square error of φ [°]."""
    frames: int

    def __str__(self) -> str:
        frames = counted(self.frames, 'frame')
        return f"Against the simulator's own joint states, φ is {self.phi_deg:.3f}° off (rms of {frames})."


def truth_error(motion: MotionTable, params: TrialParams, truth: Iterable[JointBatch]) -> TruthError | None:
    """Compare φ with the truth, which is interpolated between its samples; None where they have no time in common."""
    parts = [
        (batch.stamp_ns, batch.position[:, [batch.names.index(name) for name in (FRONT_WHEEL, REAR_WHEEL)]])
        for batch in truth
        if not batch.error
    ]
    if not parts or not len(motion.stamp_ns):
        return None
    stamps, psi = (np.concatenate(column) for column in zip(*parts, strict=True))
    both = (motion.stamp_ns >= stamps[0]) & (motion.stamp_ns <= stamps[-1])
    if not both.any():
        return None
    times = (motion.stamp_ns[both] - stamps[0]) * 1e-9
    psi1, psi2 = (np.interp(times, (stamps - stamps[0]) * 1e-9, column) for column in psi.T)
    front, rear = params.phase.front, params.phase.rear
    pitch = phi_pitch(front, rear)
    off = motion.phi[both] / pitch - steps_ahead(front, rear, psi1, psi2)
    error = pitch * (off - np.round(off))
    return TruthError(math.degrees(math.sqrt(float((error**2).mean()))), int(both.sum()))

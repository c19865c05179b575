"""From a picture to the phase: what `benchmarks/tags.py` measures at length, in a few frames."""

import math

import numpy as np
import pytest

from dcdrw_msgs_py.samples import JointSample, Turn
from dcdrw_msgs_py.tagging import TagParams, mounts
from dcdrw_sim.camera.render import LookParams, Renderer
from dcdrw_sim.camera.scene import Footing, SceneParams, ViewParams
from dcdrw_tracker.tags.detector import TagDetector
from dcdrw_tracker.tags.tag_follower import TagFollower
from dcdrw_tracker.tags.wheel_view import PairViewer, PairViewParams

pytest.importorskip('cv2')
SCENE, TAGS = SceneParams(), TagParams()


def film(count: int) -> list[JointSample]:
    """A pair that rolls at a common pace, at 60 frames/s."""
    return [
        JointSample(round(k / 60 * 1e9), Turn(0.02 * k - 0.2, 1.2), Turn(0.02 * k - 0.35, 1.2)) for k in range(count)
    ]


@pytest.mark.parametrize(
    ('side', 'view', 'blur', 'degrees'),
    [
        (120.0, ViewParams(), 0.0, 0.1),
        (40.0, ViewParams(k1=-0.25, k2=0.08), 0.0, 0.3),
        (100.0, ViewParams(pan_deg=30.0), 2.0, 0.5),
        (60.0, ViewParams(pan_deg=-45.0, height=2.0, roll_deg=4.0), 0.0, 0.3),
    ],
)
def test_the_phase_is_within_the_figures_that_a_lab_is_promised(side, view, blur, degrees):
    camera = view.make_camera()
    view = view._replace(
        distance=SCENE.tag_plane(SCENE.mounts(TAGS)[0]) + float(camera.matrix[0, 0]) * TAGS.size / side
    )
    renderer = Renderer(SCENE, view, LookParams(exposure=0.001, blur_px=blur), TAGS, camera, False)
    follower = TagFollower(TagDetector(ids=(0, 1)), (0, 1))
    viewer = PairViewer(mounts(TAGS), camera, SCENE.slope, PairViewParams(roll_deg=view.roll_deg))
    errors, truths = [], film(50)
    footing = Footing(SCENE, truths[0])
    for truth in truths:
        sighting = follower.follow(renderer.draw(footing, truth), truth.stamp_ns)
        pair = viewer.view(truth.stamp_ns, sighting.detections)
        errors.append([view.rotation - turn.angle for view, turn in zip(pair[1:], truth[1:3], strict=True)])
    # The plane is learned in the first frames.
    settled = np.degrees([[math.remainder(error, math.tau) for error in both] for both in errors[20:]])
    assert np.sqrt(np.mean(np.diff(settled) ** 2)) < degrees
    assert np.sqrt(np.mean(settled**2)) < degrees

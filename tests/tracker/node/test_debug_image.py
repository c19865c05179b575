"""What is drawn into the debug picture is where the renderer has it, however obliquely the camera looks."""

import math
from functools import partial

import numpy as np
import pytest

from dcdrw_msgs_py.frame import Frame
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import JointSample, Turn
from dcdrw_msgs_py.tagging import TagGroup, TagParams
from dcdrw_sim.camera.render import LookParams, Renderer
from dcdrw_sim.camera.scene import Footing, SceneParams, ViewParams
from dcdrw_tracker.node.debug_image import FRONT_COLOUR, REAR_COLOUR, STANCE_COLOUR, draw
from dcdrw_tracker.node.tag_tracker import TagTracker
from dcdrw_tracker.tags.wheel_view import PairViewParams
from dcdrw_tracker.wheels.wheel_track import TrackParams

RIG, SCENE = RigParams(), SceneParams()
OFF_THE_HUB = TagParams(
    front=TagGroup((0,), (20.0,), (0.12,), (-0.07,)), rear=TagGroup((1,), (-35.0,), (-0.1,), (0.09,), standoff=0.4)
)
CAP = 2.0
"""A line of 4 px ends in a cap so long [px]."""


def film(view, tags, frames=24):
    """The last frame of a film, what was drawn of it, the truth of both stance legs [px]."""
    camera = view.make_camera()
    renderer = Renderer(SCENE, view, LookParams(exposure=0.0), tags, camera, False)
    tracker = TagTracker(tags, PairViewParams(roll_deg=view.roll_deg), TrackParams(camera_follows=True))
    tracker.look_through(camera)
    footing = None
    for k in range(frames):
        joints = JointSample(round(k / 60 * 1e9), Turn(0.02 * k - 0.2, 1.2), Turn(0.02 * k - 0.35, 1.2))
        footing = footing or Footing(SCENE, joints)
        image = renderer.draw(footing, joints)
        tracked = tracker.process(Frame(joints.stamp_ns, image))
    drawn = draw(np.zeros_like(image), tracked, tracker.mounts, camera, (RIG.front, RIG.rear))
    places = footing.places(joints.front.angle, joints.rear.angle)
    project = partial(pixels, camera, renderer.pose(places))
    return drawn, [leg(project, place, plane) for place, plane in zip(places, SCENE.wheel_planes, strict=True)]


def pixels(camera, pose, points):
    return camera.project(pose.optical(points))


def leg(project, place, plane):
    """Hub and foot of the stance leg, as the geometry has them."""
    foot = math.remainder(place.psi, 2.0 * RIG.front.alpha)
    return project([(place.along, plane, place.above), (place.along - RIG.front.length * math.sin(foot), plane, 0.0)])


def strokes(drawn, colour, hub, foot):
    """Pixels of a colour near a leg: how far along it from the hub to the foot, and how far beside it [px]."""
    y, x = np.nonzero((np.abs(drawn.astype(int) - colour) < 40).all(axis=2))
    length = np.hypot(*(foot - hub))
    along = (foot - hub) / length
    offset = np.column_stack((x, y)) - hub
    return offset @ along, offset @ (-along[1], along[0]), length


@pytest.mark.parametrize('tags', [TagParams(), OFF_THE_HUB], ids=['on the hub', 'off the hub'])
@pytest.mark.parametrize(
    'view',
    [
        ViewParams(),
        ViewParams(pan_deg=30.0),
        ViewParams(pan_deg=45.0, roll_deg=3.0),
        ViewParams(pan_deg=-45.0, k1=-0.15, k2=0.04),
    ],
    ids=['face-on', '30°', '45°, leaning', '−45°, distorted'],
)
def test_hubs_and_stance_legs_are_drawn_within_three_pixels_of_the_truth(view, tags):
    drawn, legs = film(view, tags)
    for (hub, foot), colour in zip(legs, (FRONT_COLOUR, REAR_COLOUR), strict=True):
        along, beside, length = strokes(drawn, STANCE_COLOUR, hub, foot)
        own = (np.abs(beside) < 8.0) & (along > 0.3 * length)
        assert along[own].max() - CAP == pytest.approx(length, abs=3.0)
        assert beside[own & (along > 0.9 * length)].mean() == pytest.approx(0.0, abs=3.0)
        along, beside, _ = strokes(drawn, colour, hub, foot)
        ring = np.abs(np.hypot(along, beside) - 7.0) < 4.0  # the circle about the hub, 7 px in radius
        assert np.hypot(along[ring].mean(), beside[ring].mean()) < 3.0

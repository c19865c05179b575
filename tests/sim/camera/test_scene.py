"""Where wheels, tags and camera are."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_msgs_py.rig import RigParams, WheelShape
from dcdrw_msgs_py.samples import CouplerSample, JointSample, Turn
from dcdrw_msgs_py.tagging import seen
from dcdrw_sim.camera.scene import Footing, SceneParams, ViewParams, WheelPlace, camera_pose
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams

SCENE = SceneParams()
ALPHA = SCENE.front.alpha


def joints(psi1: float, psi2: float, length: float = math.nan) -> JointSample:
    return JointSample(0, Turn(psi1), Turn(psi2), CouplerSample(length))


def pixels(scene: SceneParams, view: ViewParams, points: object) -> np.ndarray:
    pose = camera_pose(scene, view.resolved(scene))
    return view.make_camera().project(pose.optical(points))


@pytest.mark.parametrize('start', [21.6, 0.0, 45.0, 80.0])
@pytest.mark.parametrize('told', [True, False], ids=['coupler told', 'rotations alone'])
def test_hubs_are_as_far_apart_as_in_the_simulation(start, told):
    rig = RigParams(slope=math.radians(3.0))
    source = SimulatedRig(rig, SimulatorParams(initial_phase_percent=start))
    first = source.read(0.0, 0)
    footing = Footing(SCENE, first if told else first._replace(coupler=CouplerSample()))
    for t in np.arange(0.0, 6.0, 0.01):
        sample = source.read(t, 0)
        front, rear = footing.places(sample.front.angle, sample.rear.angle)
        assert math.hypot(front.along - rear.along, front.above - rear.above) == pytest.approx(
            sample.coupler.length, abs=1e-9
        )


def test_a_camera_that_joins_later_sees_the_same_pair():
    simulation = Simulation(*SimulatorParams().start(RigParams()))
    early, late = ((motion.rotation1, motion.rotation2) for motion in map(simulation.advance_to, (0.0, 5.3)))
    (front, rear), (front_late, rear_late) = (Footing(SCENE, joints(*first)).places(*late) for first in (early, late))
    assert front_late.along - rear_late.along == pytest.approx(front.along - rear.along)
    assert rear_late.along == pytest.approx(SCENE.rear.length * math.sin(simulation.state.theta2))


@given(st.floats(-50.0, 50.0), st.sampled_from([6.0, 12.0, 12.5]))
def test_the_stance_foot_stays_where_it_is_and_no_spoke_is_below_the_ground(psi, spokes):
    shape = WheelShape(0.9, spokes)
    alpha = shape.alpha
    scene = SceneParams(rear=shape)
    _, place = Footing(scene, joints(0.0, 0.0)).places(0.0, psi)
    steps = math.floor((psi + alpha) / (2 * alpha))
    # In the wheel's own frame, spoke k stands at ψ = 2αk.
    angles = -0.5 * math.pi + 2 * alpha * np.arange(steps - 2, steps + 3)
    feet = place.points(shape.length * np.stack((np.cos(angles), np.sin(angles)), axis=-1), 0.0)
    assert feet[2] == pytest.approx((steps * shape.step_length, 0.0, 0.0), abs=1e-9)
    assert feet[:, 2].min() == pytest.approx(0.0, abs=1e-9)


def test_hubs_move_on_without_jumps():
    footing = Footing(SCENE, joints(0.0, 0.0))
    psi = np.linspace(-3.0, 3.0, 3001)
    along = np.array([footing.places(angle, angle)[0][:2] for angle in psi])
    assert np.hypot(*np.diff(along, axis=0).T).max() < SCENE.front.length * 0.002 * (1 + 1e-9)
    assert np.all(np.diff(along[:, 0]) > 0.0)


def test_downhill_is_left_and_rolling_downhill_turns_counter_clockwise():
    uphill, here, downhill = pixels(SCENE, ViewParams(), [(x, 0.0, 0.9) for x in (-0.3, 0.0, 0.3)])
    assert downhill[0] < here[0] < uphill[0]
    assert downhill[1] > here[1] > uphill[1], 'the slope falls'
    hub = np.array((0.0, SCENE.wheel_planes[0], 1.0))
    spoke = [
        np.subtract(*pixels(SCENE, ViewParams(), [WheelPlace(0.0, 1.0, psi).points((0.0, 0.3), hub[1]), hub]))
        for psi in (0.0, 0.4)
    ]
    angles = [math.atan2(-y, x) for x, y in spoke]
    assert angles[1] - angles[0] == pytest.approx(0.4, abs=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-0.5, 0.5), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_a_camera_face_on_sees_what_the_tags_convention_says(psi, slope, x, y):
    scene = SCENE._replace(slope=slope)
    view = ViewParams(height=0.0, tilt_deg=0.0)
    hub, point = pixels(scene, view, [WheelPlace(0.0, 0.0, psi).points(p, 0.0) for p in ((0.0, 0.0), (x, y))])
    camera = view.make_camera()
    scale = camera.matrix[0, 0] / view.resolved(scene).distance
    picture = seen((x, y), psi, slope) * scale
    assert point - hub == pytest.approx((picture.real, -picture.imag), abs=1e-6)


def test_camera_aims_at_the_hubs_from_its_distance_whatever_the_pan_and_height():
    for view in (ViewParams(), ViewParams(pan_deg=40.0, height=2.0), ViewParams(pan_deg=-30.0, roll_deg=20.0)):
        camera, up = view.make_camera(), (-math.sin(SCENE.slope), 0.0, math.cos(SCENE.slope))
        target = SCENE.hub_height * np.array(up)
        assert pixels(SCENE, view, [target])[0] == pytest.approx(camera.matrix[:2, 2], abs=1e-9)
        position = camera_pose(SCENE, view.resolved(SCENE)).position
        level = position - np.dot(position, up) * np.array(up)
        assert np.linalg.norm(level) == pytest.approx(3.8 * SCENE.hub_height)


def test_an_oblique_view_stands_to_the_downhill_side():
    position = camera_pose(SCENE._replace(slope=0.0), ViewParams(pan_deg=30.0).resolved(SCENE)).position
    assert math.degrees(math.atan2(position[0], position[1])) == pytest.approx(30.0)


def test_leaning_to_the_right_turns_the_picture_counter_clockwise():
    start, end = pixels(SCENE._replace(slope=0.0), ViewParams(roll_deg=10.0), [(0.3, 0.0, 0.9), (-0.3, 0.0, 0.9)])
    right, down = end - start
    assert math.degrees(math.atan2(-down, right)) == pytest.approx(10.0)

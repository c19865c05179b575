"""What is drawn is where the geometry says; what is added to it does what it says."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

from dcdrw_msgs_py.camera import Camera, write_camera
from dcdrw_msgs_py.opencv import tag_cells, tag_dictionary
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import CouplerSample, JointSample, Turn
from dcdrw_msgs_py.tagging import TagGroup, TagParams, corners
from dcdrw_msgs_py.values import Floats
from dcdrw_sim.camera.render import LookParams, Renderer
from dcdrw_sim.camera.scene import Footing, SceneParams, ViewParams, camera_pose
from tests import ROOT

cv2 = pytest.importorskip('cv2')
SCENE, TAGS = SceneParams(), TagParams()
SHARP = LookParams(exposure=0.0, noise=0.0)
SMALL = ViewParams(image_width=320, image_height=180)
LENS = {'k1': -0.25, 'k2': 0.06}
# The sides of the tags are about 52, 120, 75 and 40 px long.
VIEWS = {
    'face-on': ViewParams(),
    'close': ViewParams(distance=1.9, field_of_view_deg=70.0),
    'oblique': ViewParams(pan_deg=40.0, height=1.7, distance=3.0, roll_deg=5.0),
    'distorted': ViewParams(pan_deg=-30.0, distance=2.4, field_of_view_deg=80.0, **LENS),
    'far': ViewParams(distance=4.6, field_of_view_deg=62.0, **LENS),
}


def sample(psi1: float = -0.2, psi2: float = 0.1, rate: float = 0.0, stamp_ns: int = 0) -> JointSample:
    return JointSample(stamp_ns, Turn(psi1, rate), Turn(psi2, rate))


@cache
def make(
    view: ViewParams = VIEWS['face-on'],
    look: LookParams = SHARP,
    tags: TagParams = TAGS,
    colour: bool = False,
    scene: SceneParams = SCENE,
) -> Renderer:
    return Renderer(scene, view, look, tags, view.make_camera(), colour)


def detect(image: Any) -> dict[int, Floats]:
    """ArUco's corners by id, in the order of `corners`: its upright is half a turn from AprilTag's."""
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    dictionary = tag_dictionary('36h11')
    if hasattr(cv2.aruco, 'ArucoDetector'):
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_CONTOUR
        found, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)
    else:
        parameters = cv2.aruco.DetectorParameters_create()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_CONTOUR
        found, ids, _ = cv2.aruco.detectMarkers(image, dictionary, parameters=parameters)
    return (
        {}
        if ids is None
        else {
            int(tag): grown(np.roll(corner[0], 2, axis=0).astype(float))
            for tag, corner in zip(np.ravel(ids), found, strict=True)
        }
    )


def grown(corner: Floats) -> Floats:
    """A square whose contour runs through the middle of the outermost dark pixels, half a pixel larger all around."""
    outward = corner - corner.mean(axis=0)
    return corner + math.sqrt(0.5) * outward / np.hypot(*outward.T)[:, None]


@pytest.mark.parametrize('view', VIEWS.values(), ids=VIEWS)
def test_tag_corners_are_where_the_camera_projects_the_geometry(view):
    renderer, joints = make(view), sample()
    footing = Footing(SCENE, joints)
    places = footing.places(joints.front.angle, joints.rear.angle)
    pose = camera_pose(SCENE, view.resolved(SCENE)).moved(0.5 * (places[0].along + places[1].along))
    for mount, place in zip(SCENE.mounts(TAGS), places, strict=True):
        expected = view.make_camera().project(pose.optical(place.points(corners(mount), SCENE.tag_plane(mount))))
        assert renderer.tag_pixels(footing, joints)[mount.id] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize('view', VIEWS.values(), ids=VIEWS)
def test_aruco_finds_the_tags_where_they_are(view):
    renderer = make(view, colour=view == VIEWS['close'])
    for joints in (sample(), sample(0.13, 0.4), sample(2.0, 2.15)):
        footing = Footing(SCENE, joints)
        found, truth = detect(renderer.draw(footing, joints)), renderer.tag_pixels(footing, joints)
        assert found.keys() == truth.keys() == {0, 1}
        for tag, corner in truth.items():
            assert np.hypot(*(found[tag] - corner).T).mean() < 0.25
            assert found[tag].mean(axis=0) == pytest.approx(corner.mean(axis=0), abs=0.2)


def averaged(camera: Camera, square: Floats, cells: Any, fine: int) -> tuple[Any, tuple[slice, slice]]:
    """A tag by brute force: the mean of fine² exact samples of each pixel around its corners in the optical frame."""
    image = camera.project(square)
    (left, top), (right, bottom) = np.floor(image.min(axis=0)).astype(int), np.ceil(image.max(axis=0)).astype(int) + 1
    inside = (np.arange(fine) + 0.5) / fine - 0.5
    x = (np.arange(left, right)[:, None] + inside).ravel()
    y = (np.arange(top, bottom)[:, None] + inside).ravel()
    rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    origin, across, down = square[0], square[1] - square[0], square[3] - square[0]
    at = np.linalg.solve(np.column_stack((across, down, origin)), np.column_stack((rays, np.ones(len(rays)))).T)
    u, v = (np.floor(at[:2] / at[2] * len(cells))).astype(int)
    outside = (u < 0) | (v < 0) | (u >= len(cells)) | (v >= len(cells))
    white = cells[np.clip(v, 0, len(cells) - 1), np.clip(u, 0, len(cells) - 1)] | outside
    grey = np.where(white, 235.0, 25.0).reshape(bottom - top, fine, right - left, fine).mean(axis=(1, 3))
    return grey, (slice(top, bottom), slice(left, right))


@pytest.mark.parametrize('view', VIEWS.values(), ids=VIEWS)
def test_tags_are_exact_to_a_fiftieth_of_a_pixel(view):
    renderer, camera = make(view), view.make_camera()
    for joints in (sample(0.0, 0.0), sample(0.11, 0.31)):
        footing = Footing(SCENE, joints)
        image = renderer.draw(footing, joints).astype(float)
        places = footing.places(joints.front.angle, joints.rear.angle)
        for mount, place in zip(SCENE.mounts(TAGS), places, strict=True):
            square = renderer.pose(places).optical(place.points(corners(mount), SCENE.tag_plane(mount)))
            exact, where = averaged(camera, square, tag_cells('36h11', mount.id), 8)
            # Fit drawn = a + b exact - exact's gradient · shift, on all pixels of the black square.
            down, across = np.gradient(exact)
            terms = np.stack((np.ones_like(exact), exact, across, down), axis=-1)[2:-2, 2:-2].reshape(-1, 4)
            fit = np.linalg.lstsq(terms, image[where][2:-2, 2:-2].ravel(), rcond=None)[0]
            assert -fit[2:] / fit[1] == pytest.approx((0.0, 0.0), abs=0.02)
            assert fit[1] == pytest.approx(1.0, abs=0.15)


def test_another_detector_agrees_which_way_a_tag_is_up():
    pupil = pytest.importorskip('pupil_apriltags')
    renderer, joints = make(VIEWS['close']), sample()
    footing = Footing(SCENE, joints)
    truth = renderer.tag_pixels(footing, joints)
    detector = pupil.Detector('tag36h11')
    detector.tag_families.clear()  # its destructor, which frees them twice, damages the heap
    found = {tag.tag_id: tag.corners for tag in detector.detect(renderer.draw(footing, joints))}
    assert found.keys() == truth.keys()
    for tag, corner in truth.items():  # its order is counter-clockwise, and its pixels' corners have whole coordinates
        assert found[tag][::-1] - 0.5 == pytest.approx(corner, abs=0.3)


def test_rolling_downhill_goes_left_and_turns_counter_clockwise_in_the_picture():
    renderer = make(ViewParams(follow=False, distance=5.0))
    footing = Footing(SCENE, sample())
    before, after = (detect(renderer.draw(footing, sample(-0.2 + turn, 0.1 + turn))) for turn in (0.0, 0.2))
    for tag in (0, 1):
        assert after[tag].mean(axis=0)[0] < before[tag].mean(axis=0)[0] - 20.0
        right, down = np.stack([found[tag][1] - found[tag][0] for found in (before, after)], axis=1)
        angles = np.arctan2(-down, right)
        assert angles[1] - angles[0] == pytest.approx(0.2, abs=0.03)


def test_following_keeps_the_pair_in_the_middle():
    renderer = make()
    footing = Footing(SCENE, sample())
    for turn in np.linspace(0.0, 20.0, 7):
        found = detect(renderer.draw(footing, sample(-0.2 + turn, 0.1 + turn)))
        assert np.mean([corner.mean(axis=0)[0] for corner in found.values()]) == pytest.approx(639.5, abs=25.0)


def test_several_tags_on_a_wheel_are_all_drawn():
    tags = TagParams(
        size=0.12,
        front=TagGroup((3, 4), (0.0, 90.0), (0.0, 0.3), (0.0, 0.1)),
        rear=TagGroup((5,), (45.0,), (0.0,), (0.2,)),
    )
    renderer, joints = make(tags=tags), sample()
    footing = Footing(SCENE, joints)
    truth, found = renderer.tag_pixels(footing, joints), detect(renderer.draw(footing, joints))
    assert found.keys() == truth.keys() == {3, 4, 5}
    for tag, corner in truth.items():
        assert found[tag] == pytest.approx(corner, abs=0.4)


def test_exposure_smears_along_the_motion_and_keeps_the_middle():
    renderer = make(look=SHARP._replace(exposure=0.03))
    footing = Footing(SCENE, sample())
    sharp, smeared = (renderer.draw(footing, sample(rate=rate)).astype(float) for rate in (0.0, 2.0))
    turns = [
        renderer.draw(footing, sample(-0.2 + turn, 0.1 + turn)).astype(float) for turn in np.linspace(-0.03, 0.03, 31)
    ]
    assert float(np.abs(smeared - np.mean(turns, axis=0)).mean()) < 0.2 * float(np.abs(smeared - sharp).mean())
    found, truth = detect(smeared.astype(np.uint8)), renderer.tag_pixels(footing, sample())
    for tag, corner in truth.items():
        assert found[tag].mean(axis=0) == pytest.approx(corner.mean(axis=0), abs=0.2)


def test_noise_brightness_and_blur_do_what_they_say():
    joints = sample()
    footing = Footing(SCENE, joints)
    clean = make(SMALL).draw(footing, joints).astype(float)

    def changed(**look: float) -> Floats:
        return make(SMALL, SHARP._replace(**look)).draw(footing, joints).astype(float)

    noise = changed(noise=5.0) - clean
    assert float(noise.std()) == pytest.approx(5.0, rel=0.05)
    assert float(noise.mean()) == pytest.approx(0.0, abs=0.1)
    assert float(np.abs(changed(brightness=0.5) - 0.5 * clean).max()) < 0.51
    assert float(np.abs(changed(blur_px=2.0) - cv2.GaussianBlur(clean, (0, 0), 2.0)).max()) < 2.0
    renderer = make(SMALL, SHARP._replace(noise=5.0))
    assert (renderer.draw(footing, joints) != renderer.draw(footing, joints)).any(), 'each frame has noise of its own'


@pytest.mark.parametrize(('whose', 'seen'), [('front', {1}), ('rear', {0}), ('both', set()), ('', {0, 1})])
def test_occluder_hides_whom_it_should_and_when(whose, seen):
    look = SHARP._replace(occlude=whose, occlude_from=1.0, occlude_for=0.5, occlude_every=2.0)
    renderer, joints = make(VIEWS['distorted'], look), sample()
    footing = Footing(SCENE, joints)
    for time, hides in ((0.99, False), (1.0, True), (1.49, True), (1.51, False), (3.2, True), (4.9, False)):
        assert detect(renderer.draw(footing, joints, time)).keys() == (seen if hides else {0, 1})


def test_an_occluder_that_hides_nobody_is_refused():
    with pytest.raises(ValueError, match="occlude must be front, rear, both or empty, got 'left'"):
        make(look=LookParams(occlude='left'))


def test_camera_file_gives_the_camera(tmp_path):
    camera = ViewParams(image_width=640, image_height=400, **LENS).make_camera()
    write_camera(tmp_path / 'camera.yaml', camera)
    view = ViewParams(camera=str(tmp_path / 'camera.yaml'))
    assert make(view, colour=True).draw(Footing(SCENE, sample()), sample()).shape == (400, 640, 3)
    assert view.make_camera().distortion == pytest.approx(camera.distortion)


def test_example_camera_file_is_one():
    camera = ViewParams(camera=str(ROOT / 'config' / 'camera.yaml')).make_camera()
    assert (camera.width, camera.height) == (1280, 720)


def test_colour_and_grey_show_the_same():
    joints = sample()
    footing = Footing(SCENE, joints)
    grey, colour = (make(SMALL, colour=colour).draw(footing, joints) for colour in (False, True))
    assert int(np.abs(cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY).astype(int) - grey).max()) <= 8


def test_small_and_large_rigs_look_alike():
    rig = RigParams()
    small = SceneParams(*(shape._replace(length=0.1) for shape in SCENE.wheels))
    tags = TAGS._replace(size=TAGS.size * 0.1 / rig.front.length)
    one, other = (
        make(SMALL, scene=scene, tags=tag).draw(Footing(scene, sample()), sample()).astype(int)
        for scene, tag in ((SCENE, TAGS), (small, tags))
    )
    assert float((np.abs(one - other) > 3).mean()) < 0.001


@pytest.mark.parametrize(
    'odd',
    [
        {'distance': 0.3},
        {'distance': 0.05},
        {'pan_deg': 75.0},
        {'tilt_deg': 80.0},
        {'follow': False, 'place': 500.0},
        {'roll_deg': 180.0},
        {'image_width': 16},
        {'field_of_view_deg': 120.0, 'k1': -0.3},
    ],
    ids=str,
)
def test_odd_views_are_drawn_without_complaint(odd):
    view = SMALL._replace(**odd)
    renderer = make(view, LookParams())
    for joints in (
        sample(rate=1.0),
        sample(1e9, -1e9, 100.0),
        sample(rate=math.nan),
        sample(rate=-1e308),
        sample()._replace(coupler=CouplerSample(1e300)),
    ):
        image = renderer.draw(Footing(SCENE, joints), joints, 3.0)
        assert image.shape == (view.image_height, view.image_width)

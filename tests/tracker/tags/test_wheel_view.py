import math
from typing import NamedTuple

import numpy as np
import pytest

from dcdrw_msgs_py.camera import Camera, make_camera
from dcdrw_msgs_py.tagging import Mount, TagParams, corners, mounts, seen
from dcdrw_tracker.tags.detector import Detection
from dcdrw_tracker.tags.wheel_view import PairViewer, PairViewParams

MATRIX = (1000.0, 0.0, 639.5, 0.0, 1000.0, 359.5, 0.0, 0.0, 1.0)
CAMERA = make_camera(1280, 720, MATRIX, 'plumb_bob', (-0.25, 0.08, 0.001, -0.0005, 0.0))
SLOPE = math.radians(2.0)
FRONT, REAR = mounts(TagParams())


class Tripod(NamedTuple):
    """A camera before the wheels, made from rotations about its own axes."""

    pan: float = 0.0
    """Turned to the left [deg]: the right of the picture is then the nearer."""
    tilt: float = 0.0
    """Looks down [deg]."""
    roll: float = 0.0
    """Leans to its right [deg]."""
    distance: float = 2.0
    """Distance of the plane along the line of sight [m]."""
    camera: Camera = CAMERA

    def rotation(self):
        """From the level frame (right, down, and the plane's normal away from the camera) to the optical frame."""
        pan, tilt, roll = np.radians((self.pan, self.tilt, self.roll))
        about_down = ((math.cos(pan), 0, math.sin(pan)), (0, 1, 0), (-math.sin(pan), 0, math.cos(pan)))
        about_right = ((1, 0, 0), (0, math.cos(tilt), -math.sin(tilt)), (0, math.sin(tilt), math.cos(tilt)))
        about_sight = ((math.cos(roll), math.sin(roll), 0), (-math.sin(roll), math.cos(roll), 0), (0, 0, 1))
        return np.array(about_sight) @ np.array(about_right) @ np.array(about_down)

    def pixels(self, picture, depth=0.0):
        """Pixels of points right + 1j up of the plane, or of one that is further by `depth`."""
        points = np.stack((picture.real, -picture.imag, np.full(picture.shape, depth)), axis=-1)
        return self.camera.project(points @ self.rotation().T + (0.0, 0.0, self.distance))

    def see(
        self,
        mount: Mount,
        psi: float,
        along: float,
        above: float = 0.0,
        depth: float = 0.0,
        noise: float = 0.0,
        random=None,
    ) -> Detection:
        """A tag whose wheel has turned by ψ, its hub so far down the slope and above the middle of the picture."""
        picture = seen(corners(mount), psi, SLOPE) + seen((along, above), slope=SLOPE)
        pixels = self.pixels(picture, depth)
        return Detection(mount.id, pixels + (random.normal(0.0, noise, (4, 2)) if noise else 0.0))


VIEWS = {
    'face-on': Tripod(),
    'from the right': Tripod(pan=30.0),
    'from the left and above': Tripod(pan=-40.0, tilt=15.0),
    'steep': Tripod(pan=45.0, tilt=5.0),
    'leaning': Tripod(pan=20.0, roll=7.0),
    'far': Tripod(pan=-30.0, distance=4.0),
}


def viewer(tripod: Tripod = VIEWS['face-on'], tags=(FRONT, REAR), **params) -> PairViewer:
    return PairViewer(tags, tripod.camera, SLOPE, PairViewParams(roll_deg=tripod.roll, **params))


def walk(tripod, one, frames=80, noise=0.05, depth=0.1, seed=0):
    """Views of a pair that rolls past, each with the truth: ψ and place of the front wheel, then of the rear one."""
    random = np.random.default_rng(seed)
    for k in range(frames):
        psi, along = 0.08 * k, 0.4 * tripod.distance * (k / frames - 0.5)
        truth = (psi, along + 0.3), (psi - 0.2, along - 0.2)
        yield (
            one.view(
                k,
                [
                    tripod.see(FRONT, *truth[0], noise=noise, random=random),
                    tripod.see(REAR, *truth[1], depth=depth, noise=noise, random=random),
                ],
            ),
            truth,
        )


def error(view, psi):
    return math.degrees(math.remainder(view.rotation - psi, math.tau))


@pytest.mark.parametrize('tripod', VIEWS.values(), ids=VIEWS)
def test_rotation_and_hub_are_those_of_the_wheel_from_wherever_it_is_seen(tripod):
    one = viewer(tripod)
    views = list(walk(tripod, one))[40:]
    apart = []
    for pair, truth in views:
        for view, (psi, along) in zip(pair[1:], truth, strict=True):
            assert error(view, psi) == pytest.approx(0.0, abs=0.2)
            apart.append((view.hub[0] - along, view.hub[1]))
    # Where the camera stands is not known, but it stands still; and both hubs are seen from there.
    assert np.ptp(apart, axis=0) == pytest.approx((0.0, 0.0), abs=0.01 * tripod.distance)
    normal = tripod.rotation()[:, 2]
    learned = one.plane.axes().normal
    assert math.degrees(math.acos(min(1.0, float(learned @ normal)))) < 0.2
    assert one.plane.uncertainty < math.radians(0.5)
    assert one.refused == 0


def test_a_view_tells_its_quality():
    pair = viewer().view(5, [VIEWS['face-on'].see(FRONT, 0.3, 0.0)])
    assert (pair.stamp_ns, pair.rear) == (5, None)
    assert pair.front.error_px == pytest.approx(0.0, abs=0.01)
    assert pair.front.size_px == pytest.approx(1000.0 * 0.16 / 2.0, rel=0.01)
    assert pair.front.tags == 1


def test_the_zero_is_the_slope_normal():
    tripod = VIEWS['face-on']
    picture = seen(corners(FRONT))  # upright by gravity, on a slope: the wheel has rolled back by γ
    pair = viewer(tripod).view(0, [Detection(0, tripod.pixels(picture))])
    assert math.remainder(pair.front.rotation, math.tau) == pytest.approx(-SLOPE, abs=1e-4)


def test_a_level_that_is_not_the_cameras_turns_all_that_it_sees():
    tripod = Tripod(roll=7.0)
    [front, _] = viewer(tripod._replace(roll=0.0)).view(0, [tripod.see(FRONT, 0.5, 0.0)])[1:]
    assert error(front, 0.5) == pytest.approx(7.0, abs=0.05)  # what a camera sees that leans right turns left


@pytest.mark.parametrize('view', ['face-on', 'far', 'steep'])
def test_the_plane_knows_how_uncertain_it_is(view):
    tripod = VIEWS[view]
    one = viewer(tripod)
    assert one.plane.uncertainty == math.inf
    uncertain = []
    for _ in walk(tripod, one, frames=80):
        uncertain.append(one.plane.uncertainty)
        off = math.acos(min(1.0, float(one.plane.axes().normal @ tripod.rotation()[:, 2])))
        assert off < 5.0 * one.plane.uncertainty
    assert uncertain[-1] < 0.5 * uncertain[0]


RIM = [Mount('front', 10 + i, 0.4 * i, 0.3 * math.cos(2.1 * i), 0.3 * math.sin(2.1 * i), 0.12) for i in range(3)]


def test_several_tags_of_a_wheel_make_one_view():
    tripod = VIEWS['from the right']
    one = viewer(tripod, RIM)
    for k in range(30):
        pair = one.view(k, [tripod.see(mount, 0.1 * k, 0.02 * k) for mount in RIM])
    assert pair.front.tags == 3
    assert error(pair.front, 2.9) == pytest.approx(0.0, abs=0.02)
    hidden = one.view(30, [tripod.see(RIM[1], 3.0, 0.6)])
    assert hidden.front.hub[0] - pair.front.hub[0] == pytest.approx(0.02, abs=1e-3)
    assert error(hidden.front, 3.0) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize('turned', [1, 2, 3])
def test_a_tag_that_was_misread_is_outvoted(turned):
    tripod = VIEWS['face-on']
    one = viewer(tripod, RIM)
    tags = [tripod.see(mount, 0.7, 0.1) for mount in RIM]
    tags[1] = tags[1]._replace(corners=np.roll(tags[1].corners, turned, axis=0))
    pair = one.view(0, tags)
    assert (pair.front.tags, one.refused) == (2, 1)
    assert error(pair.front, 0.7) == pytest.approx(0.0, abs=0.01)


def test_of_two_tags_that_disagree_neither_is_believed():
    tripod = VIEWS['face-on']
    one = viewer(tripod, RIM[:2])
    tags = [tripod.see(RIM[0], 0.7, 0.1), tripod.see(RIM[1], 1.7, 0.1)]
    assert one.view(0, tags).front is None
    assert one.refused == 2


def test_what_is_no_square_in_the_wheels_plane_is_refused():
    one = viewer()
    for _ in walk(VIEWS['face-on'], one, frames=20):
        pass
    bent = VIEWS['face-on'].see(FRONT, 0.0, 0.0)
    bent.corners[0] += (15.0, 10.0)
    assert one.view(99, [bent]).front is None
    assert one.refused == 1


def test_tags_that_are_not_mounted_are_ignored():
    stranger = FRONT._replace(id=77)
    assert viewer().view(0, [VIEWS['face-on'].see(stranger, 0.0, 0.0)])[1:] == (None, None)
    assert viewer().view(0, [])[1:] == (None, None)


def test_a_few_wrong_tags_do_not_bend_the_plane():
    tripod, random = VIEWS['from the right'], np.random.default_rng(3)
    one = viewer(tripod)
    for k in range(80):
        tag = tripod.see(FRONT, 0.1 * k, 0.01 * k - 0.4, noise=0.05, random=random)
        if k % 10 == 9:
            tag = tag._replace(corners=tag.corners + random.normal(0.0, 20.0, (4, 2)))
        one.view(k, [tag])
    normal = tripod.rotation()[:, 2]
    assert math.degrees(math.acos(min(1.0, float(one.plane.axes().normal @ normal)))) < 1.0

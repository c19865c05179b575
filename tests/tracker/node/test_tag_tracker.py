"""Frames of the simulated rig, tracked; and what the tracker says of itself."""

import math
from functools import cache

import numpy as np
import pytest

from dcdrw_msgs_py.camera import pinhole
from dcdrw_msgs_py.diagnosis import RATE_IN, Level
from dcdrw_msgs_py.frame import Frame
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.tagging import TagGroup, TagParams
from dcdrw_sim.camera.render import LookParams, Renderer
from dcdrw_sim.camera.scene import Footing, SceneParams, ViewParams
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams
from dcdrw_tracker.node.debug_image import FRONT_COLOUR, STANCE_COLOUR, draw
from dcdrw_tracker.node.tag_tracker import TagTracker
from dcdrw_tracker.node.tracker_diagnosis import SourceStatus, diagnose_poses, diagnose_tags
from dcdrw_tracker.tags.wheel_view import PairViewParams
from dcdrw_tracker.wheels.wheel_angles import WheelAngles
from dcdrw_tracker.wheels.wheel_track import TrackParams
from tests.tracker.frames import draw as draw_tags
from tests.tracker.frames import square

RIG = RigParams()
TAGS = TagParams(size=0.3)
VIEW = ViewParams(image_width=640, image_height=360)
START_NS = 1_700_000_000_000_000_000
FRESH = SourceStatus(0.0, seconds=0.01)


def tracker(tags=TAGS, view=PairViewParams(), camera=None, **track):  # noqa: B008
    made = TagTracker(tags, view, TrackParams(**track))
    made.look_through(camera or VIEW.make_camera())
    return made


@cache
def film():
    """Three seconds of a simulated trial: frames, each with its truth."""
    rig, scene, rate = SimulatedRig(RIG, SimulatorParams()), SceneParams(), 30.0
    renderer = Renderer(scene, VIEW, LookParams(), TAGS, VIEW.make_camera(), False)
    footing, frames = None, []
    for index in range(90):
        joints = rig.read(index / rate, START_NS + round(index / rate * 1e9))
        footing = footing or Footing(scene, joints)
        frames.append((Frame(joints.stamp_ns, renderer.draw(footing, joints, index / rate)), joints))
    return frames


def apart(angle, truth):
    return abs(math.remainder(angle - truth, math.tau))


def test_filmed_wheels_are_tracked():
    track = tracker(camera_follows=True)
    count, turned, speed = 0, [], []
    for frame, truth in film():
        sample = track.process(frame).sample
        if sample:
            count += 1
            turned += [apart(sample.front.angle, truth.front.angle), apart(sample.rear.angle, truth.rear.angle)]
            speed += [sample.front.rate - truth.front.rate, sample.rear.rate - truth.rear.rate]
    assert count == 90 - 2
    assert math.degrees(np.sqrt(np.mean(np.square(turned)))) < 0.2
    assert np.sqrt(np.mean(np.square(speed[30:]))) < 0.1
    diagnosis = diagnose_tags(track.status(), FRESH)
    assert diagnosis[:2] == (Level.OK, 'tracking both wheels')
    assert [diagnosis.values[f'tags of the {wheel} wheel seen'] for wheel in ('front', 'rear')] == [1, 1]
    assert diagnosis.values[RATE_IN] == pytest.approx(30.0)


def test_a_hidden_tag_is_a_gap_and_no_turn_is_lost():
    track = tracker(camera_follows=True)
    measured = []
    for index, (frame, truth) in enumerate(film()):
        image = frame.image.copy()
        if 30 <= index < 60:
            image[:, 320:] = 100  # somebody stands before the rear wheel
        if sample := track.process(frame._replace(image=image)).sample:
            measured.append((sample, truth))
    off = {round((s.rear.angle - t.rear.angle - s.front.angle + t.front.angle) / math.tau) for s, t in measured}
    assert len(off) == 1
    assert 90 - 30 - 12 <= len(measured) <= 90 - 30
    assert track.status().rear.frames == pytest.approx(60, abs=8)
    assert track.status().angles.lost == 0


def test_colour_and_grey_tell_the_same():
    grey, colour = tracker(), tracker()
    for frame, _ in film()[:20]:
        one = grey.process(frame)
        other = colour.process(frame._replace(image=np.repeat(frame.image[..., None], 3, axis=2)))
        if one.sample:
            assert apart(one.sample.front.angle, other.sample.front.angle) < 1e-3


def test_the_picture_must_have_the_size_of_its_camera():
    track = tracker(camera=pinhole(1280, 720, 60.0))
    with pytest.raises(ValueError, match='the picture is 640x360, but the camera is calibrated for 1280x720'):
        track.process(film()[0][0])


def test_a_new_camera_info_goes_on_with_the_same_turns():
    track = tracker(camera_follows=True)
    last = None
    for index, (frame, _) in enumerate(film()):
        if index == 30:
            track.look_through(VIEW.make_camera())
        sample = track.process(frame).sample or last
        if last:
            assert abs(sample.front.angle - last.front.angle) < 0.1
        last = sample
    assert track.status().angles.lost == 0


@pytest.mark.parametrize(
    ('tags', 'message'),
    [
        (TagParams(front=TagGroup(ids=(1,))), 'tag 1 is mounted twice'),
        (TagParams(family='36h12'), 'family must be one of'),
    ],
)
def test_impossible_tags_are_refused(tags, message):
    with pytest.raises(ValueError, match=message):
        TagTracker(tags, PairViewParams(), TrackParams())


def test_an_unknown_detector_is_refused():
    with pytest.raises(ValueError, match="detector must be aruco or apriltag, got 'eyes'"):
        TagTracker(TAGS, PairViewParams(), TrackParams(), 'eyes')


# --- debug image ---------------------------------------------------------------------------------------------------


def test_debug_image_shows_tags_and_stance_legs_where_they_are():
    track = tracker(camera_follows=True)
    for frame, _ in film()[:20]:
        tracked = track.process(frame)
    before = frame.image.copy()
    picture = draw(frame.image, tracked, track.mounts, VIEW.make_camera(), (RIG.front, RIG.rear))
    assert picture.shape == (360, 640, 3)
    assert (frame.image == before).all()
    for one in tracked.detections:  # stance leg: it goes down from the hub, which is the tag's centre
        x, y = np.rint(one.centre).astype(int)
        green = np.argwhere((picture[y:] == STANCE_COLOUR).all(axis=2))
        near = green[np.abs(green[:, 1] - x) < 80]
        assert near[:, 0].max() > 100
        edge = np.rint(0.5 * (one.corners[1] + one.corners[2])).astype(int)
        colour = picture[edge[1] - 1 : edge[1] + 2, edge[0] - 1 : edge[0] + 2].reshape(-1, 3).tolist()
        if one.id == 0:
            assert list(FRONT_COLOUR) in colour


def test_debug_image_of_a_frame_without_tags_is_the_frame():
    track = tracker()
    blank = np.full((360, 640), 90, np.uint8)
    picture = draw(blank, track.process(Frame(1, blank)), track.mounts, VIEW.make_camera(), (RIG.front, RIG.rear))
    assert (picture == 90).all()


# --- what it says --------------------------------------------------------------------------------------------------


def said(track, tags, count=12):
    picture = draw_tags(tags, 640, 360)
    for index in range(count):
        track.process(Frame(START_NS + index * 33_333_333, picture))
    return diagnose_tags(track.status(), FRESH)[:2]


def test_each_trouble_has_its_message():
    front, rear = (0, square(150, 180, 60)), (1, square(480, 180, 60))
    assert said(tracker(), [front, rear]) == (Level.OK, 'tracking both wheels')
    assert said(tracker(), []) == (
        Level.WARN,
        'no tag is seen; looking for tags 0, 1 (parameters front.ids, rear.ids, family)',
    )
    assert said(tracker(), [front]) == (
        Level.WARN,
        'the rear wheel has never been seen; looking for tag 1 (parameter rear.ids)',
    )
    assert said(tracker(), [front, rear, (1, square(330, 100, 60))]) == (
        Level.WARN,
        'tag 1 is in the picture twice: take the other one away',
    )


def test_a_wheel_that_is_not_seen_any_more_is_told():
    track = tracker()
    front, rear = (0, square(150, 180, 60)), (1, square(480, 180, 60))
    said(track, [front, rear])
    picture = draw_tags([rear], 640, 360)
    for index in range(40):
        track.process(Frame(START_NS + (20 + index) * 33_333_333, picture))
    assert diagnose_tags(track.status(), FRESH)[:2] == (
        Level.WARN,
        'the front wheel is not seen any more; looking for tag 0 (parameter front.ids)',
    )


@pytest.mark.parametrize(
    ('source', 'level', 'message'),
    [
        (SourceStatus(math.inf, waiting='nobody publishes /image_raw'), Level.STALE, 'nobody publishes /image_raw'),
        (SourceStatus(2.0), Level.STALE, 'stale: no frames'),
        (SourceStatus(0.0, problem='no camera_info has come'), Level.ERROR, 'no camera_info has come'),
        (FRESH, Level.WARN, 'the front wheel is not tracked yet'),
    ],
)
def test_the_source_is_judged_first(source, level, message):
    assert diagnose_poses(WheelAngles(TrackParams()).status(), source)[:2] == (level, message)

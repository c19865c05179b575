"""Motion capture against the truth of a walk, placed in a room."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dcdrw_msgs_py.rig import FRONT, REAR, RigParams
from dcdrw_msgs_py.samples import PoseSample
from dcdrw_tracker.tags.wheel_view import PairView
from dcdrw_tracker.wheels.poses import PosePairs, PoseParams
from dcdrw_tracker.wheels.wheel_angles import WheelAngles
from dcdrw_tracker.wheels.wheel_track import TrackParams
from tests.tracker.filming import hub
from tests.tracker.walking import START_NS, walk

SLOPE = RigParams().slope


def in_room(psi, x, stamp_ns, heading=0.0, mounted=None):
    """The pose of a wheel that stands on the slope: SciPy's rotations are the reference."""
    room = Rotation.from_euler('z', heading) * Rotation.from_euler('y', SLOPE)
    turned = room * Rotation.from_euler('y', psi) * (mounted or Rotation.identity())
    return PoseSample(stamp_ns, tuple(room.apply((x, 0.3, 0.93)).tolist()), tuple(turned.as_quat().tolist()))


def streams(truth, delay_ns=0, **placed):
    """Poses of both wheels, the rear one's taken `delay_ns` later, in the order in which they come."""
    late = truth.time + delay_ns * 1e-9
    late = late[late <= truth.time[-1]]
    rear_psi = np.interp(late, truth.time, truth.rear)
    poses = []
    for t, psi in zip(truth.time, truth.front, strict=True):
        poses.append((FRONT, in_room(psi, hub(np.array([psi]))[0] + 1.2, START_NS + round(t * 1e9), **placed)))
    for t, psi in zip(late, rear_psi, strict=True):
        poses.append((REAR, in_room(psi, hub(np.array([psi]))[0], START_NS + round(t * 1e9), **placed)))
    return sorted(poses, key=lambda item: item[1].stamp_ns)


def paired(poses, params=PoseParams()) -> list[PairView]:  # noqa: B008
    pairs = PosePairs(params, TrackParams())
    return [view for wheel, pose in poses for view in pairs.take(wheel, pose)]


@settings(max_examples=50, deadline=None)
@given(st.floats(-20, 20), st.floats(-math.pi, math.pi), st.sampled_from('xyz'), st.floats(-180, 180), st.booleans())
def test_rotation_is_that_about_the_rigs_left_axis(psi, heading, axis, offset_deg, learned):
    onto_z = {
        'x': Rotation.from_euler('y', -math.pi / 2),
        'y': Rotation.from_euler('x', math.pi / 2),
        'z': Rotation.identity(),
    }[axis]
    mounted = Rotation.from_euler('y', -math.radians(offset_deg)) * onto_z
    params = PoseParams(math.nan if learned else math.degrees(heading), axis, offset_deg, offset_deg)
    poses = [
        (wheel, in_room(psi - turn, x, stamp, heading, mounted))
        for stamp, turn in ((10, 0.3), (20, 0.0))
        for wheel, x in ((FRONT, 2.5), (REAR, 1.0))
    ]
    view = paired(poses, params)[-1]
    for wheel, x in ((view.front, 2.5), (view.rear, 1.0)):
        assert math.remainder(wheel.rotation - psi, math.tau) == pytest.approx(0.0, abs=1e-9)
        assert wheel.hub == pytest.approx((x, 0.93), abs=1e-9)


def test_streams_of_equal_stamps_are_paired_as_they_are():
    truth = walk(4.0, 120.0)
    views = paired(streams(truth))
    assert len(views) >= truth.time.size - 2
    for view in views:
        index = round((view.stamp_ns - START_NS) * 1e-9 * 120.0)
        assert math.remainder(view.front.rotation - truth.front[index], math.tau) == pytest.approx(0.0, abs=1e-9)
        assert math.remainder(view.rear.rotation - truth.rear[index], math.tau) == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 8_333_333))
def test_streams_that_are_taken_at_other_instants_are_interpolated(delay_ns):
    truth = walk(2.0, 120.0)
    views = [view for view in paired(streams(truth, delay_ns=delay_ns)) if view.rear]
    assert len(views) >= truth.time.size - 4
    for view in views:
        index = round((view.stamp_ns - START_NS) * 1e-9 * 120.0)
        # Within a period a strike bends the line by at most (1 − cos 2α) ω T / 4.
        assert math.remainder(view.rear.rotation - truth.rear[index], math.tau) == pytest.approx(0.0, abs=5e-4)


def test_time_tracking_is_the_same_as_for_tags():
    truth = walk(8.0, 120.0)
    angles = WheelAngles(TrackParams())
    samples = [sample for sample in map(angles.update, paired(streams(truth, delay_ns=3_000_000))) if sample]
    assert len(samples) > truth.time.size - 10
    for sample in samples:
        index = round((sample.stamp_ns - START_NS) * 1e-9 * 120.0)
        assert sample.front.angle == pytest.approx(truth.front[index], abs=1e-3)
        assert sample.rear.angle == pytest.approx(truth.rear[index], abs=1e-3)
    assert angles.status().lost == 0


def test_a_wheel_that_stays_away_is_not_seen_and_the_other_is_followed_on():
    poses = streams(walk(4.0, 120.0))
    for wheel in (FRONT, REAR):
        gone = [item for item in poses if item[0] != wheel or item[1].stamp_ns < START_NS + 2e9]
        views = paired(gone)
        unseen = [view for view in views if (view.front if wheel == FRONT else view.rear) is None]
        assert len(unseen) > 200
        assert all(a.stamp_ns < b.stamp_ns for a, b in pairwise(views))
        again = [item for item in poses if item[0] != wheel or not 2e9 < item[1].stamp_ns - START_NS < 3e9]
        assert sum(bool(view.front and view.rear) for view in paired(again)) > 300


def test_a_stream_that_starts_anew_goes_on():
    poses = streams(walk(2.0, 120.0))
    views = paired(poses + poses)
    assert len(views) > 2 * 240 - 60


@pytest.mark.parametrize(
    ('pose', 'message'),
    [
        (PoseSample(0, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), 'the stamps are zero: without their time'),
        (PoseSample(9, (math.nan, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), 'is not a number'),
        (PoseSample(9, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)), 'all zeros, as where nothing tells it'),
        (PoseSample(9, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.5)), 'is not a unit quaternion: its length is 1.5; let'),
        (PoseSample(9, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), 'at the origin, unturned: a default pose'),
    ],
)
def test_what_is_no_pose_is_told(pose, message):
    with pytest.raises(ValueError, match=message):
        PosePairs(PoseParams(), TrackParams()).take(FRONT, pose)


def test_a_wrong_axis_is_told():
    with pytest.raises(ValueError, match=r"the y axis of the \w+ wheel's body lies along its axle: set spoke_axis"):
        paired(streams(walk(1.0)), PoseParams(spoke_axis='y'))
    with pytest.raises(ValueError, match="spoke_axis must be x, y or z, got 'w'"):
        PosePairs(PoseParams(spoke_axis='w'), TrackParams())


def taken(poses, params=PoseParams()):  # noqa: B008
    """Joint samples, and what was refused with which words."""
    pairs, angles, samples, refused = PosePairs(params, TrackParams()), WheelAngles(TrackParams()), [], []
    for wheel, pose in poses:
        try:
            views = pairs.take(wheel, pose)
        except ValueError as error:
            refused.append(str(error))
            continue
        samples += [sample for sample in map(angles.update, views) if sample]
    return samples, refused


def worst_error(samples, truth):
    """The largest error of a rotation [rad], whole turns aside."""
    index = [round((sample.stamp_ns - START_NS) * 1e-9 * 120.0) for sample in samples]
    turned = np.array([(sample.front.angle, sample.rear.angle) for sample in samples])
    off = turned - np.column_stack([truth.front, truth.rear])[index]
    return np.abs(np.angle(np.exp(1j * off))).max()


@pytest.mark.parametrize('wheel', [FRONT, REAR])
@pytest.mark.parametrize(
    'hide',
    [
        pytest.param(lambda pose, last: last._replace(stamp_ns=pose.stamp_ns), id='the last pose again'),
        pytest.param(
            lambda pose, last: PoseSample(pose.stamp_ns, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), id='a default pose'
        ),
        pytest.param(
            lambda pose, last: PoseSample(pose.stamp_ns, (7.0, -2.0, 3.0), (0.0, 0.0, 0.0, 1.0)), id='somewhere else'
        ),
    ],
)
@pytest.mark.parametrize('seconds', [0.3, 2.0])
def test_a_hidden_wheel_leaves_a_gap_and_no_wrong_sample(wheel, hide, seconds):
    truth = walk(8.0, 120.0)
    last, poses = None, []
    for name, pose in streams(truth):
        if name == wheel and 3.0 < (pose.stamp_ns - START_NS) * 1e-9 < 3.0 + seconds:
            poses.append((name, hide(pose, last)))
            continue
        last = pose if name == wheel else last
        poses.append((name, pose))
    samples, refused = taken(poses)
    assert len(refused) >= round(120 * seconds) - 1
    assert len(samples) > truth.time.size - 120 * seconds - 30
    assert worst_error(samples, truth) < 1e-3


def y_up(pose):
    """The same in a room whose y points up."""
    (x, y, z), turn = pose.position, Rotation.from_quat(pose.orientation)
    orientation = (Rotation.from_euler('x', -math.pi / 2) * turn).as_quat()
    return pose._replace(position=(x, z, -y), orientation=tuple(orientation.tolist()))


@settings(max_examples=10, deadline=None)
@given(st.floats(-math.pi, math.pi))
def test_a_room_with_y_up_is_as_good_where_it_is_told(heading):
    truth = walk(3.0, 120.0)
    poses = [(wheel, y_up(pose)) for wheel, pose in streams(truth, heading=heading)]
    samples, refused = taken(poses, PoseParams(up_axis='y'))
    assert not refused
    assert len(samples) > truth.time.size - 10
    assert worst_error(samples, truth) < 1e-3


@pytest.mark.parametrize('body', ['x', 'y', 'z'])
def test_where_another_axis_is_up_nothing_is_given_out_and_the_mend_is_told(body):
    mounted = {
        'x': Rotation.from_euler('y', -math.pi / 2),
        'y': Rotation.from_euler('x', math.pi / 2),
        'z': Rotation.identity(),
    }[body]
    poses = [(wheel, y_up(pose)) for wheel, pose in streams(walk(4.0, 120.0), mounted=mounted)]
    for axis in 'xyz':
        samples, refused = taken(poses, PoseParams(spoke_axis=axis))
        assert samples == []
        assert refused
    samples, refused = taken(streams(walk(4.0, 120.0)), PoseParams(up_axis='y', spoke_axis='x'))
    assert samples == []
    assert any('is z up? set up_axis to z' in why for why in refused)


def test_wheels_that_were_held_are_seen_from_the_start():
    truth = walk(4.0, 120.0)
    noise = np.random.default_rng(1)
    still = [
        (wheel, in_room(psi + noise.normal(0.0, 1e-4), x, START_NS - round((240 - k) / 120.0 * 1e9)))
        for k in range(240)
        for wheel, psi, x in (
            (FRONT, truth.front[0], hub(truth.front[:1])[0] + 1.2),
            (REAR, truth.rear[0], hub(truth.rear[:1])[0]),
        )
    ]
    pairs = PosePairs(PoseParams(), TrackParams())
    assert not [view for wheel, pose in still for view in pairs.take(wheel, pose)]
    assert pairs.waits
    samples, _ = taken(still + streams(truth))
    assert len(samples) > 240 + truth.time.size - 10


@pytest.mark.parametrize('heading', [0.0, 0.6])
@pytest.mark.parametrize(
    'wrong', [lambda x, y, z, w: (w, x, y, z), lambda x, y, z, w: (-x, -y, -z, w)], ids=['w first', 'inverse']
)
def test_orientations_in_another_order_or_inverted_give_no_wrong_sample(heading, wrong):
    poses = [
        (wheel, pose._replace(orientation=wrong(*pose.orientation)))
        for wheel, pose in streams(walk(4.0, 120.0), heading=heading)
    ]
    samples, refused = taken(poses)
    assert samples == []
    assert any('the order x, y, z, w' in why for why in refused)
    assert len(refused) > 800


def test_on_a_treadmill_a_hub_may_go_back_while_its_wheel_rolls_on():
    poses = [
        (wheel, pose._replace(position=(-pose.position[0], *pose.position[1:])))
        for wheel, pose in streams(walk(4.0, 120.0))
    ]
    level, heading = TrackParams(camera_follows=True, slope=0.0), PoseParams(heading_deg=0.0)
    for track, gives in ((level, True), (level._replace(camera_follows=False), False)):
        pairs, views = PosePairs(heading, track), 0
        for wheel, pose in poses:
            try:
                views += len(pairs.take(wheel, pose))
            except ValueError:
                continue
        assert bool(views) == gives


def test_of_a_hub_that_goes_without_a_turn_it_is_asked_whether_its_orientation_is_tracked():
    pairs = PosePairs(PoseParams(), TrackParams())
    for wheel, pose in streams(walk(4.0, 120.0)):
        assert not pairs.take(wheel, pose._replace(orientation=(0.0, 0.0, 0.0, 1.0)))
    assert 'the hub of the front wheel has gone' in pairs.waits
    assert 'is its orientation tracked?' in pairs.waits

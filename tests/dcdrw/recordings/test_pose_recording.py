"""`dcdrw analyze` on recordings that hold nothing but the poses of both wheels."""

import math

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from dcdrw.cli import main
from dcdrw.trials.results import read_trial
from dcdrw.trials.summary import summarize
from dcdrw_msgs_py.topics import FRONT_POSE, REAR_POSE
from tests.bags import JOINT_STATE, TYPES
from tests.tracker.walking import ALPHA, PITCH, START_NS, walk
from tests.tracker.wheels.test_poses import streams, y_up


def pose_bag(path, poses, namespace='/mocap', set_ns=lambda log_ns: 0):
    """A recording of poses, as rosbag2 makes it; the clock of the poses was set by so much."""
    return pose_bags(path, {namespace: poses}, set_ns)


def pose_bags(path, of, set_ns=lambda log_ns: 0):
    """A recording of poses in several namespaces."""
    kind = {name: TYPES.types[name] for name in (FRONT_POSE.type, 'geometry_msgs/msg/Pose', 'std_msgs/msg/Header')}
    time, point, turn = (
        TYPES.types[name]
        for name in ('builtin_interfaces/msg/Time', 'geometry_msgs/msg/Point', 'geometry_msgs/msg/Quaternion')
    )
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {
            (namespace, wheel): writer.add_connection(f'{namespace}/{topic.name}', topic.type, typestore=TYPES)
            for wheel, topic in (('front', FRONT_POSE), ('rear', REAR_POSE))
            for namespace in of
        }
        for namespace, wheel, pose in ((namespace, *one) for namespace, poses in of.items() for one in poses):
            stamp_ns = pose.stamp_ns + set_ns(pose.stamp_ns)
            message = kind[FRONT_POSE.type](
                kind['std_msgs/msg/Header'](time(*divmod(stamp_ns, 10**9)), 'room'),
                kind['geometry_msgs/msg/Pose'](point(*pose.position), turn(*pose.orientation)),
            )
            log_ns = pose.stamp_ns or START_NS
            writer.write(topics[namespace, wheel], log_ns, bytes(TYPES.serialize_cdr(message, FRONT_POSE.type)))
    return path


def test_a_recording_of_poses_alone_is_judged(tmp_path):
    truth = walk(8.0, 120.0)
    trial, agreement = read_trial(pose_bag(tmp_path / 'bag', streams(truth)))
    assert not agreement
    assert len(trial.motion.stamp_ns) > truth.time.size - 10
    assert trial.motion.phi[-1] == pytest.approx(truth.phase()[-1] * PITCH, abs=1e-3)
    assert 100.0 * trial.status.initial_phase == pytest.approx(21.6, abs=1.0)
    assert trial.status.steps == pytest.approx(truth.steps()[0][-1], abs=1)
    assert math.degrees(ALPHA) == pytest.approx(15.0)


def test_poses_that_come_twice_cost_nothing(tmp_path):
    poses = streams(walk(4.0, 120.0))
    once, twice = (
        summarize(read_trial(pose_bag(tmp_path / name, [pose for pose in poses for _ in range(times)]))[0])
        for times, name in ((1, 'once'), (2, 'twice'))
    )
    assert twice.samples.refused == {}
    assert (twice.front_steps, twice.final_phase_percent) == (once.front_steps, once.final_phase_percent)


@pytest.mark.parametrize('rate', [30.0, 60.0, 120.0, 240.0])
@pytest.mark.parametrize('seconds', [37, 2, -2, -37])
def test_a_clock_of_poses_that_is_set_while_the_wheels_go_on_is_bridged(tmp_path, rate, seconds):
    poses = streams(walk(9.0, rate))
    set_at = START_NS + 5 * 10**9
    even, stepped = (
        summarize(read_trial(pose_bag(tmp_path / name, poses, set_ns=set_ns))[0])
        for name, set_ns in (
            ('even', lambda log_ns: 0),
            ('stepped', lambda log_ns: seconds * 10**9 * (log_ns > set_at)),
        )
    )
    (step,) = stepped.samples.clock_steps
    assert step.seconds == pytest.approx(seconds, abs=0.01)
    assert (stepped.samples.restarts, stepped.steps_to_synchronization) == ((), even.steps_to_synchronization)
    assert stepped.front_steps == even.front_steps
    assert stepped.final_phase_percent == pytest.approx(even.final_phase_percent, abs=0.01)
    assert stepped.samples.lost <= 4


def test_poses_of_no_use_are_counted_and_said(tmp_path, capsys):
    poses = streams(walk(4.0, 120.0))
    hidden = [
        (
            wheel,
            pose
            if k < 400 or wheel == 'rear'
            else poses[400 - (poses[400][0] == 'rear')][1]._replace(stamp_ns=pose.stamp_ns),
        )
        for k, (wheel, pose) in enumerate(poses)
    ]
    trial, _ = read_trial(pose_bag(tmp_path / 'hidden', hidden))
    assert trial.estimator.refusals['unreadable'] > 100
    assert 'the pose of the front wheel repeats to the last bit' in summarize(trial).sentence
    unstamped = [(wheel, pose._replace(stamp_ns=0)) for wheel, pose in poses]
    assert main(['analyze', str(pose_bag(tmp_path / 'unstamped', unstamped))]) == 2
    assert 'the stamps are zero' in capsys.readouterr().err
    turned = [(wheel, y_up(pose)) for wheel, pose in poses]
    assert main(['analyze', str(pose_bag(tmp_path / 'turned', turned))]) == 2
    assert 'up_axis' in capsys.readouterr().err
    rig = tmp_path / 'rig.yaml'
    rig.write_text("tag_tracker:\n  ros__parameters:\n    up_axis: 'y'\n")
    assert main(['analyze', str(tmp_path / 'turned'), '--rig', str(rig)]) == 0


def test_of_the_poses_of_two_rigs_those_asked_for_are_judged(tmp_path, capsys):
    """One rig walks for 4 s, the other for 8."""
    bag = pose_bags(tmp_path / 'bag', {'/rig_1': streams(walk(4.0, 120.0)), '/rig_2': streams(walk(8.0, 120.0))})
    for command, out in (('analyze', []), ('report', ['--out', str(tmp_path / 'day.html')]), ('replay', [])):
        assert main([command, str(bag), *out]) == 2
        assert 'choose one with --namespace /rig_1 or /rig_2' in capsys.readouterr().err
        assert main([command, str(bag), *out, '--namespace', 'rig_3']) == 2
        assert 'in rig_3' in capsys.readouterr().err
    for namespace, seconds in (('rig_1', 4.0), ('/rig_2/', 8.0)):
        trial, _ = read_trial(bag, namespace=namespace)
        assert trial.seconds == pytest.approx(seconds, abs=0.1)
    rig = tmp_path / 'rig.yaml'
    rig.write_text(
        '/rig_1/**: {ros__parameters: {band_percent: 7.0}}\n/rig_2/**: {ros__parameters: {band_percent: 8.0}}\n'
    )
    assert read_trial(bag, rig=rig, namespace='rig_2')[0].params.sync.band_percent == 8.0


def told(kind, pose, child='', parent='room'):
    """A message of a type that tells a pose, and of a body aside where it can."""

    def make(name, *values):
        return TYPES.types[name](*values)

    (x, y, z), turn = pose.position, make('geometry_msgs/msg/Quaternion', *pose.orientation)
    header = make('std_msgs/msg/Header', make('builtin_interfaces/msg/Time', *divmod(pose.stamp_ns, 10**9)), parent)
    placed = make('geometry_msgs/msg/Pose', make('geometry_msgs/msg/Point', x, y, z), turn)
    transform = make('geometry_msgs/msg/Transform', make('geometry_msgs/msg/Vector3', x, y, z), turn)
    uncertain = make('geometry_msgs/msg/PoseWithCovariance', placed, np.zeros(36))
    vector = make('geometry_msgs/msg/Vector3', 0.0, 0.0, 0.0)
    still = make('geometry_msgs/msg/TwistWithCovariance', make('geometry_msgs/msg/Twist', vector, vector), np.zeros(36))
    moved = make('geometry_msgs/msg/TransformStamped', header, child, transform)
    aside = make('geometry_msgs/msg/TransformStamped', header, 'camera', transform)
    return {
        FRONT_POSE.type: lambda: make(kind, header, placed),
        'geometry_msgs/msg/PoseWithCovarianceStamped': lambda: make(kind, header, uncertain),
        'nav_msgs/msg/Odometry': lambda: make(kind, header, child, uncertain, still),
        'geometry_msgs/msg/TransformStamped': lambda: moved,
        'tf2_msgs/msg/TFMessage': lambda: make(kind, [aside, moved]),
    }[kind]()


def bag_of(path, poses, kind, topics, frames=('', ''), parents=('room', 'room')):
    """A recording of poses in messages of a type."""
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {name: writer.add_connection(name, kind, typestore=TYPES) for name in dict.fromkeys(topics)}
        for wheel, pose in poses:
            k = wheel == 'rear'
            message = bytes(TYPES.serialize_cdr(told(kind, pose, frames[k], parents[k]), kind))
            writer.write(connections[topics[k]], pose.stamp_ns, message)
    return path


WALK = streams(walk(2.0, 120.0))


@pytest.mark.parametrize(
    ('kind', 'topics', 'frames'),
    [
        (FRONT_POSE.type, ('/vrpn/front/pose', '/vrpn/rear/pose'), ('', '')),
        ('geometry_msgs/msg/PoseWithCovarianceStamped', ('front_pose', 'rear_pose'), ('', '')),
        ('nav_msgs/msg/Odometry', ('/front_wheel/odom', '/rear_wheel/odom'), ('a', 'b')),
        ('geometry_msgs/msg/TransformStamped', ('/mocap/front_pose', '/mocap/rear_pose'), ('a', 'b')),
        ('geometry_msgs/msg/TransformStamped', ('/bodies', '/bodies'), ('lab/front_wheel', 'lab/rear_wheel')),
        ('tf2_msgs/msg/TFMessage', ('/tf', '/tf'), ('front_wheel', 'rear_wheel')),
    ],
)
def test_poses_tell_the_same_in_whatever_message_they_come(tmp_path, kind, topics, frames):
    motion = read_trial(bag_of(tmp_path / 'bag', WALK, kind, topics, frames))[0].motion
    reference = read_trial(pose_bag(tmp_path / 'reference', WALK))[0].motion
    assert len(motion.phi) == len(reference.phi) > 200
    assert (motion.phi == reference.phi).all()


def test_wheels_in_different_frames_of_a_tree_are_told(tmp_path, capsys):
    bag = bag_of(
        tmp_path / 'bag', WALK, 'tf2_msgs/msg/TFMessage', ('/tf', '/tf'), ('front_wheel', 'rear_wheel'), ('room', 'map')
    )
    assert main(['analyze', str(bag)]) == 2
    assert 'both wheels must be told in one frame, got room and map' in capsys.readouterr().err


def test_of_poses_that_are_none_of_the_wheels_it_is_told_how_they_would_be(tmp_path, capsys):
    bodies = ('tf2_msgs/msg/TFMessage', ('/tf', '/tf'), ('base_link', 'arm'))
    bag = bag_of(tmp_path / 'tree', WALK[:8], *bodies)
    for command in ('analyze', 'replay'):
        assert main([command, str(bag)]) == 2
        assert capsys.readouterr().err.endswith(
            'of this type it has: none; poses of the wheels would do, in topics front_pose and rear_pose of '
            'geometry_msgs/msg/PoseStamped, say, or as frames front_wheel and rear_wheel: it has /tf '
            '(tf2_msgs/msg/TFMessage, camera, base_link, arm)\n'
        )
    alone = bag_of(tmp_path / 'alone', WALK[:8], FRONT_POSE.type, ('/front_pose', '/front_pose'))
    assert main(['analyze', str(alone)]) == 2
    assert capsys.readouterr().err.endswith('it has /front_pose (geometry_msgs/msg/PoseStamped)\n')


def test_of_joint_states_in_several_suites_poses_tell_nothing(tmp_path, capsys):
    with Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kinds = {'/a/joint_states': JOINT_STATE, '/b/joint_states': JOINT_STATE, '/tf': 'tf2_msgs/msg/TFMessage'}
        for topic, kind in kinds.items():
            writer.write(writer.add_connection(topic, kind, typestore=TYPES), START_NS, b'\0\1\0\0')
    assert main(['analyze', str(tmp_path / 'bag')]) == 2
    assert capsys.readouterr().err.endswith('choose one with --namespace /a or /b\n')

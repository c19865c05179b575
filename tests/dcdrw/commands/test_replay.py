"""`dcdrw replay`: real nodes see a recorded trial as it was."""

import os
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import pytest

from dcdrw.cli import main
from dcdrw.recordings.bag_file import Stream
from dcdrw.recordings.recording import Recording
from dcdrw_msgs_py.messages import stamp_ns
from dcdrw_msgs_py.topics import CLOCK, FOOTFALLS, JOINT_STATES, PHASE_STATE
from tests import ROOT
from tests.bags import joint_state, write_bag
from tests.dcdrw.recordings.test_pose_recording import pose_bag
from tests.tracker.walking import walk
from tests.tracker.wheels.test_poses import streams

pytestmark = pytest.mark.processes


def replay(bench, *arguments: str) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, '-m', 'dcdrw.cli', 'replay', *arguments],
        text=True,
        env={**os.environ, 'PYTHONPATH': str(ROOT), 'ROS_DOMAIN_ID': str(bench.domain)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    bench.processes.append(process)
    return process


def finish(bench, process) -> tuple[str, str]:
    """Wait for its end; return what it printed, and on standard error."""
    bench.wait(lambda: process.poll() is not None, 'the end of the replay')
    bench.spin(0.5)
    return process.communicate()


def recorded(path: Path, topic: str):
    with Recording(path) as recording:
        return list(recording.joints(recording.find(topic)))


def test_estimator_says_again_what_it_said_live(bench, live_trial):
    bench.start('phase_estimator', '--params-file', str(live_trial / 'parameters.yaml'), use_sim_time=True)
    phases, clocks, falls = bench.hear(PHASE_STATE), bench.hear(CLOCK), bench.hear(FOOTFALLS['front'])
    bench.wait(lambda: bench.node.count_publishers('phase_state'), 'the estimator')
    process = replay(bench, str(live_trial), '--rate', '2')
    assert 'joint states sent' in finish(bench, process)[0]
    assert process.returncode == 0
    batches = recorded(live_trial, '/phase_state')
    names = batches[0].names
    live = {
        stamp: (*position, *velocity[:3])
        for batch in batches
        for stamp, position, velocity in zip(
            batch.stamp_ns.tolist(), batch.position.tolist(), batch.velocity.tolist(), strict=True
        )
    }
    assert len(phases) > 900
    for message in phases:
        stamp = stamp_ns(message.header.stamp)
        if stamp in live:  # all but what was estimated before the recorder listened
            assert (*message.position, *message.velocity[:3]) == live[stamp]
            assert tuple(message.name) == names
    assert sum(stamp_ns(message.header.stamp) in live for message in phases) > 900
    with Recording(live_trial) as recording:
        assert abs(len(falls) - recording.count(Stream('/front_footfalls', FOOTFALLS['front'].type))) <= 1
    times = [clock.clock.sec * 10**9 + clock.clock.nanosec for clock in clocks]
    moving = times[times.count(times[0]) :]  # it stands until the replay begins
    assert all(0 < later - earlier <= 30_000_000 for earlier, later in pairwise(moving))
    # Of the joint states: the recorder may hear the estimator later.
    sent = [stamp for batch in recorded(live_trial, '/joint_states') for stamp in batch.stamp_ns.tolist()]
    assert min(sent) - 10**9 < times[0] < times[-1] <= max(sent) + 10**9


@pytest.fixture
def renamed(tmp_path):
    """Ten seconds at 100 Hz, by other names and from another namespace."""
    return write_bag(
        tmp_path / 'bag',
        [
            (10**18 + k * 10**7, joint_state(5 * 10**9 + k * 10**7, ['hub_a', 'arm', 'hub_b'], [k, 0.5, -k]))
            for k in range(1000)
        ],
        '/lab/joint_states',
    )


def test_part_of_a_recording_is_replayed_by_its_own_names(bench, renamed):
    joints = bench.hear(JOINT_STATES)
    process = replay(bench, str(renamed), '--from', '2', '--to', '4.5', '--rate', '5')
    assert finish(bench, process)[0] == '250 joint states sent\n'
    assert [message.position[0] for message in joints] == list(range(200, 450))
    assert joints[0].name == ['hub_a', 'arm', 'hub_b']
    assert stamp_ns(joints[0].header.stamp) == 7 * 10**9


def test_what_is_damaged_is_said_and_left_out(bench, renamed):
    (part,) = renamed.glob('*.mcap')
    part.write_bytes(part.read_bytes()[: part.stat().st_size // 2])
    joints = bench.hear(JOINT_STATES)
    process = replay(bench, str(renamed), '--rate', '20')
    said, complaint = finish(bench, process)
    assert said == f'{len(joints)} joint states sent\n'
    assert 0 < len(joints) < 1000
    assert process.returncode == 1
    assert complaint.startswith('dcdrw replay: ')


def test_pace_is_that_of_the_stamps_whatever_the_recorder_saw(bench, tmp_path):
    """A trial that was simulated ten times as fast as real takes its own time, and does not wait where stamps jump."""
    jump = 10**12
    bag = write_bag(
        tmp_path / 'bag',
        [
            (10**18 + k * 10**6, joint_state(k * 10**7 + (jump if k >= 100 else 0), ['front_wheel'], [k]))
            for k in range(200)
        ],
    )
    joints, clocks = bench.hear(JOINT_STATES), bench.hear(CLOCK)
    process = replay(bench, str(bag))
    bench.wait(lambda: joints, 'a joint state')
    begun = time.monotonic()
    assert finish(bench, process)[0] == '200 joint states sent\n'
    assert time.monotonic() - begun > 1.0  # of 1.98 s by the stamps, 0.2 s by the log
    assert stamp_ns(clocks[-1].clock) == stamp_ns(joints[-1].header.stamp) == jump + 199 * 10**7


@pytest.mark.parametrize('start_ns', [0, 5 * 10**9])
def test_who_listens_only_when_the_time_is_known_hears_the_whole(bench, tmp_path, start_ns):
    """As `ros2 bag record --use-sim-time` does; to ROS, a time of zero is none."""
    bag = write_bag(
        tmp_path / 'bag',
        [(10**18 + k * 10**7, joint_state(start_ns + k * 10**7, ['front_wheel'], [k])) for k in range(100)],
    )
    clocks = bench.hear(CLOCK)
    process = replay(bench, str(bag))
    bench.wait(lambda: clocks and stamp_ns(clocks[0].clock), 'a time')
    joints = bench.hear(JOINT_STATES)
    bench.wait(lambda: joints, 'a joint state')
    times = [stamp_ns(clock.clock) for clock in clocks]
    assert times[: len(times) // 2] == [start_ns or 1] * (len(times) // 2)  # it stood still most of the while
    assert finish(bench, process)[0] == '100 joint states sent\n'
    assert [message.position[0] for message in joints] == list(range(100))
    times = [stamp_ns(clock.clock) for clock in clocks]
    assert times == sorted(times)
    assert times[-1] == start_ns + 99 * 10**7


def test_rig_file_gives_the_joints_the_names_of_the_suite(bench, renamed, tmp_path):
    (tmp_path / 'rig.yaml').write_text(
        'phase_estimator:\n  ros__parameters:\n    front_joint: hub_a\n    rear_joint: hub_b\n'
    )
    joints = bench.hear(JOINT_STATES, '/rig_2/joint_states')
    process = replay(
        bench, str(renamed), '--rig', str(tmp_path / 'rig.yaml'), '--into', 'rig_2', '--to', '1', '--rate', '4'
    )
    assert finish(bench, process)[0] == '100 joint states sent\n'
    assert joints[99].name == ['front_wheel', 'arm', 'rear_wheel']
    assert joints[99].position.tolist() == [99.0, 0.5, -99.0]


def test_loop_goes_on_until_it_is_interrupted(bench, renamed):
    joints = bench.hear(JOINT_STATES)
    process = replay(bench, str(renamed), '--to', '0.5', '--rate', '4', '--loop')
    bench.wait(lambda: len(joints) > 120, 'the third round')
    process.send_signal(signal.SIGINT)
    finish(bench, process)
    assert process.returncode == 130
    assert [message.position[0] for message in joints[:120]] == [*range(50), *range(50), *range(20)]


def test_poses_are_replayed_as_the_joint_states_that_they_tell(bench, tmp_path):
    bag = pose_bag(tmp_path / 'bag', streams(walk(4.0, 120.0)))
    joints = bench.hear(JOINT_STATES)
    process = replay(bench, str(bag), '--from', '1', '--rate', '4', '--namespace', 'mocap')
    assert 'joint states sent' in finish(bench, process)[0]
    assert process.returncode == 0
    assert 340 < len(joints) < 361
    assert joints[0].name == ['front_wheel', 'rear_wheel']
    assert stamp_ns(joints[-1].header.stamp) - stamp_ns(joints[0].header.stamp) == pytest.approx(3e9, rel=0.05)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['nowhere'], 'nowhere does not exist'),
        (['bag', '--from', '30'], '--from 30 must lie before --to and within the recording (10.0 s)'),
        (['bag', '--from', '3', '--to', '2'], '--from 3 must lie before --to'),
        (
            ['bag', '--topic', 'wheels'],
            'no topic wheels of sensor_msgs/msg/JointState; of this type it has: /lab/joint',
        ),
        (['bag', '--rig', 'nowhere.yaml'], 'nowhere.yaml'),
    ],
)
def test_wrong_input_is_told_in_one_line(renamed, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(renamed.parent)
    assert main(['replay', *arguments]) == 2
    errors = capsys.readouterr().err
    assert message in errors
    assert errors.count('\n') == 1

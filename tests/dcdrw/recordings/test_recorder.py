"""The recorder: what it keeps, also where it is killed or the disk is full."""

import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from rcl_interfaces.srv import GetParameters
from rosbags.rosbag2 import Reader
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from dcdrw.recordings.recorder import Recorder, offered_qos
from dcdrw.recordings.recording import Recording
from dcdrw.suite.executables import RECORDED
from dcdrw.suite.parameter_file import TrialParams, read_parameter_file
from dcdrw_msgs_py.diagnosis import STATE, RecorderState, messages_of
from dcdrw_msgs_py.messages import to_stamp
from dcdrw_msgs_py.topics import DIAGNOSTICS, JOINT_STATES, ROSOUT, SYNCHRONIZED, Topic
from tests import ROOT
from tests.bags import JOINTS, TYPES
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

FILE = 'bag/bag_0.mcap'
IMAGE = Topic('image_raw', 'sensor_msgs/msg/Image', '')


def start(bench, folder: Path, **parameters):
    """Start a recorder that records, and wait until it has a message."""
    process = bench.start('recorder', '-p', f'folder:={folder}', record=True, **parameters)
    joints, diagnostics = bench.publisher(JOINT_STATES), bench.hear(DIAGNOSTICS)

    def heard() -> bool:
        send(bench, joints)
        return int(said(diagnostics).get(messages_of('/joint_states'), 0)) > 0

    bench.wait(heard, 'a recorded message')
    return process, joints, diagnostics


def send(bench, joints) -> int:
    now = bench.node.get_clock().now().nanoseconds
    message = JointState(name=['front_wheel', 'rear_wheel'], position=[1.0, 2.0], velocity=[0.5, 0.5])
    message.header.stamp = to_stamp(now)
    joints.publish(message)
    bench.spin(0.005)
    return now


def said(diagnostics) -> dict[str, str]:
    """What the recorder said of itself last."""
    for message in reversed(diagnostics):
        for status in message.status:
            if status.name == 'recorder':
                return {'': status.message, **{pair.key: pair.value for pair in status.values}}
    return {}


def recorded_stamps(path: Path) -> list[int]:
    with Recording(path) as recording:
        return [stamp for batch in recording.joints(JOINTS) for stamp in batch.stamp_ns.tolist()]


def test_messages_are_kept_as_they_came_off_the_wire(bench, tmp_path):
    latched = bench.publisher(SYNCHRONIZED, readers=0)
    latched.publish(Bool(data=True))  # before the recorder is there
    process, joints, _ = start(bench, tmp_path / 'bag', topics='image_raw')
    images = bench.publisher(IMAGE)
    bench.wait(
        lambda: images.publish(Image(height=1, width=2, step=2, data=b'ab')) or (tmp_path / FILE).stat(), 'an image'
    )
    sent = [send(bench, joints) for _ in range(60)]
    bench.spin(0.5)
    images.publish(Image(height=1, width=2, step=2, data=b'ab'))
    bench.spin(0.5)
    assert bench.end(process) == 0
    with Reader(tmp_path / 'bag') as reader:
        kinds = {topic: info.msgtype for topic, info in reader.topics.items()}
        messages = [
            (connection.topic, TYPES.deserialize_cdr(data, connection.msgtype))
            for connection, _, data in reader.messages()
        ]
        offered = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
    assert kinds['/joint_states'] == 'sensor_msgs/msg/JointState'
    assert [m.data for topic, m in messages if topic == '/synchronized'] == [True]
    assert bytes(next(m.data for topic, m in messages if topic == '/image_raw')) == b'ab'
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for topic, m in messages if topic == '/joint_states']
    assert set(sent) <= set(stamps)
    assert offered['/synchronized'].durability.name == 'TRANSIENT_LOCAL'
    assert offered['/joint_states'].reliability.name == 'RELIABLE'
    with (tmp_path / FILE).open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        schemas = {schema.name: schema for schema in reader.get_summary().schemas.values()}
        assert b'float64[] position' in schemas['sensor_msgs/msg/JointState'].data
        assert b'MSG: std_msgs/Header' in schemas['sensor_msgs/msg/JointState'].data
        times = [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
    assert times == sorted(times)


def test_only_topics_that_somebody_speaks_on_are_recorded_and_the_log_is_among_them(bench, tmp_path):
    process, joints, _ = start(bench, tmp_path / 'bag')
    bench.node.get_logger().warning('heard by the recorder')
    send(bench, joints)
    bench.spin(0.5)
    assert bench.end(process) == 0
    with Recording(tmp_path / 'bag') as recording:
        assert all(recording.count(topic) for topic in recording.topics)
        assert {'/joint_states', '/rosout', '/diagnostics'} <= {topic.name for topic in recording.topics}
        logged = [message for _, _, message in recording.decoded(recording.found(ROSOUT.name, ROSOUT.type))]
    assert 'heard by the recorder' in [message.msg for message in logged]
    metadata = yaml.safe_load((tmp_path / 'bag' / 'metadata.yaml').read_text())
    for topic in metadata['rosbag2_bagfile_information']['topics_with_message_count']:
        assert topic['message_count'] > 0


def test_kill_costs_a_second_at_most(bench, tmp_path):
    process, joints, _ = start(bench, tmp_path / 'bag')
    for _ in range(100):
        last = send(bench, joints)
    process.send_signal(signal.SIGKILL)
    process.wait()
    stamps = recorded_stamps(tmp_path / 'bag')
    assert last - stamps[-1] < 1e9
    metadata = yaml.safe_load((tmp_path / 'bag' / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    with Recording(tmp_path / 'bag') as recording:
        assert 0 < metadata['message_count'] <= sum(map(recording.count, recording.topics))
    assert stamps == sorted(stamps)


def test_metadata_of_a_recorder_at_work_count_what_the_disk_has(tmp_path):
    """A killed recorder leaves them: `ros2 bag info` believes them, and `ros2 bag play` opens nothing without."""
    recorder = Recorder(tmp_path / 'bag')
    flags = recorder.add_topic('/synchronized', 'std_msgs/msg/Bool', [offered_qos(True, True, 1)])

    def metadata():
        return yaml.safe_load((tmp_path / 'bag' / 'metadata.yaml').read_text())['rosbag2_bagfile_information']

    for count in (1, 2, 3):
        recorder.write(flags, b'\0\1\0\0\1\0\0\0', count * 10**9)
        end = time.monotonic() + PATIENCE
        while not (tmp_path / 'bag' / 'metadata.yaml').exists() or metadata()['message_count'] < count:
            assert time.monotonic() < end
            recorder.flush()
        told = metadata()
        with Recording(tmp_path / 'bag') as recording:
            assert recording.count(flags) == count
        assert told['message_count'] == told['topics_with_message_count'][0]['message_count'] == count
        assert told['duration']['nanoseconds'] == told['files'][0]['duration']['nanoseconds'] == (count - 1) * 10**9
    recorder.add_topic('/synchronized', 'std_msgs/msg/Bool', [offered_qos(False, False)])
    recorder.close()
    (topic,) = metadata()['topics_with_message_count']
    assert topic['message_count'] == 3
    assert [profile['reliability'] for profile in topic['topic_metadata']['offered_qos_profiles']] == ['best_effort']


def test_full_disk_ends_the_recording_and_keeps_what_is_there(bench, tmp_path):
    process, joints, diagnostics = start(bench, tmp_path / 'bag')
    bench.wait(lambda: send(bench, joints) and (tmp_path / FILE).stat().st_size > 30_000, 'a chunk')
    size = (tmp_path / FILE).stat().st_size
    _, most = resource.prlimit(process.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (size + 100, most))  # no file grows any more
    bench.wait(lambda: send(bench, joints) and said(diagnostics).get(STATE) == RecorderState.FAILED, 'the news')
    assert said(diagnostics)[''] == f'the recording ended: File too large: {tmp_path}/bag; what came before is kept'
    assert process.poll() is None
    assert len(recorded_stamps(tmp_path / 'bag')) > 10
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (most, most))  # there is space again
    answer = bench.call(SetBool, '/recorder/record', SetBool.Request(data=True))
    assert not answer.success
    assert 'exists already, not overwriting' in answer.message
    assert 'Traceback' not in bench.output('recorder')


def test_command_ends_with_a_message_where_the_disk_is_full(bench, tmp_path):
    joints = bench.publisher(JOINT_STATES, readers=0)
    process = subprocess.Popen(
        [sys.executable, '-m', 'dcdrw.cli', 'record', '--out', 'bag', '--domain', str(bench.domain)],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        stderr=subprocess.PIPE,
        text=True,
    )
    bench.processes.append(process)
    bench.wait(
        lambda: send(bench, joints) and (tmp_path / FILE).exists() and (tmp_path / FILE).stat().st_size > 30_000,
        'a chunk',
    )
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (30_000, 30_000))
    bench.wait(lambda: send(bench, joints) and process.poll() is not None, 'the end')
    assert process.returncode == 1
    errors = process.communicate()[1]
    assert re.search(r'^dcdrw record: the recording ended: File too large: bag', errors, re.MULTILINE)


def test_service_starts_and_stops_recordings(bench, tmp_path):
    process = bench.start('recorder', '-p', f'folder:={tmp_path}/one', '-p', 'note:=hello')
    bench.start('phase_estimator', hysteresis_deg=2.5)

    def record(on: bool):
        return bench.call(SetBool, '/recorder/record', SetBool.Request(data=on))

    answer = record(True)
    assert (answer.success, answer.message) == (True, f'{tmp_path}/one')
    assert record(True).success  # it goes on
    bench.wait((tmp_path / 'one' / 'parameters.yaml').exists, "the estimator's parameters")
    answer = record(False)
    assert (answer.success, answer.message) == (True, f'recorded: {tmp_path}/one')
    assert record(False).success
    assert 'exists already, not overwriting' in record(True).message
    assert bench.end(process) == 0
    metadata = yaml.safe_load((tmp_path / 'one' / 'metadata.yaml').read_text())
    about = metadata['rosbag2_bagfile_information']['custom_data']
    assert about['note'] == 'hello'
    assert about.keys() >= {'dcdrw_version', 'git_revision', 'machine', 'started'}
    for text in (about['parameters'], (tmp_path / 'one' / 'parameters.yaml').read_text()):
        assert yaml.safe_load(text)['phase_estimator']['ros__parameters']['hysteresis_deg'] == 2.5


def test_parameters_recorded_in_a_namespace_take_effect_when_given_back(bench, tmp_path):
    space = ('-r', '__ns:=/rig_2')
    recorder = bench.start('recorder', '-p', f'folder:={tmp_path}/bag', *space, record=True)
    estimator = bench.start('phase_estimator', *space, hysteresis_deg=2.5)
    recorded = tmp_path / 'bag' / 'parameters.yaml'
    bench.wait(recorded.exists, "the estimator's parameters")
    assert bench.end(recorder) == bench.end(estimator) == 0
    assert read_parameter_file(recorded, TrialParams()).phase.hysteresis_deg == 2.5
    bench.start('phase_estimator', '--params-file', str(recorded), *space)
    request = GetParameters.Request(names=['hysteresis_deg'])
    answer = bench.call(GetParameters, '/rig_2/phase_estimator/get_parameters', request)
    assert answer.values[0].double_value == 2.5


def test_pictures_and_drawings_are_kept_only_when_asked_for():
    names = {topic.name for topic in RECORDED}
    assert names >= {
        'joint_states',
        'phase_state',
        'front_footfalls',
        'rear_footfalls',
        'synchronized',
        '/diagnostics',
        'tag_detections',
    }
    assert not names & {'image_raw', 'image_raw/compressed', 'debug_image', 'rig_markers'}


def test_existing_folder_is_never_overwritten(tmp_path):
    (tmp_path / 'bag').mkdir()
    with pytest.raises(ValueError, match='bag exists already, not overwriting'):
        Recorder(tmp_path / 'bag')
    assert not list((tmp_path / 'bag').iterdir())


def test_unknown_type_is_refused_and_harms_nothing(tmp_path):
    recorder = Recorder(tmp_path / 'bag')
    with pytest.raises(ValueError, match='/odd is not recorded: the definition of lab_msgs/msg/Odd is not known'):
        recorder.add_topic('/odd', 'lab_msgs/msg/Odd', [])
    recorder.close()
    with Reader(tmp_path / 'bag') as reader:
        assert reader.message_count == 0


def test_missing_library_is_told_in_one_line():
    code = (
        'import sys; sys.modules["rosbags"] = None; from dcdrw.cli import main; '
        'sys.exit(main(["record"]) or main(["analyze", "."]))'
    )
    done = subprocess.run([sys.executable, '-c', code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "dcdrw record: a recording needs rosbags and mcap: pip install 'dcdrw[record]'\n"

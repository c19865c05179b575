"""Recordings, whoever made them and however they ended."""

import fcntl
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader, StoragePlugin
from rosbags.rosbag2.enums import CompressionMode

from dcdrw.recordings.joint_batch import decode_joints
from dcdrw.recordings.recorder import Recorder, offered_qos
from dcdrw.recordings.recording import Recording
from tests.bags import TYPES, joint_state, write_bag

numbers = st.lists(st.floats(width=64), max_size=5)
letters = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=9)


@given(
    st.integers(0, 2**31 * 10**9 - 1), st.lists(letters, max_size=5), numbers, numbers, numbers, letters, st.booleans()
)
def test_joints_are_read_as_rosbags_reads_them(stamp_ns, names, position, velocity, effort, frame, little):
    data = joint_state(stamp_ns, names, position, velocity, effort, frame, little)
    (batch,) = decode_joints([data])
    assert batch.stamp_ns.tolist() == [stamp_ns]
    assert (batch.names, batch.frame) == (tuple(names), frame)
    assert bool(batch.error) == (len(position) != len(names))
    for read, written in zip(batch[3:6], (position, velocity, effort), strict=True):
        expected = written if len(written) == len(names) else [np.nan] * len(names)
        assert read[0].tobytes() == np.array(expected).tobytes()


def test_messages_of_one_length_are_told_apart_by_names_and_frame():
    kinds = [(('ab', 'c'), 'run_1'), (('ab', 'c'), 'run_2'), (('ac', 'b'), 'run_2')]
    messages = [joint_state(k, *kinds[k // 4][:1], [k, -k], frame=kinds[k // 4][1]) for k in range(12)]
    batches = list(decode_joints(messages))
    assert [(batch.names, batch.frame, batch.messages) for batch in batches] == [(*kind, 4) for kind in kinds]
    assert np.concatenate([batch.position[:, 0] for batch in batches]).tolist() == list(range(12))


@given(st.binary(min_size=12, max_size=80))
def test_bytes_that_are_no_joint_state_are_no_harm(data):
    assert sum(batch.messages for batch in decode_joints([data, data])) == 2


def record(folder: Path, seconds: int = 4, rate: int = 50) -> Recorder:
    """A recording that is not closed yet; each second is a chunk."""
    recorder = Recorder(folder, {'note': 'cut me'})
    recorder.add_topic('/joint_states', 'sensor_msgs/msg/JointState', [offered_qos(True, False, 1000)])
    recorder.add_topic('/synchronized', 'std_msgs/msg/Bool', [offered_qos(True, True, 1)])
    for k in range(seconds * rate):
        recorder.write('/joint_states', joint_state(k, ['front_wheel', 'rear_wheel'], [k, -k]))
        if (k + 1) % rate == 0:
            recorder.flush()
    return recorder


@pytest.fixture(scope='module')
def unclosed(tmp_path_factory):
    folder = tmp_path_factory.mktemp('unclosed') / 'killed'
    record(folder).abort()
    return folder


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(share=st.floats(0.0, 1.0))
def test_recording_cut_anywhere_keeps_every_whole_chunk(unclosed, tmp_path_factory, share):
    folder = tmp_path_factory.mktemp('cut') / 'killed'
    shutil.copytree(unclosed, folder)
    (file,) = folder.glob('*.mcap')
    content = file.read_bytes()
    size = 8 + round(share * (len(content) - 8))
    file.write_bytes(content[:size])
    whole = sum(chunk < size for chunk in ends_of_chunks(content)) * 50
    if not whole:
        with pytest.raises(ValueError, match='nothing was recorded'):
            Recording(folder)
        return
    with Recording(folder) as recording:
        stamps = np.concatenate([batch.stamp_ns for batch in recording.joints('/joint_states')])
    assert stamps.tolist() == list(range(whole))
    # What others read is as whole: index, counts, quality of service, the operator's note.
    with file.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_summary().statistics.message_count == whole
        assert sum(1 for _ in reader.iter_messages(['/joint_states'])) == whole
    with Reader(folder) as reader:
        assert reader.message_count == whole
        assert sum(1 for _ in reader.messages()) == whole
        assert reader.topics['/synchronized'].connections[0].ext.offered_qos_profiles[0].durability.name == (
            'TRANSIENT_LOCAL'
        )
        assert reader.storage.metadata.custom['note'] == 'cut me'


def ends_of_chunks(content: bytes) -> list[int]:
    ends, at = [], 8
    while at < len(content):
        length = int.from_bytes(content[at + 1 : at + 9], 'little')
        if content[at] == 6:
            ends.append(at + 9 + length - 1)
        at += 9 + length
    return ends


def test_recording_in_progress_is_left_alone(tmp_path):
    recorder = record(tmp_path / 'busy')
    before = recorder.size
    with pytest.raises(ValueError, match='is being recorded; end that first'):
        Recording(tmp_path / 'busy')
    assert (tmp_path / 'busy' / 'busy_0.mcap').stat().st_size == before
    recorder.close()
    with Recording(tmp_path / 'busy') as recording:
        assert recording.count('/joint_states') == 200


def test_lock_is_the_recorders(tmp_path):
    recorder = record(tmp_path / 'busy')
    with (tmp_path / 'busy' / 'busy_0.mcap').open('rb') as file, pytest.raises(BlockingIOError):
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    recorder.abort()


MESSAGES = [(10**18 + k * 10**7, joint_state(k, ['front_wheel', 'rear_wheel'], [k, -k])) for k in range(300)]


@pytest.mark.parametrize(
    ('storage', 'compression'),
    [
        (StoragePlugin.MCAP, CompressionMode.NONE),
        (StoragePlugin.MCAP, CompressionMode.STORAGE),
        (StoragePlugin.SQLITE3, CompressionMode.NONE),
        (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
    ],
)
def test_bags_of_others_are_read(tmp_path, storage, compression):
    bag = write_bag(tmp_path / 'bag', MESSAGES, '/lab/joint_states', storage, compression)
    with Recording(bag) as recording:
        topic = recording.find('joint_states')
        assert topic == '/lab/joint_states'
        assert [data for _, _, data in recording.messages([topic])] == [data for _, data in MESSAGES]
        begin = recording.start_ns
        some = [log_ns for _, log_ns, _ in recording.messages([topic], begin + 10**9, begin + 2 * 10**9)]
        assert (len(some), some[0] - begin) == (100, 10**9)
    lone = [file for file in bag.iterdir() if file.suffix in ('.mcap', '.db3')]
    if lone and compression is not CompressionMode.MESSAGE:
        with Recording(lone[0]) as recording:
            assert recording.count('/lab/joint_states') == 300


def test_killed_ros2_bag_record_is_mended(tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES * 40)
    (bag / 'metadata.yaml').unlink()  # which ros2 bag record writes at its end
    file = bag / 'bag.mcap'
    file.write_bytes(file.read_bytes()[:-3000])
    with Recording(bag) as recording:
        count = recording.count('/joint_states')
        assert 0 < count <= 12000
        assert sum(batch.messages for batch in recording.joints('/joint_states')) == count
        assert recording.types == {'/joint_states': 'sensor_msgs/msg/JointState'}
    with Reader(bag) as reader:
        assert reader.message_count == count
        assert TYPES.deserialize_cdr(next(reader.messages())[2], 'sensor_msgs/msg/JointState').name[0] == 'front_wheel'


def test_wrong_files_are_told_apart(tmp_path):
    (tmp_path / 'empty').mkdir()
    (tmp_path / 'notes.txt').write_text('not a bag')
    (tmp_path / 'text.mcap').write_text('this is no MCAP file, whatever its name says')
    (tmp_path / 'text.db3').write_text('nor is this a data base')
    (tmp_path / 'short.mcap').write_bytes(b'\x89MCAP0\r\n')
    (tmp_path / 'torn').mkdir()
    (tmp_path / 'torn' / 'metadata.yaml').write_text('rosbag2_bagfile_information: 3')
    (tmp_path / 'parts').mkdir()
    for part in ('parts_0.mcap', 'parts_1.mcap'):
        (tmp_path / 'parts' / part).write_bytes(b'\x89MCAP0\r\n')
    for name, message in {
        'nowhere': 'does not exist',
        'empty': 'is no recording: it has neither metadata.yaml nor an .mcap or .db3 file',
        'notes.txt': 'is no recording: give its folder, an .mcap or a .db3 file',
        'text.mcap': 'cannot be read: File magic is invalid',
        'text.db3': 'cannot be read: ',
        'short.mcap': 'nothing was recorded',
        'torn': 'cannot be read: ',
        'parts': 'run ros2 bag reindex',
    }.items():
        with pytest.raises(ValueError, match=re.escape(message)) as caught:
            Recording(tmp_path / name)
        assert name in str(caught.value)
        assert '\n' not in str(caught.value)


def test_topics_are_found_in_any_namespace_unless_several_fit(tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES[:3], '/rig/encoders')
    with Recording(bag) as recording:
        assert recording.find('encoders') == recording.find('/rig/encoders') == '/rig/encoders'
        with pytest.raises(
            ValueError, match='no topic joint_states of sensor_msgs/msg/JointState; of this type it has: /rig/encoders'
        ):
            recording.find('joint_states')

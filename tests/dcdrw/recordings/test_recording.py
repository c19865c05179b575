"""Recordings, whoever made them and however they ended."""

import os
import re
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
import zstandard
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag2 import Reader, StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.rosbag2.enums import CompressionMode

from dcdrw.recordings.bag_file import Stream
from dcdrw.recordings.joint_batch import decode_joints
from dcdrw.recordings.mending import mend
from dcdrw.recordings.recorder import Recorder, offered_qos
from dcdrw.recordings.recording import Recording
from dcdrw.trials.results import read_trial
from tests.bags import JOINT_STATE, JOINTS, TYPES, joint_state, write_bag

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
        recorder.write(JOINTS, joint_state(k, ['front_wheel', 'rear_wheel'], [k, -k]))
        if (k + 1) % rate == 0:
            recorder.flush()
    return recorder


@pytest.fixture(scope='module')
def unclosed(tmp_path_factory):
    folder = tmp_path_factory.mktemp('unclosed') / 'killed'
    record(folder).abort()
    return folder


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp('whole') / 'killed'
    record(folder).close()
    return folder


def damaged_copy(folder: Path, target: Path, change: Callable[[bytearray], Any]) -> Path:
    """A copy of a recording with other bytes."""
    shutil.copytree(folder, target)
    (file,) = target.glob('*.mcap')
    content = bytearray(file.read_bytes())
    change(content)
    file.write_bytes(content)
    return target


def read(path: Path) -> tuple[list[int], list[str]]:
    """The stamps of the joint states that can be read, and what could not be; the recording stays as it is."""
    before = contents(path)
    with Recording(path) as recording:
        stamps = [stamp for batch in recording.joints(JOINTS) for stamp in batch.stamp_ns.tolist()]
        assert recording.damage or recording.count(JOINTS) == len(stamps)
        damage = recording.damage
    assert contents(path) == before
    return stamps, damage


def contents(path: Path) -> dict[Path, tuple[bytes, int]]:
    """Every file, and when it was written."""
    files = [path] if path.is_file() else path.iterdir()
    return {file: (file.read_bytes(), file.stat().st_mtime_ns) for file in files}


@settings(max_examples=40, suppress_health_check=list(HealthCheck))
@given(share=st.floats(0.0, 1.0))
@example(share=0.25)
def test_recording_cut_anywhere_keeps_every_whole_chunk(unclosed, tmp_path_factory, share):
    folder = tmp_path_factory.mktemp('cut')
    size = 0

    def cut(content: bytearray) -> None:
        nonlocal size
        size = 8 + round(share * (len(content) - 8))
        del content[size:]

    (file,) = unclosed.glob('*.mcap')
    spans = chunks(file.read_bytes())
    ends = [end for _, end in spans]
    copy = damaged_copy(unclosed, folder / 'killed', cut)
    whole = 50 * sum(end <= size for end in ends)
    if size < ends[0]:
        with pytest.raises(ValueError, match=r'nothing was recorded|no topic'), Recording(copy) as recording:
            recording.find('joint_states')
        return
    stamps, damage = read(copy)
    assert stamps[:whole] == list(range(whole))
    assert stamps == list(range(len(stamps)))
    told = yaml.safe_load((unclosed / 'metadata.yaml').read_text())['rosbag2_bagfile_information']['message_count']
    # Of a cut index nothing is missed; of a whole chunk that is gone the metadata tell, which came after it.
    assert bool(damage) == (any(begin < size < end for begin, end in spans) or len(stamps) < told)
    # What others read of the mended one is as whole: index, counts, quality of service, the operator's note.
    with Recording(copy) as recording:
        assert mend(recording, folder / 'mended') == len(stamps)
    with (folder / 'mended' / 'mended_0.mcap').open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_summary().statistics.message_count == len(stamps)
        assert sum(1 for _ in reader.iter_messages(['/joint_states'])) == len(stamps)
    with Reader(folder / 'mended') as reader:
        assert reader.message_count == len(stamps)
        assert sum(1 for _ in reader.messages()) == len(stamps)
        assert reader.storage.metadata.custom['note'] == 'cut me'
        for connection in reader.connections:
            assert connection.ext.offered_qos_profiles[0].depth == 1000


@settings(max_examples=100, suppress_health_check=list(HealthCheck))
@given(share=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7), closed=st.booleans())
@example(share=0.943359375, bit=0, closed=True)
@example(share=0.89453125, bit=0, closed=True)
def test_flipped_bit_costs_its_chunk_at_most(unclosed, whole, tmp_path_factory, share, bit, closed):
    place = 0

    def flip(content: bytearray) -> None:
        nonlocal place
        place = int(share * len(content))
        content[place] ^= 1 << bit

    source = whole if closed else unclosed
    (file,) = source.glob('*.mcap')
    spans = chunks(file.read_bytes())
    stamps, damage = read(damaged_copy(source, tmp_path_factory.mktemp('flipped') / 'killed', flip))
    hit = {k for k, (begin, end) in enumerate(spans) if begin <= place < end}
    kept = {stamp for k in range(len(spans)) if k not in hit for stamp in range(50 * k, 50 * k + 50)}
    assert kept <= set(stamps)
    assert stamps == sorted(set(stamps))
    assert damage or len(stamps) == 200


def chunks(content: bytes) -> list[tuple[int, int]]:
    """Begin and end of each chunk."""
    return [(begin, end) for begin, end in records(content) if content[begin] == 6]


def records(content: bytes) -> list[tuple[int, int]]:
    spans, at = [], 8
    while at < len(content) - 8:
        end = at + 9 + int.from_bytes(content[at + 1 : at + 9], 'little')
        spans.append((at, end))
        at = end
    return spans


@settings(max_examples=20, suppress_health_check=list(HealthCheck))
@given(place=st.integers(8, 10_000), size=st.integers(1, 500), filling=st.integers(0, 255))
def test_overwritten_stretch_costs_what_it_touches(unclosed, tmp_path_factory, place, size, filling):
    def overwrite(content: bytearray) -> None:
        content[place : place + size] = bytes([filling]) * len(content[place : place + size])

    (file,) = unclosed.glob('*.mcap')
    stamps, _ = read(damaged_copy(unclosed, tmp_path_factory.mktemp('overwritten') / 'killed', overwrite))
    for k, (begin, end) in enumerate(chunks(file.read_bytes())):
        if end <= place or begin >= place + size:
            assert set(range(50 * k, 50 * k + 50)) <= set(stamps)


def test_damage_is_named_with_what_can_be_done(unclosed, tmp_path):
    (file,) = unclosed.glob('*.mcap')
    begin, end = chunks(file.read_bytes())[1]

    def flip(content: bytearray) -> None:
        content[(begin + end) // 2] ^= 1

    copy = damaged_copy(unclosed, tmp_path / 'killed', flip)
    with Recording(copy) as recording:
        assert recording.count(JOINTS) == 150
        assert recording.damage == [
            f'{copy}/killed_0.mcap: the chunk at byte {begin} ({end - begin - 9 - 44} bytes) is damaged'
        ]
        assert recording.notes == [
            f'{copy}/killed_0.mcap was not closed: its recorder was killed, or is at work; what it has so far is read',
            f'`dcdrw mend {copy} --out NEW` writes what can be read into a new recording',
        ]


def test_recording_in_progress_is_read_and_goes_on(tmp_path):
    recorder = record(tmp_path / 'busy')
    assert read(tmp_path / 'busy' / 'busy_0.mcap') == (list(range(200)), [])
    recorder.write(JOINTS, joint_state(200, ['front_wheel', 'rear_wheel'], [200, -200]))
    recorder.close()
    assert read(tmp_path / 'busy') == (list(range(201)), [])


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
        assert topic.name == '/lab/joint_states'
        assert [data for _, _, data in recording.messages([topic])] == [data for _, data in MESSAGES]
        begin = recording.start_ns
        some = [log_ns for _, log_ns, _ in recording.messages([topic], begin + 10**9, begin + 2 * 10**9)]
        assert (len(some), some[0] - begin) == (100, 10**9)
        assert not recording.damage
        assert not recording.notes
    (bag / 'metadata.yaml').unlink()
    (file,) = bag.iterdir()
    renamed = file.rename(bag / f'walk{"".join(file.suffixes)}')
    before = contents(bag)
    for path in (bag, renamed):
        with Recording(path) as recording:
            assert [data for _, _, data in recording.messages([Stream('/lab/joint_states', JOINT_STATE)])] == [
                data for _, data in MESSAGES
            ]
            assert recording.count(Stream('/lab/joint_states', JOINT_STATE)) == 300
    assert contents(bag) == before


def test_renamed_file_is_read_and_the_metadata_that_name_another_are_told_of(tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES)
    (bag / 'bag.mcap').rename(bag / 'walk.mcap')
    with Recording(bag) as recording:
        assert recording.count(JOINTS) == 300
        assert recording.notes == [
            f'metadata.yaml of {bag} names bag.mcap, which is not there; walk.mcap is read in its place'
        ]


def test_a_part_that_the_metadata_name_and_that_is_gone_is_damage(tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES)
    metadata = bag / 'metadata.yaml'
    metadata.write_text(metadata.read_text().replace('  - bag.mcap\n', '  - bag.mcap\n  - bag_1.mcap\n'))
    stamps, damage = read(bag)
    assert len(stamps) == len(MESSAGES)
    assert damage == [f'metadata.yaml of {bag} names bag_1.mcap, which is not there']


def test_parts_of_a_killed_recorder_are_one_recording(tmp_path):
    """Eleven files, some compressed already, one twice for the kill came between; no metadata.yaml yet."""
    folder = tmp_path / 'bag'
    folder.mkdir()
    for k in range(11):
        part = write_bag(tmp_path / f'part{k}', MESSAGES[20 * k : 20 * k + 20])
        content = (part / f'part{k}.mcap').read_bytes()
        if k < 5:
            (folder / f'bag_{k}.mcap.zstd').write_bytes(zstandard.compress(content))
        if k >= 4:
            (folder / f'bag_{k}.mcap').write_bytes(content)
    (folder / 'bag_4.mcap.zstd').write_bytes(b'torn')
    stamps, damage = read(folder)
    assert (stamps, damage) == (list(range(220)), [])


@pytest.mark.parametrize('share', [0.9, 0.9999])
def test_a_compressed_file_that_is_cut_off_is_told_of_and_read_as_far_as_it_goes(share, tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES * 200)
    packed = zstandard.compress(next(bag.glob('*.mcap')).read_bytes(), level=1)
    cut = tmp_path / 'cut.mcap.zstd'
    cut.write_bytes(packed[: int(share * len(packed))])
    with Recording(cut) as recording:
        assert 'the file is cut off' in recording.damage[0]
        list(recording.messages([JOINTS]))
    whole = tmp_path / 'two_frames.mcap.zstd'
    whole.write_bytes(b''.join(map(zstandard.compress, (next(bag.glob('*.mcap')).read_bytes(), b''))))
    with Recording(whole) as recording:
        assert recording.damage == []
        assert len(list(recording.messages([JOINTS]))) == 200 * len(MESSAGES)


PIECE = 2**17
"""What rosbag2 compresses at once [bytes]."""


def compressed(content: bytes) -> bytes:
    """As rosbag2 compresses a file: a piece that is not full ends the frame, and where there is none, nothing does."""
    packer = zstandard.ZstdCompressor().compressobj()
    parts = [packer.compress(content[at : at + PIECE]) for at in range(0, len(content), PIECE)]
    return b''.join(parts) + (packer.flush() if len(content) % PIECE else b'')


def full_pieces(path: Path, storage: StoragePlugin) -> bytes:
    """A recording of 6000 messages whose size is a multiple of what rosbag2 compresses at once."""
    if storage == StoragePlugin.SQLITE3:
        (file,) = write_bag(path, MESSAGES * 20, storage=storage).glob('*.db3')
        with closing(sqlite3.connect(file, isolation_level=None)) as connection:
            connection.execute('CREATE TABLE filler (data BLOB)')
            while file.stat().st_size % PIECE:
                connection.execute('INSERT INTO filler VALUES (zeroblob(4000))')
        return file.read_bytes()
    content = one_chunk(MESSAGES * 20)
    return one_chunk(MESSAGES * 20, filling=-len(content) % PIECE)


def one_chunk(messages: list[tuple[int, bytes]], filling: int = 0) -> bytes:
    """An MCAP file with one chunk, which is not compressed."""
    file = BytesIO()
    writer = Writer(file, chunk_size=2**24, compression=CompressionType.NONE)
    writer.start('ros2', 'one chunk')
    writer.add_metadata('filling', {'': 'x' * filling})
    schema = writer.register_schema(JOINT_STATE, 'ros2msg', b'')
    channel = writer.register_channel(JOINTS.name, 'cdr', schema)
    for log_ns, data in messages:
        writer.add_message(channel, log_ns, data, log_ns)
    writer.finish()
    return file.getvalue()


@pytest.mark.parametrize('storage', list(StoragePlugin))
def test_a_compressed_file_without_an_end_is_whole_where_its_content_is(storage, tmp_path):
    content = full_pieces(tmp_path / 'bag', storage)
    packed = compressed(content)
    assert len(content) % PIECE == 0
    assert zstandard.get_frame_parameters(packed).content_size == zstandard.CONTENTSIZE_UNKNOWN
    file = tmp_path / f'bag_0.{"db3" if storage == StoragePlugin.SQLITE3 else "mcap"}.zstd'
    file.write_bytes(packed)
    with Recording(file) as recording:
        assert len(list(recording.messages([JOINTS]))) == 6000
        assert (recording.damage, recording.notes) == ([], [])
    for short in (compressed(content[:-PIECE]), packed[:-9]):
        file.write_bytes(short)
        with Recording(file) as recording:
            assert 'the file is cut off' in recording.damage[0]


@pytest.mark.parametrize('storage', list(StoragePlugin))
@pytest.mark.parametrize('described', [True, False])
@pytest.mark.parametrize(
    ('plain', 'packed'),
    [
        (1.0, 1.0),  # the player was here
        (0.6, 1.0),  # and was killed
        (1.0, 0.6),  # the recorder was killed while it compressed
        (1.0, 0.0),
    ],
)
def test_of_a_file_that_is_there_compressed_and_not_the_whole_one_is_read(storage, described, plain, packed, tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES * 20, storage=storage, compression=CompressionMode.FILE)
    (file,) = bag.glob('*.zstd')
    content = file.read_bytes()
    whole = zstandard.ZstdDecompressor().decompressobj().decompress(content)
    file.write_bytes(content[: int(packed * len(content))])
    file.with_suffix('').write_bytes(whole[: int(plain * len(whole))])
    if not described:
        (bag / 'metadata.yaml').unlink()
    with Recording(bag) as recording:
        assert len(list(recording.messages([JOINTS]))) == 6000
        assert recording.damage == []
        told = [note for note in recording.notes if 'metadata.yaml' not in note]
        assert told == ([] if packed == 1 else [f'{file} is not whole; {file.stem} is read in its place'])


def test_of_a_file_that_is_there_compressed_and_not_the_one_that_the_metadata_name_is_read(tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES)
    (bag / 'bag.mcap.zstd').write_bytes(b'of something else')
    assert read(bag) == (list(range(300)), [])
    with Recording(bag) as recording:
        assert recording.notes == []


def test_parts_that_are_there_twice_are_read_once_where_the_metadata_name_others(tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES, compression=CompressionMode.FILE)
    packed = bag / 'bag.mcap.zstd'
    (bag / 'walk.mcap').write_bytes(zstandard.ZstdDecompressor().decompressobj().decompress(packed.read_bytes()))
    packed.rename(bag / 'walk.mcap.zstd')
    shutil.copy(bag / 'walk.mcap.zstd', bag / 'walk.mcap.zst')
    assert read(bag) == (list(range(300)), [])


def test_a_file_that_the_metadata_name_twice_is_read_once(tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES)
    metadata = bag / 'metadata.yaml'
    metadata.write_text(metadata.read_text().replace('  - bag.mcap\n', '  - bag.mcap\n' * 3))
    assert metadata.read_text().count('- bag.mcap') == 3
    with Recording(bag) as recording:
        assert len(list(recording.messages([JOINTS]))) == len(MESSAGES)


def test_broken_part_costs_itself(tmp_path):
    folder = tmp_path / 'bag'
    folder.mkdir()
    for k in range(3):
        part = write_bag(tmp_path / f'part{k}', MESSAGES[20 * k : 20 * k + 20])
        (folder / f'bag_{k}.mcap').write_bytes((part / f'part{k}.mcap').read_bytes())
    (folder / 'bag_1.mcap').write_text('version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n')
    stamps, damage = read(folder)
    assert stamps == [*range(20), *range(40, 60)]
    assert damage == [f'{folder}/bag_1.mcap is a pointer of Git LFS, not the recording itself: run git lfs pull']


def test_mcap_without_index_statistics_and_repeated_channels_is_read(tmp_path):
    for name, options in {
        'bare': {'use_statistics': False, 'repeat_channels': False, 'repeat_schemas': False},
        'flat': {'use_chunking': False},
        'flat_and_bare': {'use_chunking': False, 'use_statistics': False, 'repeat_channels': False},
        'lz4': {'compression': CompressionType.LZ4},
        'unindexed': {'index_types': IndexType.NONE, 'enable_crcs': False},
    }.items():
        path = tmp_path / f'{name}.mcap'
        with path.open('wb') as file:
            writer = Writer(file, chunk_size=4096, **options)
            writer.start('', 'no profile')
            definition, _ = TYPES.generate_msgdef('sensor_msgs/msg/JointState', ros_version=2)
            schema = writer.register_schema('sensor_msgs/msg/JointState', 'ros2msg', definition.encode())
            channel = writer.register_channel('/joint_states', 'cdr', schema)
            for log_ns, data in MESSAGES:
                writer.add_message(channel, log_ns, data, log_ns)
            writer.finish()
        assert read(path) == (list(range(300)), [])


@given(count=st.integers(1, 299), more=st.integers(0, 114))
@example(count=1, more=0)
def test_of_an_uncompressed_chunk_that_is_cut_off_every_whole_message_is_read_and_the_cut_told_of_once(
    tmp_path_factory, count, more
):
    path = tmp_path_factory.mktemp('cut') / 'cut.mcap'
    content = one_chunk(MESSAGES)
    ((begin, end),) = chunks(content)
    first = begin + 9 + 32 + 8
    _, _, *messages = records(bytes(8) + content[first:end] + bytes(8))  # after the schema and the channel
    cut = first + messages[count - 1][1] - 8
    path.write_bytes(content[: cut + more])
    stamps, damage = read(path)
    assert stamps == list(range(count))
    if more:
        said = f'{more} byte{"s" if more > 1 else ""} from byte {cut} on {"are" if more > 1 else "is"}'
        assert damage == [f'{path}: {said} the beginning of what is missing']
    else:
        there = f'{cut - first} of {end - first} bytes are there'
        assert damage == [f'{path}: the chunk at byte {begin} is cut off: {there}']


def test_messages_of_chunks_that_overlap_come_in_the_order_of_time(tmp_path):
    path = tmp_path / 'overlapping.mcap'
    with path.open('wb') as file:
        writer = Writer(file, chunk_size=2000)
        writer.start('ros2', 'two threads')
        schema = writer.register_schema('sensor_msgs/msg/JointState', 'ros2msg', b'')
        channel = writer.register_channel('/joint_states', 'cdr', schema)
        shuffled = [MESSAGES[k ^ 9] for k in range(288)]
        for log_ns, data in shuffled:
            writer.add_message(channel, log_ns, data, log_ns)
        writer.finish()
    assert read(path) == (list(range(288)), [])


def killed_sqlite(folder: Path, checkpointed: int) -> Path:
    """A sqlite3 recording in WAL mode whose recorder was killed: the last messages are in the -wal file alone."""
    source = write_bag(folder.with_name('closed'), MESSAGES, storage=StoragePlugin.SQLITE3) / 'closed.db3'
    connection = sqlite3.connect(source)
    rows = connection.execute('SELECT topic_id, timestamp, data FROM messages ORDER BY id').fetchall()
    connection.execute('PRAGMA journal_mode = wal')
    connection.execute('PRAGMA wal_autocheckpoint = 0')
    connection.execute('DELETE FROM messages')
    insert = 'INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)'
    connection.executemany(insert, rows[:checkpointed])
    connection.commit()
    connection.execute('PRAGMA wal_checkpoint(TRUNCATE)')
    connection.executemany(insert, rows[checkpointed:])
    connection.commit()
    folder.mkdir()
    for end in ('', '-wal', '-shm'):
        shutil.copy(source.with_name(source.name + end), folder / f'killed_0.db3{end}')
    connection.close()
    return folder


@pytest.mark.parametrize('checkpointed', [0, 100])
def test_killed_sqlite_recording_is_read_with_what_stands_in_its_journal(tmp_path, checkpointed):
    folder = killed_sqlite(tmp_path / 'killed', checkpointed)
    assert read(folder) == (list(range(300)), [])
    assert read(folder / 'killed_0.db3') == (list(range(300)), [])
    with Recording(folder) as recording:
        assert any('was not closed' in note for note in recording.notes)
        assert mend(recording, tmp_path / 'mended') == 300


BEGUN = """\
version: 9
storage_identifier: sqlite3
duration:
  nanoseconds: 0
starting_time:
  nanoseconds_since_epoch: 9223372036854775807
message_count: 0
topics_with_message_count:
  []
compression_format: ""
compression_mode: ""
relative_file_paths:
  - bag_0.db3
files:
  - path: bag_0.db3
    starting_time:
      nanoseconds_since_epoch: 9223372036854775807
    duration:
      nanoseconds: 0
    message_count: 0
custom_data: ~
ros_distro: jazzy"""
"""The metadata that rosbag2 writes into an sqlite3 file as it opens it."""
SPLIT = BEGUN.replace('    message_count: 0', '    message_count: 8791')
"""Those that it writes as it goes on in the next file: into this one, and into that one."""
ENDED = BEGUN.replace('message_count: 0', 'message_count: 300')


@pytest.mark.parametrize(
    ('told', 'closed'),
    [
        ([BEGUN], False),
        ([SPLIT], False),
        ([BEGUN, ENDED], True),
        ([BEGUN, SPLIT], True),
        ([SPLIT, ENDED], True),
        ([ENDED], True),  # as rosbags does, which writes them at the end alone
        ([], True),  # as ROS Humble does, which writes none
        (None, True),  # as earlier ones do, which have no such table
    ],
)
def test_sqlite_recording_that_its_recorder_did_not_close_is_told_of(told, closed, tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES, storage=StoragePlugin.SQLITE3)
    with closing(sqlite3.connect(bag / 'bag.db3')) as connection, connection:
        connection.execute('DELETE FROM metadata')
        if told is None:
            connection.execute('DROP TABLE metadata')
        else:
            connection.executemany(
                'INSERT INTO metadata (metadata_version, metadata) VALUES (9, ?)', [(text,) for text in told]
            )
    assert read(bag) == (list(range(300)), [])
    said = [
        f'{bag}/bag.db3 was not closed: its recorder was killed, or is at work; what it has so far is read',
        f'`dcdrw mend {bag} --out NEW` writes what can be read into a new recording',
    ]
    with Recording(bag) as recording:
        assert recording.notes == ([] if closed else said)


@pytest.mark.parametrize('storage', list(StoragePlugin))
def test_a_folder_without_metadata_is_told_of_and_judged_by_all_that_is_there(storage, tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES, storage=storage)
    (bag / 'metadata.yaml').unlink()
    assert read(bag) == (list(range(300)), [])
    with Recording(bag) as recording:
        assert recording.notes == [f'{bag} has no metadata.yaml, so whether files are missing is not known']


def test_sqlite_recording_in_progress_is_read_and_locks_nobody_out(tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES, storage=StoragePlugin.SQLITE3)
    writer = sqlite3.connect(bag / 'bag.db3', timeout=0.0)
    writer.execute('PRAGMA journal_mode = wal')
    with Recording(bag) as recording:
        messages = recording.messages([JOINTS])
        assert next(messages).data == MESSAGES[0][1]
        writer.execute(
            'INSERT INTO messages (topic_id, timestamp, data) SELECT topic_id, timestamp + 1, data FROM messages'
        )
        writer.commit()
        assert sum(1 for _ in messages) == 299
    with Recording(bag) as recording:
        assert recording.count(JOINTS) == 600
    writer.close()


@settings(max_examples=20, suppress_health_check=list(HealthCheck))
@given(share=st.floats(0.5, 1.0, exclude_max=True))
def test_sqlite_recording_that_is_cut_off_is_read_as_far_as_it_goes(sqlite_bag, tmp_path_factory, share):
    path = tmp_path_factory.mktemp('cut') / 'bag.db3'
    content = sqlite_bag.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with Recording(path) as recording:
        read = [message.data for message in recording.messages([JOINTS])]
        assert 'is cut off' in recording.damage[0]
    assert read == [data for _, data in MESSAGES][: len(read)]
    assert len(read) >= (share - 0.4) * len(MESSAGES)
    assert path.stat().st_size == int(share * len(content))


@pytest.mark.parametrize('metadata', ['a folder', 'damaged'])
def test_metadata_that_cannot_be_read_cost_nothing_but_a_note(metadata, tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES)
    (bag / 'metadata.yaml').unlink()
    if metadata == 'a folder':
        (bag / 'metadata.yaml').mkdir()
    else:
        (bag / 'metadata.yaml').write_text('a: [')
    with Recording(bag) as recording:
        assert recording.count(JOINTS) == len(MESSAGES)
        assert 'the recording is read without it' in recording.notes[0]
        assert not recording.damage


@settings(max_examples=40, suppress_health_check=list(HealthCheck))
@given(share=st.floats(0.0, 1.0, exclude_max=True), filling=st.integers(0, 255))
def test_damaged_page_of_a_sqlite_recording_costs_its_rows(sqlite_bag, tmp_path_factory, share, filling):
    path = tmp_path_factory.mktemp('damaged') / 'bag.db3'
    content = bytearray(sqlite_bag.read_bytes())
    leaves = [at for at in range(4096, len(content), 4096) if content[at] == 13 and content[at + 4] > 10]
    at = leaves[int(share * len(leaves))]
    content[at : at + 4096] = bytes([filling]) * 4096
    path.write_bytes(content)
    stamps, _ = read(path)
    lost = set(range(300)) - set(stamps)
    assert len(stamps) == len(set(stamps))
    assert len(lost) <= 40  # as many as a page holds
    if lost:
        assert list(range(min(lost), max(lost) + 1)) == sorted(lost)


@pytest.fixture(scope='module')
def sqlite_bag(tmp_path_factory):
    folder = tmp_path_factory.mktemp('sqlite') / 'bag'
    return write_bag(folder, MESSAGES, storage=StoragePlugin.SQLITE3) / 'bag.db3'


def test_killed_ros2_bag_record_is_read_and_mended(tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES * 40)
    (bag / 'metadata.yaml').unlink()  # which ros2 bag record writes at its end
    file = bag / 'bag.mcap'
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with Recording(bag) as recording:
        count = recording.count(JOINTS)
        assert 4000 < count < 8000
        assert sum(batch.messages for batch in recording.joints(JOINTS)) == count
        assert list(recording.topics) == [JOINTS]
        assert mend(recording, tmp_path / 'mended') == count
    with Reader(tmp_path / 'mended') as reader:
        assert reader.message_count == count
        assert TYPES.deserialize_cdr(next(reader.messages())[2], 'sensor_msgs/msg/JointState').name[0] == 'front_wheel'


def test_wrong_files_are_told_apart(tmp_path):
    (tmp_path / 'empty').mkdir()
    (tmp_path / 'notes.txt').write_text('not a bag')
    (tmp_path / 'old').mkdir()
    for name in ('old.bag', 'old/of_1.bag'):
        (tmp_path / name).write_bytes(b'#ROSBAG V2.0\n')
    (tmp_path / 'text.mcap').write_text('this is not an MCAP file, whatever its name says')
    (tmp_path / 'text.db3').write_text('nor is this a data base')
    (tmp_path / 'short.mcap').write_bytes(b'\x89MCAP0\r\n')
    (tmp_path / 'torn').mkdir()
    (tmp_path / 'torn' / 'metadata.yaml').write_text('rosbag2_bagfile_information: 3')
    (tmp_path / 'pointer.mcap').write_text('version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n')
    (tmp_path / 'several').mkdir()
    for part in ('monday_0.mcap', 'tuesday_0.mcap'):
        (tmp_path / 'several' / part).write_bytes(b'\x89MCAP0\r\n')
    for name, message in {
        'nowhere': 'does not exist',
        'empty': 'is not a recording: it has no *.mcap, *.db3 file',
        'notes.txt': 'is not a recording: give its folder, or a file that ends in .mcap, .db3',
        'old.bag': 'is a recording of ROS 1: `rosbags-convert --src',
        'old': 'is a recording of ROS 1: `rosbags-convert --src',
        'text.mcap': 'is not an MCAP file',
        'text.db3': 'is not an sqlite3 file',
        'short.mcap': 'nothing was recorded',
        'torn': 'has metadata.yaml but none of the files',
        'pointer.mcap': 'is a pointer of Git LFS',
        'several': 'has several recordings and no metadata.yaml: give one of',
    }.items():
        with pytest.raises(ValueError, match=re.escape(message)) as caught:
            Recording(tmp_path / name)
        assert name in str(caught.value)
        assert '\n' not in str(caught.value)


def test_topics_are_found_in_any_namespace_unless_several_fit(tmp_path):
    bag = write_bag(tmp_path / 'bag', MESSAGES[:3], '/rig/encoders')
    with Recording(bag) as recording:
        assert recording.find('encoders') == recording.find('/rig/encoders') == Stream('/rig/encoders', JOINT_STATE)
        with pytest.raises(
            ValueError, match='no topic joint_states of sensor_msgs/msg/JointState; of this type it has: /rig/encoders'
        ):
            recording.find('joint_states')


@pytest.mark.parametrize('storage', list(StoragePlugin))
@pytest.mark.parametrize('first', [0, 1])
def test_of_a_name_that_carries_several_types_each_is_read_for_what_it_is(tmp_path, storage, first):
    """As in merged recordings, or where a driver's type was changed; whichever type comes first."""
    other = 'std_msgs/msg/String'
    text = bytes(TYPES.serialize_cdr(TYPES.types[other]('none of ours'), other))
    with BagWriter(tmp_path / 'bag', version=9, storage_plugin=storage) as writer:
        kinds = sorted((JOINT_STATE, other), reverse=bool(first))
        connections = {kind: writer.add_connection('/joint_states', kind, typestore=TYPES) for kind in kinds}
        for log_ns, data in MESSAGES:
            writer.write(connections[other], log_ns, text)
            writer.write(connections[JOINT_STATE], log_ns, data)
    with Recording(tmp_path / 'bag') as recording:
        assert recording.find('joint_states') == JOINTS
        assert sum(batch.messages for batch in recording.joints(JOINTS)) == recording.count(JOINTS) == len(MESSAGES)
        said = ', '.join(f'{kind} ({len(MESSAGES)} messages)' for kind in kinds)
        assert recording.notes == [f'{tmp_path / "bag"}: /joint_states carries messages of several types: {said}']
        assert mend(recording, tmp_path / 'mended') == 2 * len(MESSAGES)
    with Reader(tmp_path / 'mended') as reader:
        kept = [connection.msgtype for connection, _, _ in reader.messages()]
    assert {kind: kept.count(kind) for kind in kinds} == dict.fromkeys(kinds, len(MESSAGES))


def test_a_topic_of_the_right_name_and_another_type_is_told(tmp_path):
    with BagWriter(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.write(writer.add_connection('/rig/joint_states', 'std_msgs/msg/String', typestore=TYPES), 1, b'')
    with (
        Recording(tmp_path / 'bag') as recording,
        pytest.raises(ValueError, match=r'of this type it has: none; its /rig/joint_states is of std_msgs/msg/String$'),
    ):
        recording.find('joint_states')


def test_names_that_would_break_a_line_or_command_a_terminal_are_escaped(tmp_path):
    bag = write_bag(tmp_path / 'topic', MESSAGES[:3], '/joint\nstates\x1b[2J')
    with Recording(bag) as recording, pytest.raises(ValueError, match=re.escape(r'it has: /joint\nstates\x1b[2J')):
        recording.find('joint_states')
    names = ['front\nwheel', 'rear_wheel\x1b[31m']
    joints = write_bag(tmp_path / 'joints', [(10**18, joint_state(10**18, names, [0.1, 0.2]))])
    with pytest.raises(ValueError, match=re.escape(r'the message names front\nwheel, rear_wheel\x1b[31m')):
        read_trial(joints)


def test_two_suites_are_told_apart_by_their_namespace(tmp_path):
    with BagWriter(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for k, topic in enumerate(('/rig_1/joint_states', '/rig_2/joint_states', '/joint_states')):
            connection = writer.add_connection(topic, 'sensor_msgs/msg/JointState', typestore=TYPES)
            writer.write(connection, 10**18 + k, MESSAGES[k][1])
    with Recording(tmp_path / 'bag') as recording:
        with pytest.raises(ValueError, match='choose one with --namespace / or /rig_1 or /rig_2'):
            recording.find('joint_states')
        assert recording.find('joint_states', namespace='/') == JOINTS
        for space in ('rig_2', '/rig_2', '/rig_2/'):
            assert recording.find('joint_states', namespace=space).name == '/rig_2/joint_states'
        with pytest.raises(ValueError, match='no topic joint_states of sensor_msgs/msg/JointState in rig_3'):
            recording.find('joint_states', namespace='rig_3')


@pytest.mark.parametrize('time', ['NULL', "'noon'", "x'00ff'", '1.5', '9e99'])
def test_rows_of_sqlite_without_a_possible_time_cost_themselves_alone(tmp_path, time):
    bag = write_bag(
        tmp_path / 'bag',
        [(10**18 + k * 10**7, joint_state(10**18 + k * 10**7, ['front_wheel'], [k / 50])) for k in range(20)],
        storage=StoragePlugin.SQLITE3,
    )
    with closing(sqlite3.connect(next(bag.glob('*.db3')))) as connection, connection:
        connection.execute('CREATE TABLE loose AS SELECT * FROM messages')
        connection.execute('DROP TABLE messages')
        connection.execute('ALTER TABLE loose RENAME TO messages')
        connection.execute(f'UPDATE messages SET timestamp = {time} WHERE rowid = 7')
    with Recording(bag) as recording:
        times = [message.log_ns for message in recording.messages([JOINTS])]
        assert times == [10**18 + k * 10**7 for k in range(20) if k != 6]
        assert recording.damage


def test_a_pipe_is_no_recording_and_keeps_nobody_waiting(tmp_path):
    os.mkfifo(tmp_path / 'pipe.mcap')
    with pytest.raises(ValueError, match=r'pipe\.mcap is not a recording'):
        Recording(tmp_path / 'pipe.mcap')


def test_a_part_that_nobody_may_read_is_told_without_the_systems_numbers(tmp_path, monkeypatch):
    def refuse(path, name):
        raise PermissionError(13, 'Permission denied', name)

    path = write_bag(tmp_path / 'bag', [(0, joint_state(0, ['front_wheel'], [0.0]))]) / 'bag.mcap'
    monkeypatch.setattr('dcdrw.recordings.mcap_file.McapFile', refuse)
    with pytest.raises(ValueError, match=re.escape(f'{path}: permission denied')):
        Recording(path)

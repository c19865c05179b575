"""Real files, damaged at random, before every reader: each ends in a result or in one line that names the file.

    python -m tests.fuzz [--inputs 100000] [--seed 0]      (`make fuzz`)

The tests do the same with hypothesis, on fewer inputs.
"""

import argparse
import random
import resource
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import zstandard
from rosbags.rosbag2 import StoragePlugin

from dcdrw.parts_list import read_parts
from dcdrw.recordings.recorder import Recorder, offered_qos
from dcdrw.recordings.recording import Recording
from dcdrw.suite.parameter_file import TrialParams, read_parameter_file
from dcdrw.trials.results import read_trial
from dcdrw.trials.rolling import table_samples
from dcdrw_control.legs.csv_file import read_legs
from dcdrw_msgs_py.camera import pinhole, read_camera, write_camera
from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.motion.cases import read_cases
from dcdrw_tracker.node.video import VideoFile
from tests import ROOT
from tests.bags import joint_state, write_bag

SLOWEST = 5.0
"""What a file of a few kilobytes may take [s], on a machine that is busy with other things."""


class Reader(NamedTuple):
    """What reads a kind of file, and files of that kind."""

    read: Callable[[Path], Any]
    ending: str
    seeds: tuple[bytes, ...]


def _messages() -> list[tuple[int, bytes]]:
    return [(10**18 + k * 10**7, joint_state(10**18 + k * 10**7, ['front_wheel', 'rear_wheel'], [k / 50, k / 60 - 0.1]))
            for k in range(200)]  # fmt: skip


def _recordings(folder: Path) -> dict[str, bytes]:
    """A recording in each storage."""
    for name, ends in (('killed', Recorder.abort), ('closed', Recorder.close)):
        recorder = Recorder(folder / name)
        joints = recorder.add_topic('/joint_states', 'sensor_msgs/msg/JointState', [offered_qos(True, False)])
        for k, (log_ns, data) in enumerate(_messages()):
            recorder.write(joints, data, log_ns)
            if k % 50 == 49:
                recorder.flush()
        ends(recorder)
    others = write_bag(folder / 'others', _messages()) / 'others.mcap'
    sqlite = write_bag(folder / 'sqlite', _messages(), storage=StoragePlugin.SQLITE3) / 'sqlite.db3'
    return {
        name: path.read_bytes()
        for name, path in {
            'killed': folder / 'killed' / 'killed_0.mcap',
            'closed': folder / 'closed' / 'closed_0.mcap',
            'others': others,
            'sqlite': sqlite,
        }.items()
    }


def _read_all(path: Path) -> None:
    """Read a recording to its end."""
    with Recording(path) as recording:
        for _ in recording.messages(list(recording.topics)):
            pass


def _judge(path: Path) -> None:
    read_trial(path)


def _watch(path: Path) -> None:
    for _ in islice(VideoFile(path).frames(), 5):
        pass


def readers() -> dict[str, Reader]:
    """Every reader of files, with real files."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bags = _recordings(folder)
        write_camera(folder / 'camera.yaml', pinhole(640, 480, 60.0))
        camera = (folder / 'camera.yaml').read_bytes()
        video = _video(folder)
    legs = b'time,left_gyr_x,left_gyr_y,left_gyr_z,left_acc_x,left_acc_y,left_acc_z\n' + b''.join(
        b'%f,0.1,-0.2,1e-3,0,0,9.81\n' % (k / 100) for k in range(40)
    )
    encoders = b'time,psi1,psi2\n' + b''.join(b'%f,%f,%f\n' % (k / 50, k / 40, k / 40 + 0.13) for k in range(60))
    parts = b'kind,value,name\nspring,5,"soft, long"\ndashpot,100,x\nspring,50,\n'
    mcaps = tuple(bags[kind] for kind in ('killed', 'closed', 'others'))
    return {
        'MCAP': Reader(_read_all, '.mcap', mcaps),
        'sqlite3': Reader(_read_all, '.db3', (bags['sqlite'],)),
        'compressed': Reader(_read_all, '.mcap.zstd', tuple(map(zstandard.compress, mcaps))),
        'trial': Reader(_judge, '.mcap', mcaps),
        'rig': Reader(lambda path: read_parameter_file(path, TrialParams()), '.yaml',
                      ((ROOT / 'config' / 'rig.yaml').read_bytes(),)),
        'camera': Reader(read_camera, '.yaml', (camera, (ROOT / 'config' / 'camera.yaml').read_bytes())),
        'cases': Reader(read_cases, '.json', (_case(),)),
        'parts': Reader(read_parts, '.csv', (parts,)),
        'legs': Reader(read_legs, '.csv', (legs,)),
        'encoders': Reader(lambda path: table_samples(path, RigParams()), '.csv', (encoders,)),
        'video': Reader(_watch, '.avi', (video,)),
    }  # fmt: skip


def _video(folder: Path) -> bytes:
    cv2 = opencv()
    writer = cv2.VideoWriter(str(folder / 'film.avi'), cv2.VideoWriter_fourcc(*'MJPG'), 30.0, (64, 48), True)
    for k in range(10):
        writer.write(np.full((48, 64, 3), 20 * k, np.uint8))
    writer.release()
    return (folder / 'film.avi').read_bytes()


def _case() -> bytes:
    return (
        b'[{"g": 9.81, "slope": 0.035, "k": 5.25, "b": 100, "D0": 1.2, "S0": 0.97, "l": [0.97, 0.97], "m": [10, 10], '
        b'"alpha": [0.2618, 0.2618], "x0": [-0.26, 1.0, -0.1, 0.9]}]'
    )


def damaged(seed: bytes, draw: random.Random) -> bytes:
    """Other bytes: some flipped, overwritten, cut out, doubled or put in; mostly a few, so that much stays."""
    content = bytearray(seed)
    for _ in range(draw.choice((1, 1, 1, 2, 5, 20))):
        at = draw.randrange(len(content) + 1)
        size = draw.choice((1, 1, 2, 4, 8, 100, 1000))
        kind = draw.randrange(6)
        if kind == 0 and at < len(content):
            content[at] ^= 1 << draw.randrange(8)
        elif kind == 1:
            filling = draw.choice((b'\0', b'\xff', b'[', b'9', b'"', b'\n'))
            content[at : at + size] = filling * len(content[at : at + size])
        elif kind == 2:
            del content[at : at + size]
        elif kind == 3:
            content[at:at] = content[at : at + size]
        elif kind == 4:
            content[at:at] = draw.randbytes(min(size, 8))
        else:
            del content[at + draw.randrange(1000) :]
    return bytes(content)


def check(reader: Reader, content: bytes, folder: Path) -> str:
    """Read a file; returns the reason where it is refused.

    Raises:
        AssertionError: the refusal is more than a line, does not name the file, or took long; or the file was changed.
        Exception: whatever the reader does not refuse with ValueError or OSError.

    """
    path = folder / f'fuzzed{reader.ending}'
    path.write_bytes(content)
    begin = time.process_time()
    reason = ''
    try:
        reader.read(path)
    except (ValueError, OSError) as error:
        reason = str(error)
        assert path.name in reason, f'the file is not named: {reason}'
        assert '\n' not in reason, f'more than a line: {reason}'
    assert time.process_time() - begin < SLOWEST, f'took {time.process_time() - begin:.1f} s: {reason}'
    assert path.read_bytes() == content
    assert [file.name for file in folder.iterdir()] == [path.name]
    return reason


def main() -> int:
    """Fuzz all readers in turn; each failing input is kept."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--inputs', type=int, default=100_000, help='of all readers together (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args()
    draw = random.Random(options.seed)
    every = readers()
    refused, failed = dict.fromkeys(every, 0), dict.fromkeys(every, 0)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for k in range(options.inputs):
            kind = list(every)[k % len(every)]
            content = damaged(draw.choice(every[kind].seeds), draw)
            try:
                refused[kind] += bool(check(every[kind], content, folder))
            except Exception:
                failed[kind] += 1
                kept = Path(f'fuzz-{kind}-{failed[kind]}{every[kind].ending}')
                kept.write_bytes(content)
                print(f'{kept}: {traceback.format_exc()}', file=sys.stderr)
            for file in folder.iterdir():
                file.unlink()
    print(f'{"reader":12} {"inputs":>8} {"refused":>8} {"failed":>8}')
    for k, kind in enumerate(every):
        print(f'{kind:12} {len(range(k, options.inputs, len(every))):8} {refused[kind]:8} {failed[kind]:8}')
    print(f'most memory: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB')
    return 1 if any(failed.values()) else 0


if __name__ == '__main__':
    sys.exit(main())

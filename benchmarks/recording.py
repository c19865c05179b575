"""The cost of recordings: what the recorder takes from the nodes, and how fast a recording is analyzed.

    python benchmarks/recording.py [--minutes 2] [--rounds 3] [--seconds 5] [--rate 1000] [--no-nodes]
        [--lengths 1 5]

First table: `dcdrw analyze` over joint states at 1 kHz, on one core, beside reading the same file message by message
with rosbags alone; CPU time, the best of the rounds, and what an hour (3.6 million messages) takes. Goal: an hour in
less than a minute.

Second table: the most memory that `dcdrw analyze` and `dcdrw report` take, with all that they write, for recordings of
two lengths. Goal: as much for the long one as for the short one.

Third table: the suite's three processes at 1 kHz with and without a recorder of all of their topics beside them, round
by round: latency from joint states to error, CPU of each process, losses, and what the recorder lacks of what was sent.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import rclpy
from pipeline import SUITE, figures, measure, suite_errors
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from dcdrw.recordings.recorder import Recorder, offered_qos
from dcdrw.recordings.recording import JOINT_STATE, Recording
from dcdrw.suite.parameter_file import TrialParams
from dcdrw.suite.processes import free_domain
from dcdrw.trials.analysis import analyze
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.rig.simulator import SimulatorParams

RATE = 1000


def write(folder: Path, seconds: float) -> int:
    """Record a pair's motion at 1 kHz; return the number of messages."""
    types = get_typestore(Stores.ROS2_JAZZY)
    time_type, header, joint_state = (
        types.types[name] for name in ('builtin_interfaces/msg/Time', 'std_msgs/msg/Header', JOINT_STATE)
    )
    rig, start = SimulatorParams().start(RigParams())
    model = run(rig, start, strikes=int(4 * seconds) + 4)
    motion = model.at(np.arange(int(min(seconds, model.duration) * RATE)) / RATE)
    place, speed = np.column_stack(motion[5:7]), np.column_stack([motion.omega1, motion.omega2])
    coupler = np.column_stack([motion.coupler_length, motion.coupler_rate, motion.coupler_force])
    recorder = Recorder(folder)
    joints = recorder.add_topic('/joint_states', JOINT_STATE, [offered_qos(True, False)])
    for k, (length, rate, force) in enumerate(coupler):
        message = joint_state(
            header(time_type(1_700_000_000 + k // RATE, k % RATE * 1_000_000), ''),
            ['front_wheel', 'rear_wheel', 'coupler'],
            np.array([*place[k], length]),
            np.array([*speed[k], rate]),
            np.array([np.nan, np.nan, force]),
        )
        recorder.write(joints, bytes(types.serialize_cdr(message, JOINT_STATE)))
        if k % (RATE // 2) == 0:
            recorder.flush()
    recorder.close()
    return len(coupler)


def read(folder: Path) -> None:
    with Reader(folder) as reader:
        for _ in reader.messages():
            pass


def judge(folder: Path) -> None:
    with Recording(folder) as recording:
        analyze(recording.joints(recording.find('joint_states')), TrialParams())


def best(works: Sequence[Callable[[Path], None]], folder: Path, rounds: int) -> list[float]:
    """Least CPU time of each, in turn [s]."""
    times: list[list[float]] = [[] for _ in works]
    for _ in range(rounds):
        for work, its in zip(works, times, strict=True):
            start = time.process_time()
            work(folder)
            its.append(time.process_time() - start)
    return [min(its) for its in times]


def compare_reading(minutes: float, rounds: int) -> None:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / 'bag'
        count = write(folder, 60.0 * minutes)
        size = sum(file.stat().st_size for file in folder.iterdir())
        print(f'{count} joint states, {size / count:.0f} bytes each on the disk')
        print(f'{"":24} {"µs a message":>12} {"s an hour":>10} {"ratio":>6}')
        reference, ours = best((read, judge), folder, rounds)
        for name, seconds in (('reading alone', reference), ('dcdrw analyze', ours)):
            print(f'{name:24} {seconds / count * 1e6:12.1f} {seconds / count * 3.6e6:10.1f} {seconds / reference:6.2f}')


def most_memory(*arguments: str) -> float:
    """The most memory that a command takes in a process of its own [MB]."""
    # Not by getrusage, which would count what this process had when it made the other.
    code = (
        'import sys; from dcdrw.cli import main; status = main(sys.argv[1:]); '
        'print(open("/proc/self/status").read(), file=sys.stderr); sys.exit(status)'
    )
    done = subprocess.run([sys.executable, '-c', code, *arguments], capture_output=True, text=True, check=True)
    peak = next(line for line in done.stderr.splitlines() if line.startswith('VmHWM'))
    return int(peak.split()[1]) / 1024.0


def compare_lengths(lengths: Sequence[float]) -> None:
    rows = []
    for minutes in lengths:
        with tempfile.TemporaryDirectory() as temporary:
            bag, out = f'{temporary}/bag', f'{temporary}/out'
            write(Path(bag), 60.0 * minutes)
            rows.append((most_memory('analyze', bag, '--out', out), most_memory('report', bag, '--out', f'{out}.html')))
    print(f'{"most memory [MB]":24} {"dcdrw analyze":>14} {"dcdrw report":>14}')
    for minutes, row in zip(lengths, rows, strict=True):
        print(f'{f"{minutes:g} min":24} ' + ' '.join(f'{value:14.1f}' for value in row))
    print(f'{"  ratio":24} ' + ' '.join(f'{last / first:14.2f}' for first, last in zip(rows[0], rows[-1], strict=True)))


def compare_nodes(rounds: int, seconds: float, rate: float) -> None:
    arguments = ['--ros-args', '--log-level', 'warn', '-p', f'rate:={rate}', '-p', 'slope:=0.05']
    suite = [[sys.executable, '-m', module, *arguments] for module in SUITE]
    print(f'{"":24} {"p50 µs":>8} {"p99 µs":>8} {"CPU %: source + estimator + monitor + recorder":>48} {"lost":>6}')
    alone, beside, lacking, kept = [], [], 0, 0
    for _ in range(rounds):
        alone.append(measure(suite, suite_errors, seconds))
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary) / 'bag'
            recorder = [
                sys.executable,
                '-m',
                'dcdrw.nodes.recorder_node',
                '--ros-args',
                '--log-level',
                'warn',
                '-p',
                f'folder:={folder}',
                '-p',
                'record:=true',
            ]
            beside.append(measure([recorder, *suite], suite_errors, seconds))
            with Recording(folder) as recording:
                stamps = np.concatenate([batch.stamp_ns for batch in recording.joints(recording.find('joint_states'))])
            kept += len(stamps)
            lacking += round((stamps[-1] - stamps[0]) * rate / 1e9) + 1 - len(stamps)
    for name, results in (('suite', alone), ('suite and recorder', beside)):
        p50, p99, *cpu = figures(results)
        each = ' + '.join(f'{value:.1f}' for value in cpu)
        print(f'{name:24} {p50:8.0f} {p99:8.0f} {each:>48} {sum(result.lost for result in results):6d}')
    ratio = figures(beside)[:5] / figures(alone)[:5]
    print(f'{"  ratio":24} {ratio[0]:8.2f} {ratio[1]:8.2f} {" + ".join(f"{value:.2f}" for value in ratio[2:]):>48}')
    print(f'of {kept + lacking} joint states the recorder lacks {lacking}')


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--minutes', type=float, default=2.0, help='length of the recording that is analyzed')
    parser.add_argument(
        '--lengths', type=float, nargs='+', default=(1.0, 5.0), metavar='MINUTES', help='of which memory is compared'
    )
    parser.add_argument('--rounds', type=int, default=3)
    parser.add_argument('--seconds', type=float, default=5.0, help='measured time of the nodes in each round')
    parser.add_argument('--no-nodes', action='store_true', help='only the first table')
    parser.add_argument('--rate', type=float, default=RATE, metavar='HZ', help='of the nodes')
    options = parser.parse_args()
    compare_reading(options.minutes, options.rounds)
    compare_lengths(options.lengths)
    if options.no_nodes:
        return 0
    with free_domain() as domain:
        os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
        rclpy.init()
        compare_nodes(options.rounds, options.seconds, options.rate)
        rclpy.shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())

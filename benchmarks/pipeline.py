"""The pipeline's cost beside that of bare rclpy nodes: latency, CPU and losses of three processes.

    python benchmarks/pipeline.py [--rates 100 1000] [--rounds 3] [--seconds 5]

Three chains are measured at each rate in turn, round by round, on a domain of their own; the table
holds each figure's median over the rounds, and all losses:

- suite: simulator → phase_estimator → sync_monitor;
- one: simulator → estimator, monitor and synchronizer in one process (`suite`);
- bare: three nodes that only copy a float, with the same messages, as many of them, the same QoS and executor.

Latency runs from the stamp of `joint_states` to the arrival of `sync_error` in this process. Each error is matched
to its joint state: the cores are run here again over the joint states, and give the same floats. CPU is of each
process, user and system, in percent of one core. Goals: at most 1.5 times the bare chain's CPU and p99; the one
process, without the simulator's, at most half of the bare chain's CPU and at most its p99; nothing lost.
"""

import argparse
import itertools
import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int32

from dcdrw.suite.executables import TRIAL
from dcdrw.suite.processes import free_domain
from dcdrw_msgs_py.executor import StreamExecutor
from dcdrw_msgs_py.messages import SECOND, JointSampleReader, JointSampleWriter, PhaseSampleWriter, stamp_ns
from dcdrw_msgs_py.node import advertise, listen, run, steady_clock
from dcdrw_msgs_py.samples import CouplerSample, JointSample, Turn
from dcdrw_msgs_py.topics import JOINT_STATES, PHASE_STATE, PHI, STEP_DIFFERENCE, SYNC_ERROR, SYNC_ERROR_PERCENT
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams
from dcdrw_tracker.gait.sync import SyncMonitor, SyncParams

WARM_UP = 3.0
SUITE = [node.module for node in reversed(TRIAL)]
ROLES = ('monitor', 'estimator', 'source')


class BareNode(Node):
    """A link of the bare chain: what the suite's node of this role sends and hears, without its work."""

    def __init__(self, role: str, rate: float) -> None:
        super().__init__(f'bare_{role}')
        if role == 'source':
            self._writer, self._joints = JointSampleWriter(), advertise(self, JOINT_STATES)
            timer = self.create_timer(1.0 / rate, self._send, clock=steady_clock())
            self._period_ns = round(SECOND / rate)
            # As the simulator does: a sample is stamped with the time at which it was due.
            self._due_ns = self.get_clock().now().nanoseconds + timer.time_until_next_call()
        elif role == 'estimator':
            self._message = PhaseSampleWriter()._message
            self._outputs = [advertise(self, topic) for topic in (PHASE_STATE, PHI, STEP_DIFFERENCE)]
            listen(self, JOINT_STATES, self._estimate)
        else:
            self._outputs = [advertise(self, topic) for topic in (SYNC_ERROR, SYNC_ERROR_PERCENT)]
            listen(self, PHASE_STATE, self._monitor)

    def _send(self) -> None:
        late = self.get_clock().now().nanoseconds - self._due_ns
        due = self._due_ns + late // self._period_ns * self._period_ns
        self._due_ns = due + self._period_ns
        self._joints.publish(
            self._writer.write(JointSample(due, Turn(due / SECOND, 0.0), Turn(0.0, 0.0), CouplerSample(0.0, 0.0, 0.0)))
        )

    def _estimate(self, message: JointState) -> None:
        self._message.header.stamp = message.header.stamp
        self._message.position = [message.position[0], 0.0, 0.0, 0.0]
        self._message.velocity = [0.0, 0.0, 0.0, 0.0]
        phase, phi, difference = self._outputs
        phase.publish(self._message)
        phi.publish(Float64(data=message.position[0]))
        difference.publish(Int32(data=0))

    def _monitor(self, message: JointState) -> None:
        for output in self._outputs:
            output.publish(Float64(data=message.position[0]))


class Result(NamedTuple):
    """One chain at one rate."""

    latencies: Any
    """[µs]"""
    cpu: list[float]
    """Percent of a core: source, estimator, monitor."""
    sent: int
    lost: int


def measure(commands: list[list[str]], errors_of: Callable[[list[Any]], list[float]], seconds: float) -> Result:
    """Run a chain and listen to both of its ends."""
    processes = [subprocess.Popen(command, stdout=subprocess.DEVNULL) for command in commands]
    listener = rclpy.create_node('listener')
    joints: list[JointState] = []
    errors: list[tuple[float, int]] = []
    listen(listener, JOINT_STATES, joints.append)
    listen(listener, SYNC_ERROR, lambda message: errors.append((message.data, time.time_ns())))
    executor = StreamExecutor()
    executor.add_node(listener)
    try:
        limit = time.monotonic() + 30.0
        while not errors:
            executor.spin_once(timeout_sec=0.1)
            if time.monotonic() > limit:
                raise SystemExit('no data came through the chain')
        spin(executor, WARM_UP)
        before, start, start_ns = [cpu_seconds(p.pid) for p in processes], time.monotonic(), time.time_ns()
        spin(executor, seconds)
        elapsed, end_ns = time.monotonic() - start, time.time_ns()
        used = [100.0 * (cpu_seconds(p.pid) - b) / elapsed for p, b in zip(processes, before, strict=True)]
        spin(executor, 0.5)  # what is still under way
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait()
        executor.shutdown()
        listener.destroy_node()
    return match(joints, errors_of(joints), errors, used[::-1], start_ns, end_ns)


def match(
    joints: list[JointState],
    expected: list[float],
    errors: list[tuple[float, int]],
    cpu: list[float],
    start_ns: int,
    end_ns: int,
) -> Result:
    """Pair each joint state of the measured time with the error that it led to."""
    latencies, sent, lost = [], 0, 0
    # The ends of the chain were not found at the same instant: begin with the first pair that was heard of both.
    heard = {value for value, _ in errors}
    while expected and expected[0] not in heard:
        joints, expected = joints[1:], expected[1:]
    if not expected:
        raise SystemExit('the errors do not belong to the joint states')
    arrived = itertools.dropwhile(lambda error: error[0] != expected[0], errors)
    pending = next(arrived, None)
    period = np.median(np.diff([stamp_ns(message.header.stamp) for message in joints]))
    last = None
    for message, value in zip(joints, expected, strict=True):
        stamp = stamp_ns(message.header.stamp)
        measured = start_ns <= stamp < end_ns
        if measured and last is not None:
            missing = round((stamp - last) / period) - 1  # never reached this process
            lost, sent = lost + missing, sent + missing
        last = stamp
        if pending and pending[0] == value:
            if measured:
                latencies.append((pending[1] - stamp) / 1e3)
            pending = next(arrived, None)
        elif measured:
            lost += 1
        sent += measured
    return Result(np.array(latencies), cpu, sent, lost)


def suite_errors(joints: list[JointState]) -> list[float]:
    """What the monitor says of each joint state."""
    reader, estimator, monitor = JointSampleReader(), PhaseEstimator(PhaseParams()), SyncMonitor(SyncParams())
    errors = []
    for message in joints:
        update = estimator.update(reader.read(message))
        sync = monitor.update(update.phase) if update else None
        errors.append(sync.error if sync else np.nan)
    return errors


def bare_errors(joints: list[JointState]) -> list[float]:
    """What comes out of the bare chain for each joint state."""
    return [message.position[0] for message in joints]


def cpu_seconds(pid: int) -> float:
    with open(f'/proc/{pid}/stat', encoding='ascii') as file:
        fields = file.read().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def spin(executor: Any, seconds: float) -> None:
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0.0:
        executor.spin_once(timeout_sec=min(left, 0.1))


def figures(results: list[Result]) -> Any:
    """Medians over the rounds: p50, p99 [µs], and each process's CPU [%]."""
    return np.median([[*np.percentile(result.latencies, (50, 99)), *result.cpu] for result in results], axis=0)


def row(name: str, results: list[Result]) -> str:
    p50, p99, *cpu = figures(results)
    each = ' + '.join(f'{value:4.1f}' for value in cpu)
    sent, lost = (sum(counts) for counts in zip(*((r.sent, r.lost) for r in results), strict=True))
    return f'{name:18} {p50:9.0f} {p99:9.0f} {each:>20} {sum(cpu):7.1f} {sent:8d} {lost:6d}'


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--rates', type=float, nargs='+', default=[100.0, 1000.0], metavar='HZ')
    parser.add_argument('--rounds', type=int, default=3, help='how often each chain is measured')
    parser.add_argument('--seconds', type=float, default=5.0, help='measured time of each chain in each round')
    parser.add_argument('--bare', choices=ROLES, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.bare:
        return run(f'bare {options.bare}', lambda: BareNode(options.bare, options.rates[0]), [])
    with free_domain() as domain:
        os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
        rclpy.init()
        compare(options.rates, options.rounds, options.seconds)
        rclpy.shutdown()
    return 0


def compare(rates: list[float], rounds: int, seconds: float) -> None:
    """Measure both chains at each rate, and print the table."""
    print(f'{"chain":18} {"p50 µs":>9} {"p99 µs":>9} {"CPU % of a core":>20} {"in all":>7} {"sent":>8} {"lost":>6}')
    for rate in rates:
        arguments = ['--ros-args', '--log-level', 'warn', '-p', f'rate:={rate}', '-p', 'slope:=0.05']
        suite = [[sys.executable, '-m', module, *arguments] for module in SUITE]
        bare = [[sys.executable, __file__, '--bare', role, '--rates', str(rate)] for role in ROLES]
        hosted = [[sys.executable, '-m', 'dcdrw.nodes.suite', '--ros-args', '--log-level', 'warn'], suite[-1]]
        results = [
            (
                measure(suite, suite_errors, seconds),
                measure(bare, bare_errors, seconds),
                measure(hosted, suite_errors, seconds),
            )
            for _ in range(rounds)
        ]
        ours, theirs, one = ([each[i] for each in results] for i in (0, 1, 2))
        print(row(f'suite {rate:g} Hz', ours), row(f'bare {rate:g} Hz', theirs), sep='\n', flush=True)
        p50, p99, *cpu = figures(ours) / figures(theirs)
        whole = figures(ours)[2:].sum() / figures(theirs)[2:].sum()
        each = ' + '.join(f'{ratio:4.2f}' for ratio in cpu)
        print(f'{"  ratio":18} {p50:9.2f} {p99:9.2f} {each:>20} {whole:7.2f}', flush=True)
        print(row(f'one {rate:g} Hz', one))
        p50, p99 = figures(one)[:2] / figures(theirs)[:2]
        whole = figures(one)[3] / figures(theirs)[2:].sum()
        print(f'{"  ratio":18} {p50:9.2f} {p99:9.2f} {"its process alone":>20} {whole:7.2f}', flush=True)


if __name__ == '__main__':
    sys.exit(main())

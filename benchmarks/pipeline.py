"""The pipeline's cost beside that of bare rclpy nodes: latency, CPU and losses.

    python benchmarks/pipeline.py [--rates 100 1000] [--rounds 3] [--seconds 5]

Three chains are measured at each rate in turn, round by round, on a domain of their own; the table
holds each figure's median over the rounds, and all losses:

- suite: simulator → phase_estimator → sync_monitor and synchronizer, four processes;
- one: simulator → estimator, monitor and synchronizer in one process (`suite`);
- bare: four nodes that only copy a float, with the same messages, as many of them, the same QoS and executor, taken and
  published as rclpy does.

The synchronizer is enabled, and pushes by the law `hold`. Latency runs from the stamp of `joint_states` to the arrival
in this process of `sync_error`, and of the first `coupler_wrench` that knows of it; the latter waits for the next of
500 ticks a second, here as there. Each error is matched to its joint state: the cores are run here again over the joint
states, and give the same floats. CPU is of each process, user and system, in percent of one core. Goals: at most 1.5
times the bare chain's CPU and p99; the one process at most half of the CPU of the three bare ones that do its part, and
at most their p99 from joint state to command; nothing lost.
"""

import argparse
import os
import subprocess
import sys
import time
from collections import defaultdict, deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Int32

from dcdrw.suite.executables import PHASE_ESTIMATOR, SIMULATOR, SYNC_MONITOR, SYNCHRONIZER
from dcdrw.suite.processes import free_domain
from dcdrw_control.sync.synchronizer import SynchronizerParams
from dcdrw_msgs_py.executor import StreamExecutor
from dcdrw_msgs_py.messages import SECOND, JointSampleReader, JointSampleWriter, PhaseSampleWriter, stamp_ns
from dcdrw_msgs_py.node import advertise, listen, message_type, run, steady_clock
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import CouplerSample, JointSample, Turn
from dcdrw_msgs_py.topics import (
    COUPLER_FORCE_COMMAND,
    COUPLER_WRENCH,
    ENABLE,
    JOINT_STATES,
    PHASE_STATE,
    PHI,
    STEP_DIFFERENCE,
    SYNC_ERROR,
    SYNC_ERROR_PERCENT,
    SYNC_STATE,
    Topic,
)
from dcdrw_sim.map.holding import law, plant
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams
from dcdrw_tracker.gait.sync import SyncMonitor, SyncParams

WARM_UP = 3.0
SLOPE = 0.05
SUITE = [node.module for node in (SYNCHRONIZER, SYNC_MONITOR, PHASE_ESTIMATOR, SIMULATOR)]
ROLES = ('synchronizer', 'monitor', 'estimator', 'source')
HEARTBEAT = 0.05
"""From one enable to the next [s]."""


class BareNode(Node):
    """A link of the bare chain: what the suite's node of this role sends and hears, without its work."""

    def __init__(self, role: str, rate: float) -> None:
        super().__init__(f'bare_{role}')
        if role == 'source':
            self._writer, self._joints = JointSampleWriter(), self._send_on(JOINT_STATES)
            self._hear(COUPLER_FORCE_COMMAND, lambda message: None)
            timer = self.create_timer(1.0 / rate, self._send, clock=steady_clock())
            self._period_ns = round(SECOND / rate)
            # As the simulator does: a sample is stamped with the time at which it was due.
            self._due_ns = self.get_clock().now().nanoseconds + timer.time_until_next_call()
        elif role == 'estimator':
            self._message = PhaseSampleWriter()._message
            self._outputs = [self._send_on(topic) for topic in (PHASE_STATE, PHI, STEP_DIFFERENCE)]
            self._hear(JOINT_STATES, self._estimate)
        elif role == 'monitor':
            self._state = JointState(name=['phase', 'sync_error'], position=[0.0, 0.0], velocity=[0.0, 0.0])
            self._outputs = [self._send_on(topic) for topic in (SYNC_STATE, SYNC_ERROR, SYNC_ERROR_PERCENT)]
            self._hear(PHASE_STATE, self._monitor)
        else:
            self._wrench = WrenchStamped()
            self._outputs = [self._send_on(topic) for topic in (COUPLER_FORCE_COMMAND, COUPLER_WRENCH)]
            self._hear(PHASE_STATE, self._keep)
            self.create_timer(1.0 / SynchronizerParams().rate, self._command, clock=steady_clock())

    def _send_on(self, topic: Topic) -> Any:
        return self.create_publisher(message_type(topic), topic.name, topic.depth)

    def _hear(self, topic: Topic, callback: Callable[[Any], None]) -> None:
        qos = QoSProfile(depth=topic.depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(message_type(topic), topic.name, callback, qos)

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
        self._state.header.stamp = message.header.stamp
        state, *errors = self._outputs
        state.publish(self._state)
        for error in errors:
            error.publish(Float64(data=message.position[0]))

    def _keep(self, message: JointState) -> None:
        self._wrench.header.stamp = message.header.stamp

    def _command(self) -> None:
        force, wrench = self._outputs
        force.publish(Float64(data=0.0))
        wrench.publish(self._wrench)


class Result(NamedTuple):
    """One chain at one rate."""

    latencies: Any
    """Of errors [µs]."""
    command_latencies: Any
    """[µs]"""
    cpu: list[float]
    """Percent of a core: source, and what comes after it."""
    sent: int
    lost: int


def measure(commands: list[list[str]], errors_of: Callable[[list[Any]], list[float]], seconds: float) -> Result:
    """Run a chain, the source last, and listen to its ends."""
    processes = [subprocess.Popen(command, stdout=subprocess.DEVNULL) for command in commands]
    listener = rclpy.create_node('listener')
    joints: list[JointState] = []
    errors: list[tuple[float, int]] = []
    wrenches: list[tuple[int, int]] = []
    listen(listener, JOINT_STATES, joints.append)
    listen(listener, SYNC_ERROR, lambda message: errors.append((message.data, time.time_ns())))
    listen(listener, COUPLER_WRENCH, lambda message: wrenches.append((stamp_ns(message.header.stamp), time.time_ns())))
    enable = advertise(listener, ENABLE)
    listener.create_timer(HEARTBEAT, lambda: enable.publish(Bool(data=True)), clock=steady_clock())
    executor = StreamExecutor()
    executor.add_node(listener)
    try:
        limit = time.monotonic() + 30.0
        while not (errors and wrenches):
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
    latencies, sent, lost = match(joints, errors_of(joints), errors, start_ns, end_ns)
    return Result(latencies, answered(joints, wrenches, start_ns, end_ns), used[::-1], sent, lost)


def answered(joints: list[JointState], wrenches: list[tuple[int, int]], start_ns: int, end_ns: int) -> Any:
    """How long after each joint state of the measured time the first command arrived that knew of it [µs]."""
    stamps, arrivals = np.array(wrenches, dtype=np.int64).T
    stamps = np.maximum.accumulate(stamps)  # a synchronizer that has a fault forgets its sample
    asked = np.array([stamp_ns(message.header.stamp) for message in joints], dtype=np.int64)
    asked = asked[(asked >= start_ns) & (asked < end_ns)]
    place = np.searchsorted(stamps, asked)
    return (arrivals[place[place < len(arrivals)]] - asked[place < len(arrivals)]) / 1e3


def match(
    joints: list[JointState],
    expected: list[float],
    errors: list[tuple[float, int]],
    start_ns: int,
    end_ns: int,
) -> tuple[Any, int, int]:
    """Pair each joint state of the measured time with the error that it led to: latencies [µs], sent, lost."""
    latencies, sent, lost = [], 0, 0
    arrived = defaultdict[float, deque[int]](deque)
    for value, at in errors:
        arrived[value].append(at)
    # The ends of the chain were not found at the same instant: begin with the first pair that was heard of both.
    while expected and expected[0] not in arrived:
        joints, expected = joints[1:], expected[1:]
    if not expected:
        raise SystemExit('the errors do not belong to the joint states')
    period = np.median(np.diff([stamp_ns(message.header.stamp) for message in joints]))
    last = None
    for message, value in zip(joints, expected, strict=True):
        stamp = stamp_ns(message.header.stamp)
        measured = start_ns <= stamp < end_ns
        if measured and last is not None:
            missing = round((stamp - last) / period) - 1  # never reached this process
            lost, sent = lost + missing, sent + missing
        last = stamp
        at = arrived[value].popleft() if arrived[value] else None
        if measured and at:
            latencies.append((at - stamp) / 1e3)
        elif measured:
            lost += 1
        sent += measured
    return np.array(latencies), sent, lost


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
    """Medians over the rounds: p50, p99 of errors, then of commands [µs], and each process's CPU [%]."""
    return np.median(
        [
            [*np.percentile(one.latencies, (50, 99)), *np.percentile(one.command_latencies, (50, 99)), *one.cpu]
            for one in results
        ],
        axis=0,
    )


def row(name: str, results: list[Result]) -> str:
    every = figures(results)
    times = ' '.join(f'{value:9.0f}' for value in every[:4])
    each = ' + '.join(f'{value:4.1f}' for value in every[4:])
    sent, lost = (sum(counts) for counts in zip(*((r.sent, r.lost) for r in results), strict=True))
    return f'{name:14} {times} {each:>27} {sum(every[4:]):7.1f} {sent:7d} {lost:5d}'


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
    """Measure the chains at each rate, and print the table."""
    print(f'{"":14} {"sync_error, µs":>19} {"command, µs":>19}')
    print(
        f'{"chain":14} {"p50":>9} {"p99":>9} {"p50":>9} {"p99":>9} '
        f'{"CPU % of a core":>27} {"in all":>7} {"sent":>7} {"lost":>5}'
    )
    chosen = law(plant(RigParams(slope=SLOPE)))
    gains = {
        'law': 'hold',
        'hold.state': [float(value) for value in chosen.state],
        'hold.gain': [float(value) for value in chosen.gain],
    }
    own = {SYNCHRONIZER.name: gains, 'simulator': {'slope': SLOPE}}
    for rate in rates:
        own['simulator']['rate'] = rate
        arguments = ['--ros-args', '--log-level', 'warn']
        for node, values in own.items():
            for name, value in values.items():
                arguments += ['-p', f'{node}:{name}:={value}']
        suite = [[sys.executable, '-m', module, *arguments] for module in SUITE]
        bare = [[sys.executable, __file__, '--bare', role, '--rates', str(rate)] for role in ROLES]
        hosted = [[sys.executable, '-m', 'dcdrw.nodes.suite', *arguments], suite[-1]]
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
        print(ratios(figures(ours)[4:], figures(theirs)[4:], figures(ours)[:4] / figures(theirs)[:4]))
        print(row(f'one {rate:g} Hz', one))
        parts = np.array([figures(theirs)[4], figures(theirs)[5:].sum()])
        print(ratios(figures(one)[4:], parts, figures(one)[:4] / figures(theirs)[:4]), flush=True)


def ratios(ours: Any, theirs: Any, latencies: Any) -> str:
    """What each process takes beside the bare ones, and the latencies beside theirs."""
    times = ' '.join(f'{value:9.2f}' for value in latencies)
    each = ' + '.join(f'{value:4.2f}' for value in ours / theirs)
    return f'{"  ratio":14} {times} {each:>27} {ours.sum() / theirs.sum():7.2f}'


if __name__ == '__main__':
    sys.exit(main())

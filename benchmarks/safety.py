"""Whatever dies while the synchronizer pushes: how soon no force is left on the pair, trial by trial.

    python benchmarks/safety.py [--trials 100] [--kinds simulator phase_estimator synchronizer nan heartbeat]
        [--results FILE.jsonl [--seconds 300]]

Simulator, estimator and synchronizer run as processes, in real time at 1 kHz. In each trial the pair starts from 10 %,
shortly before a strike, and once the synchronizer pushes with more than 1 N one of them is killed (SIGKILL), or a
`phase_state` with NaN or without a wheel is sent every 5 ms, or the heartbeat is released: by false, or by silence,
which counts from its expiry. Measured until the command is 0 N and stays so, and, where the simulator lives, until no
force acts on the simulated pair, whatever commands it has heard; the later counts. Times are those at which the node
itself sent the message (DDS's source timestamp), so that this process may be late without harm. A trial passes if that
takes at most 100 ms, and no command was ever beyond the limit. One stack serves all trials; only what was killed is
started again.

With --results each trial is kept in a file, and those that are there already are not tried again; with --seconds it
ends after so long, and the next run goes on.
"""

import argparse
import contextlib
import importlib
import json
import math
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterator
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from dcdrw.suite.executables import PHASE_ESTIMATOR, SIMULATOR, SYNCHRONIZER, Executable
from dcdrw.suite.processes import free_domain
from dcdrw_control.sync.safety import Limits, State
from dcdrw_control.sync.synchronizer import SynchronizerParams
from dcdrw_msgs_py.executor import StreamExecutor
from dcdrw_msgs_py.messages import JointSampleReader, PhaseSampleWriter, stamp_ns
from dcdrw_msgs_py.node import advertise, listen, message_type, steady_clock
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import SECOND, JointSample, PhaseSample, Turn
from dcdrw_msgs_py.topics import (
    COUPLER_FORCE_COMMAND,
    ENABLE,
    FRONT_STANCE,
    JOINT_STATES,
    PHASE_STATE,
    SYNCHRONIZER_STATE,
    Topic,
)
from dcdrw_sim.map.holding import eased, law, plant
from dcdrw_sim.model.dynamics import coupler_force
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.trajectory import run

NODES = (SYNCHRONIZER, PHASE_ESTIMATOR, SIMULATOR)
KILLED = tuple(node.name for node in reversed(NODES))
KINDS = (*KILLED, 'nan', 'heartbeat')
WITHIN = 0.1
"""After this there must be no force [s]."""
WATCHED = 0.25
"""How long a trial is watched after the event [s]."""
BEFORE = 0.05
"""A trial starts so long before the first strike of the front wheel [s]."""
PUSH = 1.0
"""A force beyond this is on [N]."""
NOTHING = 1e-6
"""A force within this is none: told from spring and damper no better than so [N]."""
HEARTBEAT = 0.02
"""[s]"""
PATIENCE = 60.0
"""Limit of every wait [s]."""


def run_node(module: str, arguments: list[str]) -> None:
    """A node's own program."""
    sys.exit(importlib.import_module(module).main(arguments))


class Stack:
    """Simulator, estimator and synchronizer as processes, and what is heard of them here."""

    def __init__(self, rig: RigParams, **simulator: Any) -> None:
        about = plant(rig)
        chosen = eased(law(about), about)
        self.rig = rig.resolved()
        self._parameters: dict[str, dict[str, Any]] = {
            SIMULATOR.name: simulator,
            PHASE_ESTIMATOR.name: {},
            SYNCHRONIZER.name: {
                'law': 'hold',
                'hold.state': [float(value) for value in chosen.state],
                'hold.gain': [float(value) for value in chosen.gain],
                'hold.middle': float(chosen.middle),
            },
        }
        # A server that has imported everything forks each node, so that one is there in a fraction of a second.
        self._processes = multiprocessing.get_context('forkserver')
        self._processes.set_forkserver_preload(['__main__', *(node.module for node in NODES)])
        self._running: dict[str, ForkServerProcess] = {}
        self._node = rclpy.create_node('safety')
        self._reader = JointSampleReader()
        self.joints: list[tuple[float, JointSample]] = []
        """When they were sent [s], and what."""
        self.commands: list[tuple[float, float]] = []
        """When they were sent [s], and what [N]."""
        self.state = ''
        self.states: list[str] = []
        """All that were told."""
        self.enabled = False
        self._clients: dict[str, Any] = {}
        self._hear(JOINT_STATES, lambda one, when: self.joints.append((when, self._reader.read(one))))
        self._hear(COUPLER_FORCE_COMMAND, lambda one, when: self.commands.append((when, one.data)))
        listen(self._node, SYNCHRONIZER_STATE, self._on_state)
        self.phases = advertise(self._node, PHASE_STATE)
        self._enable = advertise(self._node, ENABLE)
        self.last_heartbeat = -math.inf
        self._node.create_timer(HEARTBEAT, self._beat, clock=steady_clock())
        self._executor = StreamExecutor()
        self._executor.add_node(self._node)
        for node in NODES:
            self.start(node)

    def start(self, node: Executable) -> None:
        """Start a node that does not run."""
        arguments = ['--ros-args', '--log-level', 'fatal']
        for name, value in self._parameters[node.name].items():
            arguments += ['-p', f'{name}:={value}']
        process = self._processes.Process(target=run_node, args=(node.module, arguments), daemon=True)
        process.start()
        self._running[node.name] = process

    def kill(self, name: str) -> None:
        """SIGKILL, without a warning."""
        self._running[name].kill()
        self._running[name].join()

    def revive(self) -> list[str]:
        """Start again what was killed, and tell what that is."""
        dead = [node for node in NODES if not self._running[node.name].is_alive()]
        for node in dead:
            self._running[node.name].join()
            self.start(node)
        return [node.name for node in dead]

    def close(self) -> None:
        """End all."""
        for process in self._running.values():
            process.kill()
            process.join()
        self._executor.shutdown()
        self._node.destroy_node()

    def set(self, simulator: dict[str, Any]) -> None:
        """Other parameters for a simulator that is started from now on."""
        self._parameters[SIMULATOR.name] |= simulator

    def call(self, name: str, kind: Any = Trigger, **request: Any) -> None:
        """Call a service until it answers."""
        if name not in self._clients:
            self._clients[name] = self._node.create_client(kind, name)
        client = self._clients[name]
        self.wait(client.service_is_ready, f'the service {name}')
        answer = client.call_async(kind.Request(**request))
        with contextlib.suppress(TimeoutError):  # a server may find its client late: its answer is lost then
            self.wait(answer.done, f'an answer of {name}', 1.0)

    def beat(self, on: bool) -> None:
        """Send a heartbeat now."""
        self.last_heartbeat = time.time()
        self._enable.publish(Bool(data=on))

    def wait(self, condition: Callable[[], Any], what: str, limit: float = PATIENCE) -> None:
        """Listen until a condition holds.

        Raises:
            TimeoutError: it does not.

        """
        end = time.monotonic() + limit
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError(f'{what} did not come within {limit:g} s')
            self._executor.spin_once(timeout_sec=0.01)

    def wait_for_estimator(self) -> None:
        """Until it tells of the simulator that runs now: DDS may take some seconds to tell it of that."""
        begun = self.joints[-1][1].stamp_ns
        told: list[int] = []
        hearing = self._hear(PHASE_STATE, lambda one, when: told.append(stamp_ns(one.header.stamp)))
        self.wait(lambda: told and told[-1] > begun, 'an estimator that hears the simulator')
        self._node.destroy_subscription(hearing)

    def listen(self, seconds: float) -> None:
        """Listen for a while."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def external_force(self, sample: JointSample) -> float:
        """What acts on the pair beside spring and damper [N]."""
        length, rate, force = sample.coupler
        return force - float(coupler_force(self.rig, length, rate))

    def rest(self) -> list[str]:
        """Let go of the pair, forget a fault, and see that all nodes run; tell which were started again."""
        self.enabled = False
        revived = self.revive()
        self.wait(self._rests, 'a synchronizer at rest')
        end = time.monotonic() + PATIENCE
        while self.state == State.FAULT.value and time.monotonic() < end:  # a request may be lost as well
            self.call('synchronizer/reset_fault')
            with contextlib.suppress(TimeoutError):
                self.wait(lambda: self.state == State.DISABLED.value, 'the end of the fault', 1.0)
        return revived

    def push(self) -> None:
        """From a fresh start, let the synchronizer push."""
        if SIMULATOR.name not in self.rest():
            self.call('simulator/reset')
        self.joints.clear()
        self.commands.clear()
        self.wait(lambda: self.joints and self.commands, 'joint states and commands')
        self.enabled = True
        self.wait(lambda: self.is_pushing or self.state == State.FAULT.value, 'a force')

    def _rests(self) -> bool:
        self.beat(False)
        return self.state in (State.DISABLED.value, State.FAULT.value)

    @property
    def is_pushing(self) -> bool:
        """Whether a force acts, by the command and on the pair."""
        return (
            self.state == State.ACTIVE.value
            and abs(self.commands[-1][1]) > PUSH
            and abs(self.external_force(self.joints[-1][1])) > PUSH
        )

    def _on_state(self, message: Any) -> None:
        self.state = message.data
        self.states.append(message.data)

    def _beat(self) -> None:
        if self.enabled:
            self.beat(True)

    def _hear(self, topic: Topic, take: Callable[[Any, float], None]) -> Any:
        """Listen to a topic; `take` is told when each message was sent [s]."""

        def pass_on(message: Any, info: Any) -> None:
            take(message, info['source_timestamp'] / SECOND)

        qos = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)
        return self._node.create_subscription(message_type(topic), topic.name, pass_on, qos)


@contextlib.contextmanager
def stack_of(rig: RigParams, **simulator: Any) -> Iterator[Stack]:
    """A stack on a domain of its own."""
    with free_domain() as domain:
        # As in the tests, over UDP within this machine: who is killed leaves locks in shared memory.
        os.environ.update(
            ROS_DOMAIN_ID=str(domain),
            ROS_AUTOMATIC_DISCOVERY_RANGE='SUBNET',
            FASTRTPS_DEFAULT_PROFILES_FILE=str(Path(__file__).parents[1] / 'tests' / 'data' / 'loopback.xml'),
        )
        rclpy.init()
        stack = Stack(rig, **simulator)
        try:
            yield stack
        finally:
            stack.close()
            rclpy.shutdown()


_BAD_PHASES = (
    PhaseSampleWriter().write(PhaseSample(0, Turn(), Turn(), Turn(), 0)),  # all NaN
    JointState(name=[FRONT_STANCE], position=[0.0]),
)


class Trial(NamedTuple):
    """What one trial came to."""

    seconds: float
    """From the event until there was no force [s]; infinite where one was left."""
    largest: float
    """Command [N]."""

    @property
    def has_passed(self) -> bool:
        """Whether the force was gone in time, and never beyond its limit."""
        return self.seconds <= WITHIN and self.largest <= Limits().max_force


def trial(stack: Stack, kind: str, number: int) -> Trial:
    """Let the synchronizer push, and take something away."""
    stack.push()
    while not stack.is_pushing:  # on a busy machine a stall may be a fault
        stack.push()
    event = time.time()
    if kind in KILLED:
        stack.kill(kind)
    elif kind == 'heartbeat':
        stack.enabled = False
        if number % 2:
            stack.beat(False)
        else:
            event = stack.last_heartbeat + SynchronizerParams().enable_timeout
    while time.time() < event + WATCHED:
        if kind == 'nan' and stack.state == State.ACTIVE.value:  # as a sick source does, again and again
            stack.phases.publish(_BAD_PHASES[number % 2])
        stack.listen(0.005)
    heard = []
    if kind != SYNCHRONIZER.name:
        heard.append([(when - event, force) for when, force in stack.commands])
    if kind != SIMULATOR.name:
        heard.append([(when - event, stack.external_force(sample)) for when, sample in stack.joints])
    return Trial(max(map(gone_after, heard)), max(abs(force) for _, force in stack.commands))


def gone_after(forces: list[tuple[float, float]]) -> float:
    """When the last force was told [s]; infinite where none was told to be gone after the time that is allowed."""
    if forces[-1][0] <= WITHIN or abs(forces[-1][1]) > NOTHING:
        return math.inf
    return max(0.0, *(when for when, force in forces if abs(force) > NOTHING))


def shortly_before_a_strike(rig: RigParams, phase: float) -> dict[str, float]:
    """The simulator's start: from a phase on, BEFORE the first strike of the front wheel."""
    rig, begun = start(rig, phase)
    motion = run(rig, begun, strikes=2)
    strike = next(one for one in motion.strikes if one.wheel == 1)
    at = motion.at([strike.t - BEFORE])  # the feet are S0 apart
    return {name: float(getattr(at, name)[0]) for name in ('theta1', 'omega1', 'theta2', 'omega2')}


def row(kind: str, found: list[Trial]) -> str:
    """A line of the table."""
    seconds = [one.seconds for one in found]
    times = f'{1e3 * np.median(seconds):10.1f} {1e3 * max(seconds):9.1f}'
    passed = sum(one.has_passed for one in found)
    return f'{kind:18} {passed:3} of {len(found):3} {times} {max(one.largest for one in found):10.2f}'


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else '')
    parser.add_argument('--trials', type=int, default=100, help='of each kind')
    parser.add_argument('--kinds', nargs='+', choices=KINDS, default=KINDS, help='what is taken away')
    parser.add_argument('--results', type=Path, help='keep each trial there, and go on where it ends')
    parser.add_argument('--seconds', type=float, default=math.inf, help='end after so long')
    options = parser.parse_args()
    end = time.monotonic() + options.seconds
    found: dict[str, list[Trial]] = {kind: [] for kind in options.kinds}
    if options.results and options.results.exists():
        for line in options.results.read_text().splitlines():
            kind, *values = json.loads(line)
            found.setdefault(kind, []).append(Trial(*values))
    rig = RigParams()
    with stack_of(rig, **shortly_before_a_strike(rig, 0.1)) as stack:
        for kind in options.kinds:
            while len(found[kind]) < options.trials and time.monotonic() < end:
                one = trial(stack, kind, len(found[kind]))
                found[kind].append(one)
                if options.results:
                    with options.results.open('a') as file:
                        file.write(json.dumps([kind, *one]) + '\n')
    print(f'{"taken away":18} {"passed":>10} {"median ms":>10} {"worst ms":>9} {"largest N":>10}')
    for kind in options.kinds:
        if found[kind]:
            print(row(kind, found[kind]))
    return 0


if __name__ == '__main__':
    sys.exit(main())

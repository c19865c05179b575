"""The node `synchronizer` with simulator and estimator over DDS: it pushes, and whatever ends leaves no force on."""

import math
import signal

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64
from std_srvs.srv import Trigger

from dcdrw_msgs_py.topics import COUPLER_FORCE_COMMAND, ENABLE, JOINT_STATES, PHASE_STATE, SYNCHRONIZER_STATE
from dcdrw_sim.map.holding import law, plant
from dcdrw_sim.model.presets import preset
from tests.bench import Bench
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

TRIALS = 10
FOUND = law(plant(preset('paper')))
GAINS = {
    'law': 'hold',
    'hold.state': list(map(float, FOUND.state)),
    'hold.gain': list(map(float, FOUND.gain)),
    'stale_after': 0.08,
}


class Loop:
    """Simulator, estimator and synchronizer, enabled from here."""

    def __init__(self, bench: Bench, **parameters: float) -> None:
        self.bench = bench
        self.joints = bench.hear(JOINT_STATES)
        self.commands = bench.hear(COUPLER_FORCE_COMMAND)
        self.states = bench.hear(SYNCHRONIZER_STATE)
        self.nodes = {
            'synchronizer': bench.start('synchronizer', **(GAINS | parameters)),
            'phase_estimator': bench.start('phase_estimator'),
            'simulator': bench.start('simulator', initial_phase_percent=10.0),
        }
        self.enable = bench.publisher(ENABLE)
        bench.wait(lambda: self.joints and self.commands and self.states, 'joint states, commands and a state')

    @property
    def state(self) -> str:
        return self.states[-1].data if self.states else ''

    def until(self, condition, what: str, enabled: bool = True) -> None:
        def holds():
            self.enable.publish(Bool(data=enabled))
            return condition()

        self.bench.wait(holds, what)

    def push(self) -> None:
        """Let it push; on a busy machine a stall may be a fault, which is taken back."""

        def pushes():
            if self.state == 'fault':
                self.enable.publish(Bool(data=False))
                self.bench.call(Trigger, '/synchronizer/reset_fault', Trigger.Request())
            return self.state == 'active' and abs(self.force) > 1.0

        self.until(pushes, 'a force')

    def let_go(self, how, what: str) -> None:
        """Let it push, end that in some way, and wait until it is disabled without a force.

        Where the machine let the input stall before the end, that is a fault first: then it is tried again.
        """
        for _ in range(TRIALS):
            self.push()
            how()
            self.bench.wait(lambda: self.force == 0.0 and self.state in ('disabled', 'fault'), what)
            if self.state == 'disabled':
                return
            self.bench.wait(lambda: self.bench.output('synchronizer').rstrip().endswith('fault: stale'), 'the reason')
        pytest.fail(f'the input stalled in each of {TRIALS} trials')

    @property
    def force(self) -> float:
        """What acts on the simulated pair beside spring and damper."""
        return self.commands[-1].data


def external_force(joints: JointState) -> float:
    """F less spring and damper, as the simulator tells it."""
    place = joints.name.index('coupler')
    rig = preset('paper').resolved()
    return joints.effort[place] - rig.k * (joints.position[place] - rig.D0) - rig.b * joints.velocity[place]


def test_it_is_disabled_until_enabled_and_then_brings_the_pair_towards_step(bench):
    loop = Loop(bench)
    assert loop.state == 'disabled'
    assert {message.data for message in loop.commands} == {0.0}

    def stop():
        assert bench.call(Trigger, '/synchronizer/stop', Trigger.Request()).success

    loop.let_go(stop, 'the end of the ramp')
    assert all(abs(message.data) <= 20.0 for message in loop.commands)


@pytest.mark.parametrize('victim', ['simulator', 'phase_estimator', 'synchronizer'])
def test_whoever_is_killed_leaves_no_force_on(bench, victim):
    loop = Loop(bench)
    loop.push()
    loop.nodes[victim].send_signal(signal.SIGKILL)
    loop.nodes[victim].wait()
    if victim == 'synchronizer':
        loop.until(lambda: abs(external_force(loop.joints[-1])) < 1e-6, 'the simulator to drop the stale command')
    else:
        loop.until(lambda: loop.force == 0.0 and loop.state == 'fault', 'a fault')
    assert all(abs(message.data) <= 20.0 for message in loop.commands)


def test_a_heartbeat_that_ends_and_a_value_that_is_no_number_end_the_force(bench):
    loop, intruder = Loop(bench), bench.publisher(PHASE_STATE)
    loop.let_go(lambda: None, 'the end without a heartbeat')
    loop.push()

    def ends():
        intruder.publish(JointState(name=['front_stance'], position=[math.nan]))
        return loop.force == 0.0 and loop.state == 'fault'

    loop.until(ends, 'the fault')


def test_a_second_publisher_of_the_command_is_a_fault(bench):
    loop = Loop(bench)
    loop.push()
    other = bench.publisher(COUPLER_FORCE_COMMAND)
    other.publish(Float64(data=0.0))
    loop.until(lambda: loop.state == 'fault' and loop.force == 0.0, 'the fault')
    bench.wait(lambda: 'second publisher' in bench.output('synchronizer'), 'the reason')


def test_an_orderly_end_leaves_zero_and_disabled(bench):
    loop = Loop(bench)
    loop.push()
    bench.end(loop.nodes['synchronizer'])
    bench.wait(lambda: loop.state == 'disabled' and loop.force == 0.0, 'the last words')


def test_gains_that_nobody_computed_are_refused(bench):
    process = bench.start('synchronizer', law='hold')
    assert process.wait(PATIENCE) == 2
    assert 'dcdrw control' in bench.output('synchronizer')

"""The node `simulator` over DDS. The model's truths are in tests/sim."""

import itertools
import math
import signal

import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

from dcdrw_msgs_py.messages import SECOND, JointSampleReader, diagnoses, stamp_ns, to_stamp
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.topics import (
    CLOCK,
    COUPLER_FORCE_COMMAND,
    DIAGNOSTICS,
    JOINT_STATES,
    PERSON_FORCE,
    REAR_TORQUE_COMMAND,
)
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.rig.simulator import SimulatorParams
from tests.bench import Bench
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

STEP_NS = 10_000_000  # at 100 Hz


def samples(messages):
    read = JointSampleReader()
    return [read.read(message) for message in messages]


def set_parameter(bench: Bench, name: str, value: float | int):
    kind = ParameterType.PARAMETER_INTEGER if isinstance(value, int) else ParameterType.PARAMETER_DOUBLE
    field = 'integer_value' if isinstance(value, int) else 'double_value'
    request = SetParameters.Request(
        parameters=[Parameter(name=name, value=ParameterValue(**{'type': kind, field: value}))]
    )
    return bench.call(SetParameters, '/simulator/set_parameters', request).results[0]


def start_held(bench: Bench, **parameters):
    """Start paused and let go once this process hears it, so that nothing of the motion is missed."""
    process = bench.start('simulator', paused=True, rate=100, **parameters)
    heard = bench.hear(JOINT_STATES)
    bench.wait(lambda: heard, 'joint states')
    assert bench.call(SetBool, '/simulator/pause', SetBool.Request(data=False)).success
    return process, heard


def moving(messages):
    """From the last held sample on."""
    read = samples(messages)
    first = next((i for i, sample in enumerate(read) if sample.front.rate), len(read))
    return read[max(first - 1, 0) :]


def test_joint_states_are_the_model_sampled_at_the_rate(bench):
    _, heard = start_held(bench)
    bench.wait(lambda: len(moving(heard)) > 250, 'two and a half seconds of motion')
    got = moving(heard)
    assert {b.stamp_ns - a.stamp_ns for a, b in itertools.pairwise(got)} == {STEP_NS}
    model = run(*SimulatorParams().start(RigParams()), seconds=10.0)
    # The last held sample is one period before the first that moves, which stands at time 0.
    times = np.arange(len(got) - 1) * 0.01
    expected = model.at(times)
    for i, column in enumerate((expected.rotation1, expected.rotation2)):
        np.testing.assert_allclose([sample[1 + i].angle for sample in got[1:]], column, atol=1e-9)
    np.testing.assert_allclose([sample.coupler.force for sample in got[1:]], expected.coupler_force, atol=1e-6)
    np.testing.assert_allclose([sample.coupler.length for sample in got[1:]], expected.coupler_length, atol=1e-9)


def test_late_ticks_lose_nothing(bench):
    process, heard = start_held(bench)
    bench.wait(lambda: len(moving(heard)) > 20, 'motion')
    process.send_signal(19)  # SIGSTOP: the node misses half a second
    bench.spin(0.5)
    process.send_signal(18)  # SIGCONT
    count = len(heard)
    bench.wait(lambda: len(heard) > count + 80, 'the samples of the missed time and after')
    got = moving(heard)
    assert {b.stamp_ns - a.stamp_ns for a, b in itertools.pairwise(got)} == {STEP_NS}


def test_pause_holds_the_wheels_and_reset_puts_them_back(bench):
    _, heard = start_held(bench)
    bench.wait(lambda: len(moving(heard)) > 50, 'motion')
    assert bench.call(SetBool, '/simulator/pause', SetBool.Request(data=True)).success
    count = len(heard)
    bench.wait(lambda: len(heard) > count + 20, 'held samples')
    held = samples(heard)[-10:]
    assert {sample.front for sample in held} == {held[0].front}
    assert held[0].front.rate == 0.0
    assert bench.call(Trigger, '/simulator/reset', Trigger.Request()).success
    count = len(heard)
    bench.wait(lambda: len(heard) > count + 20, 'samples after the reset')
    assert samples(heard)[-1].front.angle == pytest.approx(-math.pi / 12)


def test_coupler_and_slope_change_while_it_runs_and_nonsense_is_refused(bench):
    _, heard = start_held(bench)
    assert set_parameter(bench, 'b', 0).successful  # an integer does for a double
    assert set_parameter(bench, 'k', 0.0).successful
    count = len(heard)
    bench.wait(lambda: len(heard) > count + 20, 'samples without a coupler')
    assert samples(heard)[-1].coupler.force == 0.0
    refused = set_parameter(bench, 'k', -5.0)
    assert not refused.successful
    assert 'k out of range' in refused.reason
    assert not set_parameter(bench, 'k', 1e308).successful
    assert not set_parameter(bench, 'real_time_factor', 2.0).successful  # without /clock
    refused = set_parameter(bench, 'front.mass', 3.0)
    assert not refused.successful
    assert 'front.mass is fixed while the node runs' in refused.reason
    for name, value in (('front.mass', 10.0), ('theta1', math.nan), ('seed', 0)):  # a dump of its own
        assert set_parameter(bench, name, value).successful
    assert set_parameter(bench, 'rate', 200.0).successful
    count = len(heard)
    bench.wait(lambda: len(heard) > count + 20, 'samples at the new rate')
    last = samples(heard)[-2:]
    assert last[1].stamp_ns - last[0].stamp_ns == STEP_NS // 2


def test_gyration_restitution_and_friction_change_while_it_runs(bench):
    _, heard = start_held(bench)
    bench.wait(lambda: len(moving(heard)) > 20, 'motion')
    for name, value in (
        ('front.gyration', 0.5),
        ('rear.restitution', 0.1),
        ('coupler_friction', 400.0),
        ('rolling_resistance', 0.004),
        ('friction_speed', 0.1),
        ('k', 0.0),
        ('b', 0.0),
    ):
        assert set_parameter(bench, name, value).successful
    count = len(heard)
    bench.wait(lambda: len(heard) > count + 20, 'samples with friction alone')
    coupler = samples(heard)[-1].coupler
    assert coupler.force == pytest.approx(400.0 * math.tanh(coupler.rate / 0.1), rel=1e-6)
    assert not set_parameter(bench, 'rear.restitution', 1.0).successful


def test_command_adds_to_the_coupler_force_until_it_is_stale(bench):
    _, heard = start_held(bench, k=0, b=0, command_timeout=0.3)
    publisher = bench.publisher(COUPLER_FORCE_COMMAND)

    def pushed():
        publisher.publish(Float64(data=2.5))
        bench.spin(0.02)
        return samples(heard)[-1].coupler.force == 2.5

    bench.wait(pushed, 'the commanded force')
    publisher.publish(Float64(data=math.nan))  # refused; the last good one holds until it is stale
    bench.wait(lambda: samples(heard)[-1].coupler.force == 0.0, 'the end of the stale command')
    assert 'external_force must be finite' in bench.output('simulator')


def test_a_torque_drives_the_rear_hub_until_it_is_stale(bench):
    alpha = RigParams().front.alpha
    standing = {'theta1': -alpha, 'omega1': 0.0, 'theta2': -alpha, 'omega2': 0.0}
    bench.start('simulator', rate=100, slope=0, k=0, b=0, command_timeout=0.3, **standing)
    publisher, heard, said = bench.publisher(REAR_TORQUE_COMMAND), bench.hear(JOINT_STATES), bench.hear(DIAGNOSTICS)

    def rolls():
        publisher.publish(Float64(data=40.0))
        bench.spin(0.02)
        return heard and samples(heard)[-1].rear.rate > 0.5

    bench.wait(rolls, 'the rear wheel to roll')
    assert samples(heard)[-1].front.rate == 0.0
    said.clear()
    bench.wait(
        lambda: any(one.number('rear torque [N·m]') == 0.0 for message in said for one in diagnoses(message).values()),
        'the end of the stale torque',
    )


def test_the_force_on_the_person_is_the_coupler_s_with_the_other_sign(bench):
    bench.start('simulator', rate=100, **{'person.walks': True})
    forces, heard = bench.hear(PERSON_FORCE), bench.hear(JOINT_STATES)
    bench.wait(lambda: len(forces) > 100, 'a second of forces')
    coupler = {sample.stamp_ns: sample.coupler.force for sample in samples(heard)}
    of_both = [
        (coupler[stamp], one.wrench.force.x) for one in forces if (stamp := stamp_ns(one.header.stamp)) in coupler
    ]
    assert len(of_both) > 50
    assert all(force == -on_person for force, on_person in of_both)


def test_clock_runs_with_the_samples_and_starts_again_at_a_reset(bench):
    bench.start('simulator', publish_clock=True, rate=100, real_time_factor=2)
    clocks, heard = bench.hear(CLOCK), bench.hear(JOINT_STATES)
    bench.wait(lambda: len(heard) > 100 and len(clocks) > 100, 'a simulated second')
    assert stamp_ns(clocks[-1].clock) < 60 * SECOND  # simulated, not wall time
    before = stamp_ns(heard[-1].header.stamp)
    assert bench.call(Trigger, '/simulator/reset', Trigger.Request()).success
    bench.wait(lambda: stamp_ns(heard[-1].header.stamp) < before, 'stamps that start again')


def test_noise_and_losses_are_as_asked(bench):
    _, heard = start_held(bench, noise_deg=0.5, drop_percent=30)
    bench.wait(lambda: len(moving(heard)) > 400, 'motion')
    got = moving(heard)[1:]
    start = got[0].stamp_ns - STEP_NS * round((got[0].front.angle + math.pi / 12) / 1.05 / 0.01)
    span = (got[-1].stamp_ns - got[0].stamp_ns) / STEP_NS + 1
    assert 0.6 < len(got) / span < 0.8
    model = run(*SimulatorParams().start(RigParams()), seconds=30.0)
    # Where the first sample stands is known only up to lost ones: the place that fits best.
    residuals = []
    for shift in range(-10, 11):
        times = np.array([(sample.stamp_ns - start + shift * STEP_NS) / SECOND for sample in got])
        inside = (times >= 0) & (times < model.duration)
        errors = np.array([sample.front.angle for sample in got])[inside] - model.at(times[inside]).rotation1
        residuals.append(np.degrees(errors.std()))
    assert 0.4 < min(residuals) < 0.6


def test_as_fast_as_possible_outruns_the_clock(bench):
    bench.start('simulator', rate=50, real_time_factor=0, publish_clock=True)
    heard = bench.hear(JOINT_STATES)
    bench.wait(lambda: heard and stamp_ns(heard[-1].header.stamp) > 100 * SECOND, 'a hundred simulated seconds')


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        ({'front__spokes': 3}, 'front.spokes must be ≥ 4, ≤ 1000, got 3'),
        ({'k': '.nan'}, 'k must be ≥ 0, ≤ 1e+06 N/m, got nan'),
        ({'slope': 0.001}, 'too gentle'),
        ({'rate': 'fast'}, 'rate must be a number'),
    ],
)
def test_impossible_parameters_end_it_with_one_line(bench, parameters, message):
    process = bench.start('simulator', **parameters)
    assert process.wait(PATIENCE) == 2
    assert message in bench.output('simulator')
    assert 'Traceback' not in bench.output('simulator')


def test_it_follows_a_clock_that_begins_anywhere_jumps_and_goes_back(bench):
    """The motion goes on at its own pace, and the stamps are the clock's."""
    clock, heard = bench.publisher(CLOCK, readers=0), bench.hear(JOINT_STATES)
    process = bench.start('simulator', use_sim_time=True, rate=100)
    bench.wait(clock.get_subscription_count, 'the simulator')
    rotations = []
    for start in (1.8e9, 10_000.0, -5.0, 20_000.0, 0.0):
        for tick in range(100):
            clock.publish(Clock(clock=to_stamp(round((start + 0.01 * tick) * SECOND))))
            bench.spin(0.01)
        if start >= 0.0:
            last = samples(heard)[-1]
            assert start <= last.stamp_ns / SECOND <= start + 1.0
            rotations.append(last.front.angle)
    assert process.poll() is None
    assert all(0.0 < later - earlier < 2.0 for earlier, later in itertools.pairwise(rotations))


def test_it_goes_on_when_use_sim_time_is_switched(bench):
    process, heard = start_held(bench)
    for value in (True, False):
        request = SetParameters.Request(
            parameters=[
                Parameter(
                    name='use_sim_time', value=ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=value)
                )
            ]
        )
        assert bench.call(SetParameters, '/simulator/set_parameters', request).results[0].successful
    count = len(heard)
    bench.wait(lambda: len(heard) > count + 20, 'samples by the system clock again')
    assert process.poll() is None


def test_after_a_pause_of_its_process_every_sample_comes(bench):
    process, heard = start_held(bench)
    process.send_signal(signal.SIGSTOP)
    bench.spin(2.0)
    process.send_signal(signal.SIGCONT)
    count = len(heard)
    bench.wait(lambda: len(heard) > count + 300, 'what was missed, and more')
    assert {b.stamp_ns - a.stamp_ns for a, b in itertools.pairwise(samples(heard))} == {STEP_NS}

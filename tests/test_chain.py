"""The whole chain in three processes."""

import math
import signal
from functools import partial
from itertools import pairwise

import pytest
from std_srvs.srv import SetBool

from dcdrw_msgs_py.diagnosis import SOURCES, Level, PairState, SourceState
from dcdrw_msgs_py.messages import JointSampleWriter, PhaseSampleReader, diagnoses, footfall
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.samples import JointSample, Turn
from dcdrw_msgs_py.topics import (
    DIAGNOSTICS,
    FOOTFALLS,
    JOINT_STATES,
    PHASE_STATE,
    SYNC_ERROR_PERCENT,
    SYNC_STATE,
    SYNCHRONIZED,
)
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.rig.simulator import SimulatorParams
from tests.bench import Bench
from tests.patience import PATIENCE
from tests.tracker.walking import START_NS, walk

pytestmark = pytest.mark.processes

# With a stiffer spring than the paper's the pair is in step within seconds.
STIFF = {'k': 60.0, 'initial_phase_percent': 35.0, 'rate': 200.0}


def start_chain(bench: Bench):
    for name in ('sync_monitor', 'phase_estimator'):
        bench.start(name)
    return bench.start('simulator', paused=True, **STIFF)


def state_of(diagnostics, name: str, kind):
    """What a node said last that it, or the pair, does."""
    said = [diagnosis for message in diagnostics if (diagnosis := diagnoses(message).get(name))]
    return said[-1].state(kind) if said else None


def let_go(bench: Bench) -> None:
    assert bench.call(SetBool, '/simulator/pause', SetBool.Request(data=False)).success


def test_estimate_is_the_truth_of_the_simulation(bench):
    phases, errors, states = bench.hear(PHASE_STATE), bench.hear(SYNC_ERROR_PERCENT), bench.hear(SYNC_STATE)
    heard = {wheel: bench.hear(topic) for wheel, topic in FOOTFALLS.items()}
    start_chain(bench)
    bench.wait(
        lambda: errors and phases and all(bench.node.count_publishers(topic.name) for topic in FOOTFALLS.values()),
        'the whole chain',
    )
    let_go(bench)
    bench.wait(lambda: sum(map(len, heard.values())) >= 16, 'sixteen strikes')
    settings = SimulatorParams(initial_phase_percent=STIFF['initial_phase_percent'])
    start_rig, start_state = settings.start(RigParams(k=STIFF['k']))
    model = run(start_rig, start_state, strikes=16)
    read = PhaseSampleReader()
    moving = [sample for sample in map(read.read, phases) if sample.front.rate]
    start = moving[0].stamp_ns
    # The footfalls are the strikes of the model: in order, interpolated between samples 5 ms apart.
    for number, wheel in enumerate(('front', 'rear'), 1):
        strikes = [strike for strike in model.strikes if strike.wheel == number]
        first_foot = start_rig.S0 if wheel == 'front' else 0.0
        for steps, (message, strike) in enumerate(zip(heard[wheel], strikes, strict=False), 1):
            fall = footfall(message, wheel)
            assert abs((fall.stamp_ns - start) / 1e9 - strike.t) < 2e-4
            assert abs(fall.x - first_foot - steps * RigParams().front.step_length) < 1e-9
    turned = {message.header.stamp.sec * 10**9 + message.header.stamp.nanosec: message for message in states}
    for sample in moving[:400]:
        t = (sample.stamp_ns - start) / 1e9
        if t > model.duration:
            break
        truth = model.at([t])
        phase = (truth.rotation1[0] - truth.rotation2[0]) / (2 * RigParams().front.alpha) % 1.0
        assert abs(sample.phi.angle / (2 * RigParams().front.alpha) - phase) < 1e-8
        if stamped := turned.get(sample.stamp_ns):
            assert dict(zip(stamped.name, stamped.position, strict=True))['phase'] == pytest.approx(phase, abs=1e-8)
        assert (
            sample.step_difference == truth.steps1[0] - truth.steps2[0]
            or min(abs(t - s.t) for s in model.strikes) < 1e-6
        )


def test_killed_simulator_is_stale_and_a_new_one_is_judged_afresh(bench):
    verdicts, diagnostics = bench.hear(SYNCHRONIZED), bench.hear(DIAGNOSTICS)
    errors = bench.hear(SYNC_ERROR_PERCENT)
    pair = partial(state_of, diagnostics, 'sync_monitor', PairState)
    simulator = start_chain(bench)
    bench.wait(lambda: errors, 'an error at the end of the chain')
    let_go(bench)
    bench.wait(lambda: verdicts and verdicts[-1].data, 'synchronized')
    bench.wait(lambda: pair() is PairState.SYNCHRONIZED, 'a diagnosis that says so')

    simulator.send_signal(signal.SIGKILL)
    simulator.wait(PATIENCE)
    bench.wait(lambda: not verdicts[-1].data, 'the end of the verdict')
    bench.wait(lambda: pair() is PairState.NO_DATA, 'no data')

    count = len(errors)
    bench.start('simulator', k=60.0, initial_phase_percent=20.0, rate=200.0)
    bench.wait(lambda: len(errors) > count + 100, 'errors of the new run')
    bench.wait(lambda: pair() is PairState.CONVERGING, 'a monitor that has recovered')
    claimed = []

    def again():
        if verdicts[-1].data:
            claimed.append(errors[-1].data)
        return claimed

    bench.wait(again, 'synchronized again')
    assert abs(claimed[0]) < 8.0  # never claimed while the error, which starts at −30 %, is outside the band


def test_two_sources_are_named_by_estimator_and_monitor(bench):
    diagnostics = bench.hear(DIAGNOSTICS)
    start_chain(bench)
    bench.start('simulator', '-r', '__node:=another', **STIFF)

    def warned(name: str) -> bool:
        said = [diagnosis for message in diagnostics if (diagnosis := diagnoses(message).get(name))]
        return bool(said) and said[-1].level >= Level.WARN and said[-1].values[SOURCES] == '/another, /simulator'

    for name in ('phase_estimator', 'sync_monitor'):
        bench.wait(partial(warned, name), f'a warning of {name} that names both')


def test_a_monitor_warns_of_encoders_too_coarse_for_its_band(bench):
    diagnostics = bench.hear(DIAGNOSTICS)
    for name in ('sync_monitor', 'phase_estimator'):
        bench.start(name)
    publisher, writer, count = bench.publisher(JOINT_STATES), JointSampleWriter(), math.tau / 64
    walked = iter(walk(40.0, 100.0).samples())
    start_ns = bench.node.get_clock().now().nanoseconds

    def warned() -> bool:
        sample = next(walked)
        turns = [Turn(count * math.floor(turn.angle / count)) for turn in sample[1:3]]
        publisher.publish(writer.write(JointSample(start_ns + sample.stamp_ns - START_NS, *turns)))
        said = [diagnosis for message in diagnostics if (diagnosis := diagnoses(message).get('sync_monitor'))]
        return any(each.level == Level.WARN and 'too coarse for the band' in each.message for each in said)

    bench.wait(warned, 'a warning of the monitor')


def test_wheels_are_held_before_they_are_let_go_and_while_they_are_paused_but_never_stalled(bench):
    diagnostics = bench.hear(DIAGNOSTICS)
    pair = partial(state_of, diagnostics, 'sync_monitor', PairState)
    rig = partial(state_of, diagnostics, 'simulator', SourceState)
    for name in ('sync_monitor', 'phase_estimator'):
        bench.start(name, **({'stall_after': 2.0} if name == 'sync_monitor' else {}))
    bench.start('simulator', paused=True, **STIFF)
    bench.wait(lambda: pair() is PairState.HELD, 'wheels that are held')
    bench.wait(lambda: rig() is SourceState.PAUSED, 'a simulator that says so')
    let_go(bench)
    bench.wait(lambda: pair() is PairState.SYNCHRONIZED, 'synchronized')
    bench.wait(lambda: rig() is SourceState.RUNNING, 'a simulator that says so')
    assert bench.call(SetBool, '/simulator/pause', SetBool.Request(data=True)).success
    bench.wait(lambda: pair() is PairState.HELD, 'wheels that are held again')
    seconds = len(diagnostics)
    bench.wait(lambda: len(diagnostics) > seconds + 9, 'three seconds of three nodes')
    let_go(bench)
    bench.wait(lambda: pair() is PairState.SYNCHRONIZED, 'synchronized, as before the pause')
    said = [diagnosis for message in diagnostics if (diagnosis := diagnoses(message).get('sync_monitor'))]
    assert PairState.STALLED not in [diagnosis.state(PairState) for diagnosis in said]


def test_chain_follows_simulated_time_at_another_pace(bench):
    phases, verdicts = bench.hear(PHASE_STATE), bench.hear(SYNCHRONIZED)
    for name in ('sync_monitor', 'phase_estimator'):
        bench.start(name, use_sim_time=True)
    bench.wait(lambda: bench.node.count_subscribers('phase_state') >= 2, 'the monitor')
    bench.start('simulator', publish_clock=True, real_time_factor=4, **STIFF)
    bench.wait(lambda: verdicts and verdicts[-1].data and len(phases) > 100, 'synchronized')
    read = PhaseSampleReader()
    stamps = [read.read(phase).stamp_ns for phase in phases]
    assert stamps[-1] < 10**12  # simulated time, which began at 0 with the simulator
    assert {b - a for a, b in pairwise(stamps)} == {5_000_000}

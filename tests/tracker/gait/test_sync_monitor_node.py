"""The node `sync_monitor` over DDS. The core's truths are in tests/tracker/test_sync.py."""

import math

import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool

from dcdrw_msgs_py.messages import PhaseSampleWriter
from dcdrw_msgs_py.samples import PhaseSample, Turn
from dcdrw_msgs_py.topics import DIAGNOSTICS, PHASE_STATE, SYNC_ERROR, SYNC_ERROR_PERCENT, SYNCHRONIZED
from tests.bench import Bench

pytestmark = pytest.mark.processes

ALPHA = math.pi / 12
SPEED = 1.0
RATE = 100


def phase_message(bench: Bench, k: int, phase: float):
    """Both wheels turn at SPEED, a phase apart that never changes."""
    start = (-ALPHA, -ALPHA - phase * 2 * ALPHA)
    cells = [math.floor((psi + SPEED * k / RATE + ALPHA) / (2 * ALPHA)) for psi in start]
    turns = [Turn(psi + SPEED * k / RATE - cell * 2 * ALPHA, SPEED) for psi, cell in zip(start, cells, strict=True)]
    stamp = bench.start_ns + k * 1_000_000_000 // RATE
    return PhaseSampleWriter().write(
        PhaseSample(stamp, turns[0], turns[1], Turn(phase * 2 * ALPHA, 0.0), cells[0] - cells[1] - 1)
    )


def drive(bench: Bench, phase: float, count: int) -> None:
    bench.start_ns = bench.node.get_clock().now().nanoseconds
    errors = bench.hear(SYNC_ERROR)
    publisher = bench.publisher(PHASE_STATE)

    def at_rest(now: int):
        bench.start_ns = now
        return phase_message(bench, 0, phase)

    bench.wake(publisher, at_rest, errors)
    for k in range(1, count):
        publisher.publish(phase_message(bench, k, phase))
        bench.spin(0.001)
    bench.wait(lambda: len(errors) >= count - 1, 'an error for each phase')


def level_of(message) -> int:
    return message.status[0].level[0]


def test_error_is_the_phase_less_a_half_in_rad_and_percent(bench):
    bench.start('sync_monitor')
    percents, errors = bench.hear(SYNC_ERROR_PERCENT), bench.hear(SYNC_ERROR)
    drive(bench, 0.41, 20)
    assert math.isclose(errors[-1].data, -0.09 * 2 * ALPHA, abs_tol=1e-9)
    bench.wait(lambda: percents, 'the error in percent')
    assert math.isclose(percents[-1].data, -9.0, abs_tol=1e-9)


def test_verdict_is_latched_and_goes_stale_with_the_input(bench):
    bench.start('sync_monitor', stale_after=0.5)
    verdicts, diagnostics = bench.hear(SYNCHRONIZED), bench.hear(DIAGNOSTICS)
    drive(bench, 0.48, 4 * 52)
    bench.wait(lambda: verdicts and verdicts[-1].data, 'synchronized')
    late = bench.hear(SYNCHRONIZED)
    bench.wait(lambda: late, 'the latched verdict for one who came late')
    bench.wait(lambda: not verdicts[-1].data, 'the end of synchronized when nothing comes any more')
    bench.wait(lambda: diagnostics and level_of(diagnostics[-1]) == 3, 'STALE')
    assert 'no sample for' in diagnostics[-1].status[0].message


def test_diagnosis_has_the_figures_of_the_contract(bench):
    bench.start('sync_monitor')
    diagnostics = bench.hear(DIAGNOSTICS)
    drive(bench, 0.48, 3 * 52)
    bench.wait(lambda: len(diagnostics) >= 2, 'diagnostics')
    keys = {pair.key for pair in diagnostics[-1].status[0].values}
    assert keys >= {
        'state',
        'phase [%]',
        'error [%]',
        'n',
        'steps to synchronization',
        'rate in [Hz]',
        'gaps',
        'age of the last sample [s]',
        'per-step convergence ratio',
    }


def test_band_changes_while_it_runs_and_nonsense_is_refused(bench):
    bench.start('sync_monitor')

    def set_to(name: str, value: float):
        parameter = Parameter(name=name, value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value))
        return bench.call(
            SetParameters, '/sync_monitor/set_parameters', SetParameters.Request(parameters=[parameter])
        ).results[0]

    refused = set_to('band_percent', -1.0)
    assert not refused.successful
    assert 'band_percent out of range' in refused.reason
    assert not set_to('front.spokes', 10.0).successful  # geometry is fixed while it runs
    assert set_to('band_percent', 12.0).successful
    verdicts = bench.hear(SYNCHRONIZED)
    drive(bench, 0.40, 4 * 52)  # outside the default band, inside the new one
    bench.wait(lambda: verdicts and verdicts[-1].data, 'synchronized by the wider band')


def test_who_asks_for_liveliness_learns_that_a_monitor_was_killed_whose_verdict_is_still_true(bench):
    """The rule of docs/xrl.md: a lease of 2 s."""
    process = bench.start('sync_monitor')
    alive, verdicts = [], []
    qos = QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        liveliness_lease_duration=Duration(seconds=2.0),
    )
    events = SubscriptionEventCallbacks(liveliness=lambda event: alive.append(event.alive_count))
    bench.node.create_subscription(Bool, SYNCHRONIZED.name, verdicts.append, qos, event_callbacks=events)
    drive(bench, 0.48, 4 * 52)
    bench.wait(lambda: verdicts and verdicts[-1].data, 'synchronized')
    bench.wait(lambda: alive and alive[-1] == 1, 'the word that it lives')
    process.kill()
    bench.wait(lambda: alive[-1] == 0, 'the word that it does not')
    assert verdicts[-1].data

import math

import pytest

from dcdrw_msgs_py.diagnosis import Level
from dcdrw_tracker.gait.cadence import CadenceStatus
from dcdrw_tracker.gait.diagnostics import diagnose_phase, diagnose_sync, phase_text
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams
from dcdrw_tracker.gait.sync import SyncStatus

STATUS = SyncStatus(
    stamp_ns=1,
    phase=0.48,
    error=math.radians(-0.6),
    error_percent=-2.0,
    initial_phase=0.216,
    steps=12,
    swing_percent=(-3.0, 2.5),
    contraction=0.9,
    cadence=CadenceStatus(200.0, 2, 3, 0.02),
)
NEVER = math.inf


@pytest.mark.parametrize(
    ('status', 'age', 'level', 'message'),
    [
        (SyncStatus(), NEVER, Level.STALE, 'no data yet'),
        (SyncStatus(), math.nan, Level.STALE, 'no data yet'),
        (STATUS._replace(synchronized=True), 2.5, Level.STALE, 'stale: no sample for 2.5 s'),
        (SyncStatus(), 2.5, Level.STALE, 'stale: no sample for 2.5 s'),
        (SyncStatus(), 0.1, Level.OK, 'starting afresh'),
        (STATUS._replace(stalled=('rear',)), 0.0, Level.ERROR, 'stalled: the rear wheel'),
        (STATUS._replace(stalled=('front', 'rear')), 0.0, Level.ERROR, 'stalled: the front and the rear wheel'),
        (STATUS._replace(slipped=True, step_difference=2), 0.0, Level.WARN, 'slipped a step: n = 2'),
        (STATUS._replace(lost=True), 0.0, Level.WARN, 'lost synchronization: error -2.0 %'),
        (STATUS._replace(synchronized=True, steps_to_synchronization=7), 0.0, Level.OK, 'synchronized after 7 steps'),
        (STATUS, 0.0, Level.OK, 'converging: error -2.0 %'),
    ],
)
def test_each_state_has_its_own_level_and_message(status: SyncStatus, age: float, level: Level, message: str) -> None:
    diagnosis = diagnose_sync(status, age, 1.0)
    assert diagnosis.level == level
    assert diagnosis.message.startswith(message)


def test_the_keys_of_the_contract_are_there() -> None:
    values = diagnose_sync(STATUS, 0.01, 1.0).values
    assert {
        key: values[key]
        for key in (
            'phase',
            'error',
            'n',
            'steps to synchronization',
            'rate in',
            'gaps',
            'age of the last sample',
            'per-step convergence ratio',
        )
    } == {
        'phase': '48.0 % of a step, 24.0 % of a stride',
        'error': '-2.0 % (-0.60°)',
        'n': '0',
        'steps to synchronization': 'unknown',
        'rate in': '200.0 Hz',
        'gaps': '2 (3 samples lost, longest 0.020 s)',
        'age of the last sample': '0.010 s',
        'per-step convergence ratio': '0.900',
    }


def test_nothing_known_reads_as_unknown() -> None:
    values = diagnose_sync(SyncStatus(), NEVER, 1.0).values
    assert all('nan' not in value and 'inf' not in value for value in values.values())


def test_keys_stay_and_keep_their_order() -> None:
    estimator = PhaseEstimator(PhaseParams()).status()
    later = estimator._replace(accepted=9, front_steps=3, refusal='outlier', n_uncertain=True)
    assert list(diagnose_sync(SyncStatus(), NEVER, 1.0).values) == list(diagnose_sync(STATUS, 0.1, 1.0).values)
    assert list(diagnose_phase(estimator, NEVER, 1.0).values) == list(diagnose_phase(later, 0.1, 1.0).values)


def test_half_a_step_is_a_quarter_of_a_stride() -> None:
    assert phase_text(0.5) == '50.0 % of a step, 25.0 % of a stride'


def test_the_estimator_says_that_n_may_be_off() -> None:
    cadence = CadenceStatus(200.0, 1, 199, 1.0)
    status = PhaseEstimator(PhaseParams()).status()._replace(accepted=9, n_uncertain=True, cadence=cadence)
    diagnosis = diagnose_phase(status, 0.0, 1.0)
    assert diagnosis.level == Level.WARN
    assert diagnosis.message == 'n may be off: a gap of up to 1.00 s may hide a step'
    assert diagnosis.values['n is certain'] == 'false'


def test_the_estimator_says_why_it_refuses_every_sample() -> None:
    estimator = PhaseEstimator(PhaseParams())
    assert diagnose_phase(estimator.status(), NEVER, 1.0).message == 'no data yet'
    estimator.refuse('unreadable')
    diagnosis = diagnose_phase(estimator.status(), NEVER, 1.0)
    assert diagnosis.level == Level.STALE
    assert 'front_joint' in diagnosis.message
    assert diagnosis.values['samples refused: unreadable'] == '1'
    tracking = estimator.status()._replace(accepted=3, refusal=None)
    assert diagnose_phase(tracking, 0.1, 1.0).level == Level.OK
    assert diagnose_phase(tracking, 4.0, 1.0).message == 'stale: no sample for 4.0 s'

import math

import pytest

from dcdrw_msgs_py.diagnosis import SOURCES, STATE, Diagnosis, Level, PairState, contested, value_text
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
    samples_in_step=100.0,
    cadence=CadenceStatus(200.0, 2, 3, 0.02),
)
NEVER = math.inf


@pytest.mark.parametrize(
    ('status', 'age', 'level', 'state'),
    [
        (SyncStatus(), NEVER, Level.STALE, PairState.NO_DATA),
        (SyncStatus(), math.nan, Level.STALE, PairState.NO_DATA),
        (STATUS._replace(synchronized=True), 2.5, Level.STALE, PairState.NO_DATA),
        (SyncStatus(), 2.5, Level.STALE, PairState.NO_DATA),
        (STATUS._replace(held=True), 0.0, Level.OK, PairState.HELD),
        (STATUS._replace(stalled=('rear',)), 0.0, Level.ERROR, PairState.STALLED),
        (STATUS._replace(slipped=True, step_difference=2), 0.0, Level.WARN, PairState.SLIPPED),
        (STATUS._replace(lost=True), 0.0, Level.WARN, PairState.LOST),
        (STATUS._replace(synchronized=True, steps_to_synchronization=7), 0.0, Level.OK, PairState.SYNCHRONIZED),
        (STATUS, 0.0, Level.OK, PairState.CONVERGING),
        (STATUS._replace(too_coarse=True), 0.0, Level.WARN, PairState.CONVERGING),
        (STATUS._replace(samples_in_step=3.0), 0.0, Level.WARN, PairState.CONVERGING),
        (STATUS._replace(too_coarse=True), 2.5, Level.STALE, PairState.NO_DATA),
    ],
)
def test_each_state_has_its_own_level_and_message(
    status: SyncStatus, age: float, level: Level, state: PairState
) -> None:
    diagnosis = diagnose_sync(status, age, 1.0)
    assert (diagnosis.level, diagnosis.state(PairState)) == (level, state)
    assert diagnosis.message


def test_a_person_reads_what_is_wrong() -> None:
    for status, age, message in (
        (STATUS._replace(synchronized=True), 2.5, 'stale: no sample for 2.5 s'),
        (STATUS._replace(stalled=('front', 'rear')), 0.0, 'stalled: the front and the rear wheel'),
        (STATUS._replace(slipped=True, step_difference=2), 0.0, 'slipped a step: n = 2'),
        (STATUS._replace(lost=True), 0.0, 'lost synchronization: the error has left the band'),
        (STATUS._replace(synchronized=True, steps_to_synchronization=7), 0.0, 'synchronized after 7 steps'),
        (
            STATUS._replace(too_coarse=True, resolution_percent=37.5),
            0.0,
            'converging: not in step yet; the encoders are too',
        ),
    ):
        assert diagnose_sync(status, age, 1.0).message.startswith(message)


def test_the_keys_of_the_contract_are_there_with_bare_numbers_and_the_unit_in_the_key() -> None:
    diagnosis = diagnose_sync(STATUS, 0.01, 1.0)
    assert {key: value_text(value) for key, value in diagnosis.values.items()} == {
        'state': 'converging',
        'phase [%]': '48',
        'phase of a stride [%]': '24',
        'error [%]': '-2',
        'error [deg]': '-0.6',
        'lowest error within the last step [%]': '-3',
        'highest error within the last step [%]': '2.5',
        'n': '0',
        'steps': '12',
        'steps to synchronization': 'nan',
        'steps to synchronization, at the latest': 'nan',
        'initial phase [%]': '21.6',
        'per-step convergence ratio': '0.9',
        'resolution of the error [%]': '0',
        'samples in a step': '100',
        'lone wild samples': '0',
        'slipped steps': '0',
        'times synchronization was lost': '0',
        'restarts of the source': '0',
        'rate in [Hz]': '200',
        'gaps': '2',
        'samples lost': '3',
        'longest gap [s]': '0.02',
        'age of the last sample [s]': '0.01',
    }


def test_every_figure_reads_as_a_number_whatever_is_known() -> None:
    for status, age in ((SyncStatus(), NEVER), (STATUS, 0.1)):
        diagnosis = diagnose_sync(status, age, 1.0)
        for key in diagnosis.values.keys() - {STATE}:
            float(value_text(diagnosis.values[key]))


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
    assert diagnosis.values['n is certain'] is False


def test_the_estimator_says_why_it_refuses_every_sample() -> None:
    estimator = PhaseEstimator(PhaseParams())
    assert diagnose_phase(estimator.status(), NEVER, 1.0).message == 'no data yet'
    estimator.refuse('unreadable')
    diagnosis = diagnose_phase(estimator.status(), NEVER, 1.0)
    assert diagnosis.level == Level.STALE
    assert 'front_joint' in diagnosis.message
    assert diagnosis.values['samples refused: unreadable'] == 1
    tracking = estimator.status()._replace(accepted=3, refusal=None)
    assert diagnose_phase(tracking, 0.1, 1.0).level == Level.OK
    assert diagnose_phase(tracking, 4.0, 1.0).message == 'stale: no sample for 4.0 s'


def test_several_nodes_in_the_place_of_one_are_a_warning_that_names_them() -> None:
    fine, bad = Diagnosis(Level.OK, 'tracking', {}), Diagnosis(Level.ERROR, 'stalled', {})
    assert contested(fine, 'joint_states', ['/rig']) == Diagnosis(Level.OK, 'tracking', {SOURCES: ''})
    told = contested(fine, 'joint_states', ['/rig', '/simulator'])
    assert (told.level, told.values[SOURCES]) == (Level.WARN, '/rig, /simulator')
    assert told.message == '2 nodes publish joint_states, where one should: /rig, /simulator; tracking'
    assert contested(bad, 'joint_states', ['/rig', '/rig']).level == Level.ERROR

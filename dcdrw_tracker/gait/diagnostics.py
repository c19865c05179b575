"""Diagnoses: what snapshots of the cores mean to a person. Pure functions; `/diagnostics` carries the result."""

import math

from dcdrw_msgs_py.diagnosis import Diagnosis, Level
from dcdrw_tracker.gait.cadence import CadenceStatus
from dcdrw_tracker.gait.phase import PhaseStatus, Refusal
from dcdrw_tracker.gait.sync import SyncStatus


def diagnose_sync(status: SyncStatus, age: float, stale_after: float) -> Diagnosis:
    """The monitor's diagnosis.

    Args:
        status: a snapshot of the monitor.
        age: seconds since the last sample came, by a steady clock; NaN or infinite where none came.
        stale_after: age from which the input is stale [s].

    """
    level, message = _judge_sync(status, age, stale_after)
    low, high = status.swing_percent
    steps = status.steps_to_synchronization
    return Diagnosis(
        level,
        message,
        {
            'phase': phase_text(status.phase),
            'error': f'{_number(status.error_percent, "+.1f", " %")} '
            f'({_number(math.degrees(status.error), "+.2f", "°")})',
            'error within the last step': f'{_number(low, "+.1f")} to {_number(high, "+.1f", " %")}',
            'n': str(status.step_difference),
            'steps': str(status.steps),
            'synchronized': str(status.synchronized).lower(),
            'steps to synchronization': 'unknown' if steps is None else str(steps),
            'initial phase': phase_text(status.initial_phase),
            'per-step convergence ratio': _number(status.contraction, '.3f'),
            'slipped steps': str(status.slips),
            'times synchronization was lost': str(status.losses),
            'restarts of the source': str(status.restarts),
            **_stream(status.cadence, age),
        },
    )


def diagnose_phase(status: PhaseStatus, age: float, stale_after: float) -> Diagnosis:
    """The estimator's diagnosis; arguments as `diagnose_sync`, with the age of the last sample that was accepted."""
    level, message = _judge_phase(status, age, stale_after)
    return Diagnosis(
        level,
        message,
        {
            'steps of the front wheel': str(status.front_steps),
            'steps of the rear wheel': str(status.rear_steps),
            'n': str(status.front_steps - status.rear_steps),
            'n is certain': str(not status.n_uncertain).lower(),
            'samples accepted': str(status.accepted),
            **{f'samples refused: {why}': str(count) for why, count in status.refused.items()},
            'restarts of the source': str(status.restarts),
            **_stream(status.cadence, age),
        },
    )


def phase_text(phase: float) -> str:
    """The phase as people read it: of a step, and of a stride, which is two steps."""
    return f'{_number(100.0 * phase, ".1f", " %")} of a step, {_number(50.0 * phase, ".1f", " %")} of a stride'


def _judge_sync(status: SyncStatus, age: float, stale_after: float) -> tuple[Level, str]:
    if not age <= stale_after:
        return Level.STALE, f'stale: no sample for {age:.1f} s' if math.isfinite(age) else 'no data yet'
    if status.stamp_ns == 0:
        return Level.OK, 'starting afresh'
    if status.stalled:
        return Level.ERROR, f'stalled: the {" and the ".join(status.stalled)} wheel does not strike any more'
    if status.slipped:
        return Level.WARN, f'slipped a step: n = {status.step_difference}'
    if status.lost:
        return Level.WARN, f'lost synchronization: error {status.error_percent:+.1f} %'
    if status.synchronized:
        return Level.OK, f'synchronized after {status.steps_to_synchronization} steps'
    return Level.OK, f'converging: error {status.error_percent:+.1f} %'


def _judge_phase(status: PhaseStatus, age: float, stale_after: float) -> tuple[Level, str]:
    if not age <= stale_after:
        if status.refusal:
            return Level.STALE, f'every sample is refused: {_REASONS[status.refusal]}'
        return Level.STALE, f'stale: no sample for {age:.1f} s' if math.isfinite(age) else 'no data yet'
    if status.n_uncertain:
        return Level.WARN, f'n may be off: a gap of up to {status.cadence.longest:.2f} s may hide a step'
    return Level.OK, 'tracking both wheels'


_REASONS: dict[Refusal, str] = {
    'unreadable': 'a wheel is missing, or the message is malformed (see the parameters front_joint and rear_joint)',
    'not finite': 'a rotation is no finite number',
    'repeated': 'the stamp stands still',
    'reversed': 'the stamp goes back',
    'future': "the stamp lies ahead of this node's clock (do the machines' clocks agree? is use_sim_time the same?)",
    'outlier': 'no wheel turns that fast (see the parameter max_speed)',
}


def _stream(cadence: CadenceStatus, age: float) -> dict[str, str]:
    return {
        'rate in': _number(cadence.rate, '.1f', ' Hz'),
        'gaps': f'{cadence.gaps} ({cadence.lost} samples lost, longest {cadence.longest:.3f} s)',
        'age of the last sample': _number(age, '.3f', ' s'),
    }


def _number(value: float, form: str, unit: str = '') -> str:
    return f'{value:{form}}{unit}' if math.isfinite(value) else 'unknown'

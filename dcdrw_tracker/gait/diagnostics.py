"""Diagnoses: what snapshots of the cores mean to a person. Pure functions; `/diagnostics` carries the result."""

import math
from collections.abc import Iterable

from dcdrw_msgs_py.diagnosis import (
    AGE,
    CONTRACTION,
    ERROR,
    ERROR_DEG,
    GAPS,
    HIGHEST_ERROR,
    LONGEST_GAP,
    LOST_SAMPLES,
    LOWEST_ERROR,
    PHASE,
    PHASE_OF_STRIDE,
    RATE_IN,
    REFUSED,
    RESTARTS,
    STATE,
    STEP_DIFFERENCE,
    STEPS,
    STEPS_TO_SYNCHRONIZATION,
    Diagnosis,
    Level,
    PairState,
    Value,
)
from dcdrw_msgs_py.words import counted
from dcdrw_tracker.gait.cadence import CadenceStatus
from dcdrw_tracker.gait.pair_state import judge
from dcdrw_tracker.gait.phase import LARGEST_ROTATION, Hint, PhaseStatus, Refusal
from dcdrw_tracker.gait.sync import SyncStatus


def diagnose_sync(status: SyncStatus, age: float, stale_after: float) -> Diagnosis:
    """The monitor's diagnosis.

    Args:
        status: a snapshot of the monitor.
        age: seconds since the last sample came, by a steady clock; NaN or infinite where none came.
        stale_after: age from which the input is stale [s].

    """
    state = judge(status, age <= stale_after)
    level, message = _LEVELS.get(state, Level.OK), _message(state, status, age)
    if status.too_coarse and state is not PairState.NO_DATA:
        level, message = max(level, Level.WARN), f'{message}; {coarseness(status)}'
    if status.too_rare and state is not PairState.NO_DATA:
        level, message = max(level, Level.WARN), f'{message}; {rareness(status)}'
    low, high = status.swing_percent
    steps, latest = status.steps_to_synchronization, status.steps_at_latest
    return Diagnosis(
        level,
        message,
        {
            STATE: state,
            PHASE: 100.0 * status.phase,
            PHASE_OF_STRIDE: 50.0 * status.phase,
            ERROR: status.error_percent,
            ERROR_DEG: math.degrees(status.error),
            LOWEST_ERROR: low,
            HIGHEST_ERROR: high,
            STEP_DIFFERENCE: status.step_difference,
            STEPS: status.steps,
            STEPS_TO_SYNCHRONIZATION: math.nan if steps is None else steps,
            f'{STEPS_TO_SYNCHRONIZATION}, at the latest': math.nan if latest is None else latest,
            'initial phase [%]': 100.0 * status.initial_phase,
            CONTRACTION: status.contraction,
            'resolution of the error [%]': status.resolution_percent,
            'samples in a step': status.samples_in_step,
            'lone wild samples': status.strays,
            'slipped steps': status.slips,
            'times synchronization was lost': status.losses,
            RESTARTS: status.restarts,
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
            'steps of the front wheel': status.front_steps,
            'steps of the rear wheel': status.rear_steps,
            STEP_DIFFERENCE: status.front_steps - status.rear_steps,
            'n is certain': not status.n_uncertain,
            'samples accepted': status.accepted,
            REFUSED: sum(status.refused.values()),
            **{f'{REFUSED}: {why}': count for why, count in status.refused.items()},
            RESTARTS: status.restarts,
            'messages that name neither wheel': status.foreign,
            'samples without a stamp': status.unstamped,
            'lone wild samples': status.strays,
            'samples that came twice': status.duplicates,
            'times the clock of the source was set': len(status.clock_steps),
            'times the counter of an encoder rolled over': status.rollovers,
            'samples whose speeds do not go with the rotations': status.disbelieved,
            **_stream(status.cadence, age),
        },
    )


_LEVELS = {
    PairState.NO_DATA: Level.STALE,
    PairState.STALLED: Level.ERROR,
    PairState.SLIPPED: Level.WARN,
    PairState.LOST: Level.WARN,
}
"""The level and message of each state that is not OK."""


def coarseness(status: SyncStatus) -> str:
    """What is said of rotations that are told too coarsely for the band."""
    return (
        f'the encoders are too coarse for the band: a count of each leaves {status.resolution_percent:.3g} % of a step '
        'open (more counts in a turn would tell)'
    )


def rareness(status: SyncStatus) -> str:
    """What is said of samples that are too rare to tell what the error does within a step."""
    return (
        f'the samples are too rare, {status.samples_in_step:.1f} in a step: the error may leave the band between two '
        'of them (a higher rate would tell; 20 in a step are well)'
    )


def phase_text(phase: float) -> str:
    """The phase as people read it: of a step, and of a stride, which is two steps."""
    return f'{_number(100.0 * phase)} of a step, {_number(50.0 * phase)} of a stride'


def _message(state: PairState, status: SyncStatus, age: float) -> str:
    return {
        PairState.NO_DATA: _no_sample(age),
        PairState.HELD: 'the wheels are held',
        PairState.STALLED: f'stalled: the {" and the ".join(status.stalled)} wheel does not strike any more',
        PairState.SLIPPED: f'slipped a step: n = {status.step_difference}',
        # No error here: it changes within a step, and stands elsewhere, younger.
        PairState.LOST: 'lost synchronization: the error has left the band',
        PairState.SYNCHRONIZED: f'synchronized after {counted(status.steps_text, "step")}',
        PairState.CONVERGING: 'converging: not in step yet',
    }[state]


def _judge_phase(status: PhaseStatus, age: float, stale_after: float) -> tuple[Level, str]:
    if not age <= stale_after:
        if status.refusal:
            return Level.STALE, f'every sample is refused: {REFUSALS[status.refusal]}'
        return Level.STALE, _no_sample(age)
    if status.hints:
        return Level.WARN, '; '.join(hints_in_words(status.hints))
    if status.n_uncertain:
        return Level.WARN, f'n may be off: a gap of up to {status.cadence.longest:.2f} s may hide a step'
    return Level.OK, 'tracking both wheels'


def hints_in_words(hints: Iterable[Hint]) -> list[str]:
    """What makes parameters seem wrong."""
    found = dict.fromkeys(hints)
    if {'front_sign', 'rear_sign'} <= found.keys():
        return [_BOTH_UPHILL, *(_HINTS[hint] for hint in found if hint not in ('front_sign', 'rear_sign'))]
    return [_HINTS[hint] for hint in found]


_BOTH_UPHILL = (
    'both wheels roll uphill: are their signs right? (parameters front_sign and rear_sign; of poses, heading_deg, and '
    'which of them is front)'
)
_HINTS: dict[Hint, str] = {
    'front_sign': 'the front wheel rolls uphill: is its sign right? (parameter front_sign)',
    'rear_sign': 'the rear wheel rolls uphill: is its sign right? (parameter rear_sign)',
    'ratio': 'one wheel takes more steps than the other: are the gear ratios of both encoders right, and the spokes? '
    '(parameters front.spokes and rear.spokes)',
    'rollover': "an encoder's counter rolls over within a turn, perhaps also before the start: where is its zero? "
    '(parameter rollover, which takes a start in its upper half for one below 0)',
    'lone_jump': "one wheel's rotation jumped alone: does its encoder's counter roll over? "
    '(parameter rollover, by how much)',
    'stamps': "the stamps pass far faster or slower than this node's clock, or begin anew again and again: are they "
    'whole, in seconds and nanoseconds? (of stamps that are all zero, the time of arrival counts)',
    'revolutions': 'the wheels turn slower than they can roll: are their rotations in revolutions? '
    '(parameter unit; of a film in slow motion, its frame rate)',
    'unit': 'a wheel turns faster than it can roll: are the rotations in degrees? '
    '(parameter unit, of both wheels; of a film, its frame rate)',
}
REFUSALS: dict[Refusal, str] = {
    'unreadable': 'a wheel is missing, or the message is malformed (see the parameters front_joint and rear_joint)',
    'unpaired': "each wheel comes in messages of its own, and the rear one's stay away",
    'not finite': f'a rotation is not finite, or beyond {LARGEST_ROTATION:g} rad',
    'repeated': 'the stamp stands still',
    'reversed': 'the stamp goes back',
    'future': "the stamp lies ahead of this node's clock (do the machines' clocks agree? is use_sim_time the same?)",
    'outlier': 'no wheel turns that fast (see the parameter max_speed)',
}
"""Why a sample is refused."""


def _no_sample(age: float) -> str:
    return f'stale: no sample for {age:.1f} s' if math.isfinite(age) else 'no data yet'


def _stream(cadence: CadenceStatus, age: float) -> dict[str, Value]:
    return {
        RATE_IN: cadence.rate,
        GAPS: cadence.gaps,
        LOST_SAMPLES: cadence.lost,
        LONGEST_GAP: cadence.longest,
        AGE: age,
    }


def _number(value: float) -> str:
    return f'{value:.1f} %' if math.isfinite(value) else 'unknown'

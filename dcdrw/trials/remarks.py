"""What the verdict on a trial leaves out, and what had to be made good for it: in words, each with its counts."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from dcdrw.trials.acts import stretches
from dcdrw.trials.analysis import Analysis, Resumption
from dcdrw.trials.strike_check import Contradiction
from dcdrw_control.sync.safety import State
from dcdrw_msgs_py.diagnosis import PairState
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.words import by_count, counted
from dcdrw_tracker.gait.diagnostics import REFUSALS, coarseness, hints_in_words, rareness
from dcdrw_tracker.gait.phase import Restart

ANOTHER_PACE = 1.25
"""Stamps that pass so many times as fast as the recording, or as slowly, go by another clock; no delay does that."""
MANY_STRAYS = 0.005
"""The share of wild samples from which on the verdict rests on less: a few cost nothing."""
MANY_DISBELIEVED = 0.1
"""The share of the samples from which on it is said that their speeds are not used; fewer lie around gaps."""


class Remark(NamedTuple):
    """What a reader of the verdict should know."""

    text: str
    """A sentence."""
    rests_on_less: bool = False
    """The verdict rests on less than what was recorded."""


def remarks(trial: Analysis) -> tuple[Remark, ...]:
    """All that is to be said beside the verdict; what takes most from it comes first."""
    return tuple(_remarks(trial))


def _remarks(trial: Analysis) -> Iterator[Remark]:
    estimator, cadence = trial.estimator, trial.cadence
    for hint in hints_in_words(estimator.hints):
        yield Remark(_as_sentence(hint), True)
    for one in trial.contradictions:
        yield Remark(_contradicted(one), True)
    if trial.status.too_coarse:
        yield Remark(_as_sentence(coarseness(trial.status)), True)
    if trial.status.too_rare:
        yield Remark(_as_sentence(rareness(trial.status)), True)
    shift = 100.0 * abs(trial.wheels_apart) * trial.status.steps / trial.seconds if trial.seconds > 0.0 else 0.0
    if shift >= trial.params.sync.band_percent:
        yield Remark(
            f'By their stamps, messages of the rear wheel were recorded {1000.0 * trial.wheels_apart:+.0f} ms '
            f"later than the front wheel's: unless they were so late, the clocks disagree, "
            f'and the phase is off by {shift:.1f} %.',
            True,
        )
    if trial.resumed:
        yield Remark(f'{_begun_anew(trial, trial.resumed)}; what came before is left out.', True)
    refused = sum(estimator.refusals.values())
    if refused:
        told = dict(REFUSALS)
        told['unreadable'] = trial.unreadable or told['unreadable']
        reasons = '; '.join(
            told[why] if count == refused else f'{counted(count, "time")} {told[why]}'
            for why, count in estimator.refusals.items()
        )
        of = estimator.accepted + estimator.strays + estimator.duplicates + refused
        yield Remark(
            f'{refused} of {counted(of, "joint state")} {by_count(refused, "was", "were")} refused: {reasons}.', True
        )
    if cadence.lost:
        yield Remark(
            f'By the stamps, {cadence.lost} of {trial.samples + cadence.lost} samples '
            f'{by_count(cadence.lost, "is", "are")} missing, in '
            f'{counted(cadence.gaps, "gap")} of up to {cadence.longest:.3g} s.'
        )
    if trial.state is PairState.SYNCHRONIZED and trial.status.steps_at_latest != trial.status.steps_to_synchronization:
        yield Remark(
            'A gap may hide that the error left the band later: '
            f'in step after {counted(trial.status.steps_text, "step")}.'
        )
    faults = [one for one in stretches(trial.acts, trial.start_ns, trial.seconds) if one.state == State.FAULT.value]
    if faults:
        seconds, begin = sum(one.end - one.begin for one in faults), faults[0].begin
        yield Remark(
            f'The synchronizer was in fault for {seconds:.1f} of {trial.seconds:.1f} s, from {begin:.1f} s on, '
            'and gave no force meanwhile.'
        )
    if estimator.n_uncertain:
        yield Remark('A gap was long enough to hide a step: n may be off.')
    if estimator.unstamped:
        yield Remark(
            f'{counted(estimator.unstamped, "joint state")} had no stamp of use: the time of recording took its place.'
        )
    if not 1.0 / ANOTHER_PACE <= trial.pace <= ANOTHER_PACE and not math.isnan(trial.pace):
        stalled = trial.state is PairState.STALLED  # which time alone tells
        yield Remark(f'Time passed {trial.pace:.3g} times as fast by the stamps as by the recording.', stalled)
    if estimator.foreign:
        yield Remark(
            f'{counted(estimator.foreign, "message")} {by_count(estimator.foreign, "names", "name")} neither wheel, '
            f'and {by_count(estimator.foreign, "is", "are")} none of this rig.'
        )
    if estimator.duplicates:
        again = by_count(estimator.duplicates, 'it was, and counts', 'they were, and count')
        yield Remark(f'{counted(estimator.duplicates, "joint state")} came again as {again} once.')
    if estimator.disbelieved > MANY_DISBELIEVED * estimator.accepted:
        yield Remark('The speeds in the joint states do not go with the rotations: those of the rotations are used.')
    if estimator.clock_steps:
        steps = sorted(step.seconds for step in estimator.clock_steps)
        by = f'by {steps[0]:+.3g} s' + (f' to {steps[-1]:+.3g} s, {counted(len(steps), "time")},' if steps[1:] else '')
        yield Remark(
            f'The clock of the source was set {by} while the wheels rolled on; this is undone, and nothing left out.'
        )
    if trial.strays:
        yield Remark(
            f'{counted(trial.strays, "sample")} lay apart from both neighbours, and '
            f'{by_count(trial.strays, "is", "are")} passed over.',
            trial.strays > MANY_STRAYS * trial.samples,
        )
    if estimator.rollovers:
        yield Remark(
            f'The counter of an encoder rolled over {counted(estimator.rollovers, "time")}, which is made good.'
        )


def _contradicted(one: Contradiction) -> str:
    """Which parameter the strikes of a wheel contradict, and what would go with them."""
    if one.parameter.endswith('zero'):
        return (
            f'The {one.wheel} wheel is braked {math.degrees(one.value - one.thought):+.0f}° from where it should '
            f'strike: is its zero right? (parameter {one.parameter}; {one.value:.2f} rad would go with its strikes).'
        )
    return (
        f'The {one.wheel} wheel is braked {one.value:.3g} times a turn, not {one.thought:.3g} times: are the gear '
        f'ratio of its encoder and its spokes right? (parameter {one.parameter}; {one.value:.3g} would go with its '
        'strikes).'
    )


def _as_sentence(words: str) -> str:
    return f'{words[0].upper()}{words[1:]}.'


def _begun_anew(trial: Analysis, resumed: Resumption) -> str:
    """Why and when judgement began anew for the last time."""
    before = (resumed.before_ns - trial.start_ns) / SECOND
    times = trial.status.restarts
    last = f', for the last of {times} times' if times > 1 else ''
    restarted = trial.estimator.restarted
    if resumed.restarted and restarted:
        return f'The source began anew after {before:.1f} s{last}: {_cause(restarted[-1])}'
    silence = (resumed.stamp_ns - resumed.before_ns) / SECOND
    if silence > trial.params.sync.stale_after:
        return f'No sample of use came for {silence:.1f} s after {before:.1f} s{last}, and judgement begins anew there'
    return f'The wheels jumped after {before:.1f} s{last}, and judgement begins anew there'


def _cause(restart: Restart) -> str:
    if restart.cause == 'announced':
        return 'it says so itself'
    if restart.cause == 'stamp':
        return f'its stamps went {"back" if restart.seconds < 0.0 else "ahead"} by {abs(restart.seconds):.3g} s'
    jumps = ' and '.join(
        f'{wheel} by {jump:+.3g} rad'
        for wheel, jump in ((FRONT, restart.front), (REAR, restart.rear))
        if math.isfinite(jump)
    )
    return f'its rotations jumped ({jumps}), so that they have no common zero with those before'

"""What a trial came to: figures for a program, a sentence for a person."""

import math
from typing import Any, NamedTuple

from dcdrw.trials.analysis import Analysis
from dcdrw.trials.remarks import Remark, remarks
from dcdrw.trials.strike_check import Contradiction
from dcdrw_msgs_py.diagnosis import PairState
from dcdrw_msgs_py.quantity import flatten
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.words import counted
from dcdrw_tracker.gait.phase import ClockStep, Hint, Refusal, Restart


class Samples(NamedTuple):
    """What came of the messages of a trial."""

    joint_states: int
    """Number of joint states since the wheels were let go, with those that were refused."""
    phase_state: int
    gaps: int
    lost: int
    longest_gap_s: float | None
    refused: dict[Refusal, int]
    """By the reason; of all that were recorded, as everything below."""
    restarts: tuple[Restart, ...]
    """When the source started anew."""
    clock_steps: tuple[ClockStep, ...]
    """Times that the clock of the source was set, which are undone."""
    foreign: int
    """Messages that name neither wheel."""
    unstamped: int
    """Without a stamp, so that the time of recording took its place."""
    strays: int
    """Wild ones, apart from those before and after, which are passed over."""
    duplicates: int
    """Joint states that came again as they were, which costs nothing."""
    rollovers: int
    """Times that the counter of an encoder rolled over, which is made good."""
    hints: tuple[Hint, ...]
    """Parameters that seem to be wrong."""
    contradictions: tuple[Contradiction, ...]
    """Zeros and numbers of spokes that the strikes contradict, and those that would go with them."""


class Summary(NamedTuple):
    """Everything that a program wants to know of a trial. What the trial does not tell is None."""

    sentence: str
    state: PairState
    """What the pair did in the end."""
    reason: str | None
    """Why there is no verdict; None where there is one."""
    remarks: tuple[Remark, ...]
    """What the verdict leaves out, and what had to be made good for it."""
    complete: bool
    """The verdict rests on all that was recorded."""
    judged_from_s: float
    """Where the part begins that is judged, from the moment on that the wheels were let go."""
    synchronized: bool | None
    initial_phase_percent: float | None
    """Phase in percent of a step, as all phases here but `initial_phase_stride_percent`."""
    final_phase_percent: float | None
    final_phase_percent_of_stride: float | None
    steps_to_synchronization: int | None
    steps_to_synchronization_at_latest: int | None
    """If the error left the band once more in a gap, wherever it may have; the same where no gap hides it."""
    band_percent: float
    final_band_percent: tuple[float | None, float | None]
    """Least and greatest error over the last steps."""
    resolution_percent: float
    """How far coarse encoders leave the error open, a count of each; 0 where the rotations are told finely."""
    final_phi_deg: tuple[float | None, float | None]
    contraction_per_step: float | None
    error_percent_per_step: tuple[float | None, ...]
    front_steps: int
    footfalls: int
    slips: int
    losses_of_synchronization: int
    stalled: tuple[str, ...]
    """The wheels that have stalled."""
    duration_s: float | None
    samples: Samples
    damage: tuple[str, ...]
    """What of the recording was left out, for it is damaged."""
    parameters: dict[str, dict[str, Any]]
    """Parameters of each node; None where they are derived from others."""


def summarize(trial: Analysis) -> Summary:
    """Everything that a program wants to know of a trial."""
    status, state = trial.status, trial.state
    synchronized = state is PairState.SYNCHRONIZED
    low, high = status.final_band_percent
    said, judged = remarks(trial), trial.ran and not trial.why_not_judged
    return Summary(
        sentence=sentence(trial),
        state=state,
        reason=trial.why_not_run or trial.why_not_judged or None,
        remarks=said,
        complete=judged and not trial.damage and not any(remark.rests_on_less for remark in said),
        judged_from_s=(trial.resumed.stamp_ns - trial.start_ns) / SECOND if trial.resumed else 0.0,
        synchronized=synchronized if judged else None,
        initial_phase_percent=_known(100.0 * status.initial_phase),
        final_phase_percent=_known(100.0 * status.phase),
        final_phase_percent_of_stride=_known(50.0 * status.phase),
        steps_to_synchronization=status.steps_to_synchronization if synchronized else None,
        steps_to_synchronization_at_latest=status.steps_at_latest if synchronized else None,
        band_percent=trial.params.sync.band_percent,
        final_band_percent=(_known(low), _known(high)),
        resolution_percent=status.resolution_percent,
        final_phi_deg=(_known(_degrees(low, trial)), _known(_degrees(high, trial))),
        contraction_per_step=_known(status.contraction),
        error_percent_per_step=tuple(map(_known, status.history)),
        front_steps=status.steps,
        footfalls=len(trial.footfalls),
        slips=status.slips,
        losses_of_synchronization=status.losses,
        stalled=status.stalled,
        duration_s=_known(trial.seconds),
        samples=Samples(
            joint_states=trial.joint_states,
            phase_state=trial.samples,
            gaps=trial.cadence.gaps,
            lost=trial.cadence.lost,
            longest_gap_s=_known(trial.cadence.longest),
            refused=trial.estimator.refusals,
            restarts=trial.estimator.restarted,
            clock_steps=trial.estimator.clock_steps,
            foreign=trial.estimator.foreign,
            unstamped=trial.estimator.unstamped,
            strays=trial.strays,
            duplicates=trial.estimator.duplicates,
            rollovers=trial.estimator.rollovers,
            hints=trial.estimator.hints,
            contradictions=trial.contradictions,
        ),
        damage=trial.damage,
        parameters={name: flatten(values) for name, values in trial.params._asdict().items()},
    )


def sentence(trial: Analysis) -> str:
    """The trial in a sentence, and in another each that a reader of it should know."""
    return ' '.join([verdict(trial), *(remark.text for remark in remarks(trial))])


def verdict(trial: Analysis) -> str:
    """What the pair did, in a sentence."""
    if not trial.ran:
        return f'Not run: {trial.why_not_run}.'
    status, band = trial.status, trial.params.sync.band_percent
    start, end = 100.0 * status.initial_phase, 100.0 * status.phase
    if trial.why_not_judged:
        return f'Too little to judge: {trial.why_not_judged}, from {start:.1f} % to {end:.1f} %.'
    low, high = status.final_band_percent
    course = f'from {start:.1f} % to {end:.1f} % in {counted(status.steps, "step")}'
    where = f'outside ±{band:g} % of 50 %'
    if abs(status.error_percent) <= band:
        hold = trial.params.sync.hold_steps
        where = f'within ±{band:g} % of 50 %, but not for {counted(hold, "whole step")}'
    return {
        PairState.STALLED: f'From {start:.1f} %: the {" and the ".join(status.stalled)} wheel stalled after '
        f'{counted(status.steps, "step")}.',
        PairState.SLIPPED: f'A step slipped shortly before the end: {course}, n = {status.step_difference}.',
        PairState.LOST: f'Synchronization was lost: {course}, {where}.',
        PairState.SYNCHRONIZED: f'From {start:.1f} % to within ±{band:g} % of 50 % of a step (25 % of a stride) in '
        f'{counted(status.steps_text, "step")}; in the last ones {50 + low:.1f} to {50 + high:.1f} %.',
        PairState.CONVERGING: f'Not synchronized: {course}, {where}.',
    }[trial.state]


def _known(value: float) -> float | None:
    """Six digits of a figure; None where it is not known."""
    return None if math.isnan(value) else float(f'{value:.6g}')


def _degrees(error_percent: float, trial: Analysis) -> float:
    """The phase difference φ of an error [°]."""
    return math.degrees((0.5 + error_percent / 100.0) * trial.pitch)

"""What a trial came to: figures for a program, a sentence for a person."""

import math
from typing import Any, NamedTuple

from dcdrw.parameter_file import TrialParams
from dcdrw_msgs_py.quantity import flatten
from dcdrw_msgs_py.samples import Footfall, JointSample, PhaseSample
from dcdrw_tracker.sync import SyncMonitor, SyncStatus

SECOND = 1e9


class TrialData(NamedTuple):
    """What a trial recorded, from the moment that the wheels were let go."""

    params: TrialParams
    joints: list[JointSample]
    phases: list[PhaseSample]
    footfalls: list[Footfall]


def judge(data: TrialData) -> tuple[SyncStatus, list[float]]:
    """Run the monitor over the recorded phase: its last status, and the error at each sample [%]."""
    monitor = SyncMonitor(data.params.sync)
    errors = []
    for phase in data.phases:
        sync = monitor.update(phase)
        errors.append(sync.error_percent if sync else math.nan)
    return monitor.status(), errors


def summarize(data: TrialData, status: SyncStatus, errors: list[float]) -> dict[str, Any]:
    """Everything that a program wants to know of a trial; angles in degrees, phases in percent of a step."""
    phases, sync = data.phases, data.params.sync
    duration = (phases[-1].stamp_ns - phases[0].stamp_ns) / SECOND if phases else 0.0
    band = final_band(data, errors)
    return {
        'sentence': sentence(data, status, errors),
        'synchronized': status.synchronized,
        'initial_phase_percent': _rounded(100.0 * status.initial_phase),
        'final_phase_percent': _rounded(100.0 * status.phase),
        'final_phase_percent_of_stride': _rounded(50.0 * status.phase),
        'steps_to_synchronization': status.steps_to_synchronization,
        'band_percent': sync.band_percent,
        'final_band_percent': [_rounded(value) for value in band],
        'final_phi_deg': [_rounded(math.degrees((0.5 + value / 100.0) * pitch(data))) for value in band],
        'contraction_per_step': _rounded(status.contraction),
        'error_percent_per_step': [_rounded(error) for error in status.history],
        'front_steps': status.steps,
        'footfalls': len(data.footfalls),
        'slips': status.slips,
        'losses_of_synchronization': status.losses,
        'stalled': list(status.stalled),
        'duration_s': _rounded(duration),
        'samples': {'joint_states': len(data.joints), 'phase_state': len(phases), 'gaps': status.cadence.gaps,
                    'lost': status.cadence.lost},
        'parameters': {name: _plain(flatten(values)) for name, values in data.params._asdict().items()},
    }


def sentence(data: TrialData, status: SyncStatus, errors: list[float]) -> str:
    """The trial in a sentence."""
    if not data.phases:
        return 'No phase was seen: nothing to judge.'
    start, band = 100.0 * status.initial_phase, data.params.sync.band_percent
    low, high = final_band(data, errors)
    if status.synchronized:
        return (f'From {start:.1f} % to within ±{band:g} % of 50 % of a step (25 % of a stride) in '
                f'{status.steps_to_synchronization} steps; in the last ones {50 + low:.1f} to {50 + high:.1f} %.')
    if status.stalled:
        return f'From {start:.1f} %: the {" and the ".join(status.stalled)} wheel stalled after {status.steps} steps.'
    lost = 'Synchronization was lost' if status.lost else 'Not synchronized'
    return (f'{lost}: from {start:.1f} % to {100.0 * status.phase:.1f} % in {status.steps} steps, '
            f'outside ±{band:g} % of 50 %.')


def final_band(data: TrialData, errors: list[float]) -> tuple[float, float]:
    """Least and greatest error over the last `hold_steps` steps of the front wheel [%]; NaN without data."""
    falls = [fall.stamp_ns for fall in data.footfalls if fall.wheel == 'front'][-data.params.sync.hold_steps - 1:]
    since = falls[0] if falls else 0
    last = [error for phase, error in zip(data.phases, errors, strict=True)
            if phase.stamp_ns >= since and not math.isnan(error)]
    return (min(last), max(last)) if last else (math.nan, math.nan)


def pitch(data: TrialData) -> float:
    """The angle φ of a whole step, α1 + α2 [rad]."""
    return data.params.sync.front.alpha + data.params.sync.rear.alpha


def _rounded(value: float) -> float | None:
    return None if math.isnan(value) else float(f'{value:.6g}')


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    return {name: None if isinstance(value, float) and math.isnan(value) else value for name, value in values.items()}

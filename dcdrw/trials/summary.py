"""What a trial came to: figures for a program, a sentence for a person."""

import math
from typing import Any

import numpy as np

from dcdrw.trials.analysis import Analysis
from dcdrw_msgs_py.quantity import flatten
from dcdrw_msgs_py.rig import FRONT


def summarize(trial: Analysis) -> dict[str, Any]:
    """Everything that a program wants to know of a trial; angles in degrees, phases in percent of a step."""
    status, seconds = trial.status, trial.motion.seconds
    band = final_band(trial)
    return {
        'sentence': sentence(trial),
        'synchronized': status.synchronized,
        'initial_phase_percent': _rounded(100.0 * status.initial_phase),
        'final_phase_percent': _rounded(100.0 * status.phase),
        'final_phase_percent_of_stride': _rounded(50.0 * status.phase),
        'steps_to_synchronization': status.steps_to_synchronization,
        'band_percent': trial.params.sync.band_percent,
        'final_band_percent': [_rounded(value) for value in band],
        'final_phi_deg': [_rounded(math.degrees((0.5 + value / 100.0) * trial.pitch)) for value in band],
        'contraction_per_step': _rounded(status.contraction),
        'error_percent_per_step': [_rounded(error) for error in status.history],
        'front_steps': status.steps,
        'footfalls': len(trial.footfalls),
        'slips': status.slips,
        'losses_of_synchronization': status.losses,
        'stalled': list(status.stalled),
        'duration_s': _rounded(float(seconds[-1]) if len(seconds) else 0.0),
        'samples': {
            'joint_states': trial.joint_states,
            'phase_state': len(seconds),
            'gaps': status.cadence.gaps,
            'lost': status.cadence.lost,
        },
        'parameters': {name: _plain(flatten(values)) for name, values in trial.params._asdict().items()},
    }


def sentence(trial: Analysis) -> str:
    """The trial in a sentence."""
    if not len(trial.motion.stamp_ns):
        return 'No phase was seen: nothing to judge.'
    status, band = trial.status, trial.params.sync.band_percent
    start = 100.0 * status.initial_phase
    low, high = final_band(trial)
    if status.synchronized:
        return (
            f'From {start:.1f} % to within ±{band:g} % of 50 % of a step (25 % of a stride) in '
            f'{status.steps_to_synchronization} steps; in the last ones {50 + low:.1f} to {50 + high:.1f} %.'
        )
    if status.stalled:
        return f'From {start:.1f} %: the {" and the ".join(status.stalled)} wheel stalled after {status.steps} steps.'
    lost = 'Synchronization was lost' if status.lost else 'Not synchronized'
    return (
        f'{lost}: from {start:.1f} % to {100.0 * status.phase:.1f} % in {status.steps} steps, '
        f'outside ±{band:g} % of 50 %.'
    )


def final_band(trial: Analysis) -> tuple[float, float]:
    """Least and greatest error over the last `hold_steps` steps of the front wheel [%]; NaN without data."""
    falls = [fall.stamp_ns for fall in trial.footfalls if fall.wheel == FRONT][-trial.params.sync.hold_steps - 1 :]
    errors = trial.motion.error_percent[trial.motion.stamp_ns >= (falls[0] if falls else 0)]
    if np.isnan(errors).all():
        return math.nan, math.nan
    return float(np.nanmin(errors)), float(np.nanmax(errors))


def _rounded(value: float) -> float | None:
    return None if math.isnan(value) else float(f'{value:.6g}')


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    return {name: None if isinstance(value, float) and math.isnan(value) else value for name, value in values.items()}

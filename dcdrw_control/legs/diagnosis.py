"""What a snapshot of the leg tracker means to a person. Pure functions; `/diagnostics` carries the result."""

import math
from collections.abc import Sequence

from dcdrw_control.legs.samples import Leg
from dcdrw_control.legs.tracker import LegTrackerStatus
from dcdrw_msgs_py.diagnosis import Diagnosis, Level, Value


def diagnose_legs(status: LegTrackerStatus, age: float, stale_after: float) -> Diagnosis:
    """The leg tracker's diagnosis.

    Args:
        status: a snapshot of the tracker.
        age: seconds since the last reading was accepted, by a steady clock; infinite where none was.
        stale_after: age from which the input is stale [s].

    """
    level, message = _judge(status, age, stale_after)
    values: dict[str, Value] = {}
    for leg, one in status.legs.items():
        values[f'{leg} sensor'] = one.sensor or 'none'
        values[f'{leg} strikes'] = one.strikes
        values[f'{leg} stride [s]'] = one.period
        values[f'{leg} strikes missed'] = one.missed
        values[f'{leg} strikes doubled'] = one.doubled
        values[f'{leg} gaps'] = one.gaps
    values |= {f'readings refused: {why}': count for why, count in status.refused.items()}
    values['age of the last reading [s]'] = age
    return Diagnosis(level, message, values)


def _judge(status: LegTrackerStatus, age: float, stale_after: float) -> tuple[Level, str]:
    if not age <= stale_after:
        return Level.STALE, f'stale: no reading for {age:.1f} s' if math.isfinite(age) else 'no data yet'
    legs = {leg: one for leg, one in status.legs.items() if one.heard}
    if silent := [leg for leg, one in legs.items() if one.silent]:
        return Level.WARN, f'silent: the sensor of {_names(silent)}'
    if lonely := [half for half in ('front', 'rear') if len([leg for leg in legs if leg.half == half]) == 1]:
        return Level.WARN, f'only one leg of the {lonely[0]} half has a sensor'
    if unmounted := [leg for leg, one in legs.items() if not one.mounted]:
        return Level.OK, f'learning the mounting of {_names(unmounted)}: walk a few steps'
    if unknown := [leg for leg, one in legs.items() if not one.known]:
        return Level.OK, f'waiting for a heel strike of {_names(unknown)}'
    return Level.OK, f'following {_names(list(legs))}'


def _names(legs: Sequence[Leg]) -> str:
    return ', '.join(map(str, legs))

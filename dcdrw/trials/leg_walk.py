"""A walk of people: read from a CSV file or a recording, followed, told and written."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from dcdrw.files import to_json, write_csv, write_text
from dcdrw.recordings.derived_joints import WalkParams, recorded_walk
from dcdrw.recordings.leg_recording import leg_readings
from dcdrw.recordings.recording import Recording
from dcdrw.suite.parameter_file import read_parameter_file
from dcdrw_control.legs.csv_file import read_legs
from dcdrw_control.legs.samples import LEGS, Leg
from dcdrw_control.legs.walk import Walk, follow
from dcdrw_msgs_py.topics import FRONT_WHEEL, REAR_WHEEL

PAUSE = 2.0
"""Strides that take this many times the median are pauses: they are left out of the mean."""


def read_walk(
    path: Path, rate: float = math.nan, rig: Path | None = None, namespace: str = ''
) -> tuple[Walk, list[str], list[str]]:
    """Follow the legs in a CSV file, or in a recording of their sensors; tells its damage, and notes, too.

    Args:
        path: the file, or the recording.
        rate: of a CSV file that does not tell its times [Hz].
        rig: a parameter file; of a recording, it takes the place of what was recorded.
        namespace: of the legs' sensors, where a recording has several.

    Raises:
        ValueError: what is in a file cannot be used; the mend is told.
        OSError: a file cannot be read.

    """
    if path.suffix.lower() == '.csv':
        params = read_parameter_file(rig, WalkParams(), namespace) if rig else WalkParams()
        return follow(read_legs(path, rate).readings, params.legs), [], []
    with Recording(path) as recording:
        legs, topics = recorded_walk(recording, rig, namespace)
        if not topics:
            where = f' in {namespace}' if namespace else ''
            raise ValueError(f'{path} has no topic of a sensor on a leg{where}, as front/left_imu')
        walk = follow(leg_readings(recording, legs.hip_joints, namespace), legs)
        return walk, recording.damage, recording.notes


def summarize_walk(walk: Walk) -> dict[str, dict[str, Any]]:
    """What came of it, for a program, by the legs that were heard of."""
    return {str(leg): _summarize(walk, leg) for leg in LEGS if walk.status.legs[leg].heard}


def _summarize(walk: Walk, leg: Leg) -> dict[str, Any]:
    status, strides = walk.status.legs[leg], np.diff(walk.strike_seconds(leg))
    steady = strides[strides < PAUSE * np.median(strides)] if len(strides) else strides
    return {
        'sensor': status.sensor,
        'strikes': len(walk.strikes_of(leg)),
        'stride_s': round(float(np.mean(steady)), 4) if len(steady) else None,
        'stride_deviation_s': round(float(np.std(steady)), 4) if len(steady) else None,
        'missed': status.missed,
        'doubled': status.doubled,
        'gaps': status.gaps,
        'mounting_known': status.mounted,
    }


def is_complete(summary: dict[str, dict[str, Any]]) -> bool:
    """Whether the heel strikes of every leg could be told."""
    return bool(summary) and all(one['mounting_known'] and one['strikes'] for one in summary.values())


def sentences(summary: dict[str, dict[str, Any]]) -> list[str]:
    """A line for each leg."""
    lines = [f'{leg} ({one["sensor"]}): {_told(one)}' for leg, one in summary.items()]
    return lines or ['no sensor on a leg tells anything']


def _told(one: dict[str, Any]) -> str:
    if not one['mounting_known']:
        return 'its mounting is not known: it takes a few steps, and an impact at each heel strike'
    told = [f'{one["strikes"]} heel strikes']
    if one['stride_s'] is not None:
        told.append(f'stride {one["stride_s"]:.3f} ± {one["stride_deviation_s"]:.3f} s')
    told += [f'{one[what]} {what}' for what in ('missed', 'doubled', 'gaps') if one[what]]
    return ', '.join(told)


def write_walk(walk: Walk, folder: Path, source: str, force: bool = False) -> None:
    """Write summary.json, heel_strikes.csv and phases.csv into a folder.

    Raises:
        ValueError: one exists, and force is not used.
        OSError: the disk is full, say.

    """
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / 'summary.json', to_json({'source': source, 'legs': summarize_walk(walk)}), force)
    write_csv(folder / 'heel_strikes.csv', ('leg', 'stamp_ns', 'known_ns'), walk.strikes, force)
    legs, wheels = [leg for leg in LEGS if walk.status.legs[leg].heard], (FRONT_WHEEL, REAR_WHEEL)
    rows = (
        (
            update.stamp_ns,
            *(turn.angle if turn else '' for turn in (*map(update.legs.get, legs), *map(update.wheels.get, wheels))),
        )
        for update in walk.updates
    )
    write_csv(folder / 'phases.csv', ('stamp_ns', *map(str, legs), *wheels), rows, force)

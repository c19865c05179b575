"""Cases and their strikes as JSON: what `dcdrw simulate` reads and writes."""

import json
import math
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

from dcdrw_msgs_py.quantity import check, suggestion
from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_msgs_py.text_file import one_line, read_text
from dcdrw_sim.model.dynamics import State
from dcdrw_sim.motion.ends import Strike
from dcdrw_sim.motion.pair import Simulation
from dcdrw_sim.motion.trajectory import Run

DEFAULT_STRIKES = 20
"""Strikes of a case that lists none."""

Json = Any  # as `json` reads it
Record = dict[str, Json]

_NUMBERS = ('g', 'slope', 'k', 'b', 'D0', 'S0')
_PAIRS = ('l', 'm', 'alpha')
_OPTIONAL_NUMBERS = ('coupler_friction', 'rolling_resistance', 'friction_speed')
_OPTIONAL_PAIRS = ('gyration', 'restitution')
_BESIDE = ('case', 'strikes', 'end')
_DEFAULTS = {
    **{key: float(RigParams._field_defaults[key]) for key in _OPTIONAL_NUMBERS},
    **{key: float(WheelParams._field_defaults[key]) for key in _OPTIONAL_PAIRS},
}


class Case(NamedTuple):
    """A rig and its start, as a case file holds them."""

    name: str
    rig: RigParams
    state: State
    listed_strikes: int
    """How many strikes the file lists; DEFAULT_STRIKES where it lists none."""
    raw: Record
    """The `case` object as it was read."""


def read_cases(path: Path) -> tuple[list[Case], bool]:
    """Read one case or a list of cases; the second value tells whether it was a list.

    A case is an object with g, slope, k, b, D0, S0, the pairs l, m, alpha, and x0 = [θ1, ω1, θ2, ω2],
    and where a rig has any, the pairs gyration and restitution, and coupler_friction, rolling_resistance and
    friction_speed; or such an object under the key `case` beside its `strikes`.

    Raises:
        ValueError: not JSON, not a case, an unknown key, or an impossible case: the message names the file, the case
            and the key.
        OSError: the file cannot be read.

    """
    text = read_text(path)
    try:
        content = json.loads(text, object_pairs_hook=_object)
    except (ValueError, RecursionError) as error:
        raise ValueError(f'{path} is not JSON: {error}') from None
    entries = content if isinstance(content, list) else [content]
    if not entries:
        raise ValueError(f'{path} holds no case: the list is empty')
    return [_parse(entry, f'{path}, case {index}') for index, entry in enumerate(entries)], isinstance(content, list)


def _object(pairs: list[tuple[str, Json]]) -> Record:
    content = dict(pairs)
    if len(content) < len(pairs):
        (twice, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f'the key {twice} stands in one object twice')
    return content


def _parse(entry: Json, where: str) -> Case:
    raw = entry.get('case', entry) if isinstance(entry, dict) else None
    if not isinstance(raw, dict):
        raise ValueError(f'{where}: must be an object with the keys {", ".join((*_NUMBERS, *_PAIRS, "x0"))}')
    known = ('name', *_NUMBERS, *_PAIRS, 'x0', *_DEFAULTS)
    for keys, allowed in ((raw, known if raw is not entry else (*known, *_BESIDE)), (entry, (*known, *_BESIDE))):
        for key in keys:
            if key not in allowed:
                raise ValueError(f'{where}: {key} is not a key of a case{suggestion(key, allowed)}')
    name = one_line(raw.get('name', 'case'))
    where = f'{where} ({name})' if 'name' in raw else where
    g, slope, k, b, D0, S0 = (_numbers(raw, key, where)[0] for key in _NUMBERS)
    lengths, masses, alphas = (_numbers(raw, key, where, 2) for key in _PAIRS)
    for angle in alphas:
        if not 0.0 < angle <= math.pi / 4:
            raise ValueError(f'{where}: alpha must be in (0, π/4] rad, got {angle}')
    front, rear = (
        WheelParams(length=length, mass=mass, spokes=math.pi / alpha, gyration=gyration, restitution=restitution)
        for length, mass, alpha, gyration, restitution in zip(
            lengths, masses, alphas, *(_numbers(raw, key, where, 2) for key in _OPTIONAL_PAIRS), strict=True
        )
    )
    friction = {key: _numbers(raw, key, where)[0] for key in _OPTIONAL_NUMBERS}
    rig = RigParams(front=front, rear=rear, k=k, b=b, D0=D0, S0=S0, slope=slope, gravity=g, **friction)
    state = State(*_numbers(raw, 'x0', where, 4))
    try:
        Simulation(check(rig), state)
    except ValueError as error:
        raise ValueError(f'{where}: {error}') from None
    strikes = entry.get('strikes')
    return Case(name, rig, state, len(strikes) if isinstance(strikes, list) and strikes else DEFAULT_STRIKES, raw)


def _numbers(raw: Record, key: str, where: str, count: int = 1) -> list[float]:
    if key not in raw:
        if key in _DEFAULTS:
            return [_DEFAULTS[key]] * count
        raise ValueError(f'{where}: {key} is missing')
    values = raw[key] if count > 1 else [raw[key]]
    if not isinstance(values, list) or len(values) != count or not all(map(_is_number, values)):
        wanted = f'{count} finite numbers' if count > 1 else 'a finite number'
        raise ValueError(f'{where}: {key} must be {wanted}, got {raw[key]!r}')
    return [float(value) for value in values]


def _is_number(value: Json) -> bool:
    try:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # a whole number beyond every float
        return False


def strike_record(strike: Strike) -> Record:
    """One strike as the file holds it."""
    return {'wheel': strike.wheel, 't': strike.t, 'state': [float(value) for value in strike.state]}


def run_record(case: Case, run: Run) -> Record:
    """One case with its strikes and why it ended, in the format of the file that it came from."""
    end = {'reason': run.end.name.lower(), 'meaning': run.reason, 't': run.duration}
    return {'case': case.raw, 'strikes': [strike_record(strike) for strike in run.strikes], 'end': end}

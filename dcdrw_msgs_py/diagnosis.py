"""How a node is, as plain data; what it says of itself on `/diagnostics`.

The message is for people alone. What a program wants to know is a value under a key, and the keys that anybody reads
are declared here. A value is a bare number whose unit stands in its key, a state, a flag or a name.
"""

import math
from collections.abc import Mapping, Sequence
from enum import Enum, IntEnum
from typing import NamedTuple, TypeVar

from dcdrw_msgs_py.words import by_count, counted

State = TypeVar('State', bound=Enum)
Value = str | float | bool | Enum

STATE = 'state'
"""Key of a state: `PairState` of `sync_monitor`, `SourceState` of the simulator, `RecorderState` of the recorder."""
PHASE, PHASE_OF_STRIDE = 'phase [%]', 'phase of a stride [%]'
ERROR, ERROR_DEG = 'error [%]', 'error [deg]'
LOWEST_ERROR, HIGHEST_ERROR = 'lowest error within the last step [%]', 'highest error within the last step [%]'
STEP_DIFFERENCE = 'n'
STEPS = 'steps'
STEPS_TO_SYNCHRONIZATION = 'steps to synchronization'
CONTRACTION = 'per-step convergence ratio'
RATE_IN, AGE = 'rate in [Hz]', 'age of the last sample [s]'
GAPS, LOST_SAMPLES, LONGEST_GAP = 'gaps', 'samples lost', 'longest gap [s]'
RESTARTS = 'restarts of the source'
REFUSED = 'samples refused'
SOURCES = 'sources'
"""Names of the nodes that publish what only one should; empty where one does."""


def messages_of(topic: str) -> str:
    """The recorder's key for how many messages of a topic it has; absent where it does not listen to the topic."""
    return f'messages of {topic}'


def parameters_of(node: str) -> str:
    """The recorder's key for whether it has the parameters of a node."""
    return f'parameters of {node}'


class Level(IntEnum):
    """The levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


class PairState(str, Enum):
    """What the pair does; where several hold, the first of them counts."""

    NO_DATA = 'no_data'
    """No sample has come, or none for a while."""
    HELD = 'held'
    """The wheels are held: paused, or not yet let go."""
    STALLED = 'stalled'
    """A wheel does not strike any more."""
    SLIPPED = 'slipped'
    """A wheel has just struck twice in a row."""
    LOST = 'lost'
    """The pair was in step, and is no longer."""
    SYNCHRONIZED = 'synchronized'
    CONVERGING = 'converging'

    @property
    def word(self) -> str:
        """As people read it."""
        return self.value.replace('_', ' ').upper()


class SourceState(str, Enum):
    """What a simulated rig does."""

    FAILED = 'failed'
    """It cannot go on until it is reset."""
    PAUSED = 'paused'
    STANDING = 'standing'
    """A wheel stands still on two spokes."""
    RUNNING = 'running'


class RecorderState(str, Enum):
    """What the recorder does."""

    FAILED = 'failed'
    """The last recording ended before it was told to."""
    RECORDING = 'recording'
    IDLE = 'idle'


class Diagnosis(NamedTuple):
    """One status: how bad, what it is, and the figures behind it."""

    level: Level
    message: str
    """For people; no program depends on its words."""
    values: Mapping[str, Value]
    """As they are; read back from `/diagnostics`, as text."""

    def state(self, kind: type[State]) -> State | None:
        """The state that the node is in; None where it says none of this kind."""
        try:
            return kind(self.values.get(STATE))
        except ValueError:
            return None

    def number(self, key: str) -> float:
        """The number under a key; NaN where there is none."""
        try:
            return float(self.values.get(key, math.nan))  # type: ignore[arg-type]
        except (TypeError, ValueError):
            return math.nan

    def flag(self, key: str) -> bool:
        """Whether the value under a key is true."""
        return value_text(self.values.get(key, False)) == 'true'


def contested(diagnosis: Diagnosis, topic: str, nodes: Sequence[str]) -> Diagnosis:
    """The same diagnosis where several nodes publish what only one should: a warning, unless it is worse already.

    Args:
        diagnosis: what there is to say besides.
        topic: what they publish.
        nodes: who they are; nobody, or one: all is well.

    """
    values = {**diagnosis.values, SOURCES: ', '.join(nodes) if len(nodes) > 1 else ''}
    if len(nodes) < 2:
        return diagnosis._replace(values=values)
    told = (
        f'{len(nodes)} nodes publish {topic}, where one should: {", ".join(dict.fromkeys(nodes))}; {diagnosis.message}'
    )
    return Diagnosis(max(diagnosis.level, Level.WARN), told, values)


def value_text(value: Value) -> str:
    """A value as `/diagnostics` carries it: what is not known is `nan`, so that every number reads as one."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Enum):
        return str(value.value)
    if isinstance(value, float):
        return f'{value:.6g}' if math.isfinite(value) else 'nan'
    return str(value)


NOTICEABLE = 0.05
"""So large a share of a second's samples that are missing is a warning."""


def lost_since(diagnosis: Diagnosis, before: float) -> Diagnosis:
    """The same with a warning where many samples have been lost since there were so many, a second ago."""
    lost, rate = (diagnosis.values.get(key, 0.0) for key in (LOST_SAMPLES, RATE_IN))
    if not (isinstance(lost, (int, float)) and isinstance(rate, (int, float)) and lost - before > NOTICEABLE * rate):
        return diagnosis
    count = lost - before
    were = by_count(count, 'was', 'were')
    message = f'{counted(f"{count:g}", "sample")} {were} lost within a second; {diagnosis.message}'
    return diagnosis._replace(level=max(diagnosis.level, Level.WARN), message=message)

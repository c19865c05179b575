"""How a node is, as plain data; what it says of itself on `/diagnostics`."""

from enum import IntEnum
from typing import NamedTuple


class Level(IntEnum):
    """The levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


class Diagnosis(NamedTuple):
    """One status: how bad, what it is, and the figures behind it."""

    level: Level
    message: str
    values: dict[str, str]

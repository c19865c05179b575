"""The subcommands of `dcdrw`: options and text."""

from typing import NamedTuple


class Command(NamedTuple):
    """One command: `add_arguments` of its module describes it and declares what it takes, `run` runs it."""

    module: str
    """Within this package."""
    help: str

"""Numbers and names in sentences."""

from collections.abc import Iterable


def counted(count: object, thing: str) -> str:
    """So many of a thing: `1 step`, `2 steps`, `37 to 38 steps`.

    Args:
        count: a whole number, or text that tells one.
        thing: the noun, in the singular; its plural ends in one more s.

    """
    return f'{count} {thing}{"" if str(count) == "1" else "s"}'


MOST_NAMED = 20
"""Things that one sentence names."""


def listed(names: Iterable[str], between: str = ', ') -> str:
    """Names one after the other, of many the first ones."""
    every = list(names)
    more = len(every) - MOST_NAMED
    return between.join([*every[:MOST_NAMED], *([f'{more} more'] if more > 0 else [])])


def by_count(count: float, one: str, more: str) -> str:
    """The words that go with so many: `is` or `are`."""
    return one if count == 1 else more


def names_and_positions(names: int, positions: int, thing: str = 'joint') -> str:
    """What is said of a message that names so many things, and gives another number of positions."""
    return f'{counted(names, f"{thing} name")} but {counted(positions, "position")} given'

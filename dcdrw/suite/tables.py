"""The reference's tables, from the declarations in the code.

`python -m dcdrw.suite.tables docs/reference.md` brings them up to date.
"""

import math
import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from dcdrw.suite.executables import EXECUTABLES
from dcdrw_msgs_py.quantity import Field, fields
from dcdrw_msgs_py.topics import Topic


def tables() -> dict[str, str]:
    """Every generated table in Markdown, by its marker's name."""
    topics = {topic.name: topic for node in EXECUTABLES for topic in (*node.subscribes, *node.publishes)}
    return {
        'executables': _table(
            ('executable', 'what it does', 'subscribes', 'publishes', 'services'),
            (
                (
                    f'`{node.name}`',
                    node.doc,
                    _names(node.subscribes),
                    _names(node.publishes),
                    ', '.join(f'`{service}`' for service in node.services),
                )
                for node in EXECUTABLES
            ),
        ),
        'topics': _table(
            ('topic', 'type', 'content', 'QoS'),
            ((f'`{topic.name}`', f'`{topic.type}`', topic.doc, _qos(topic)) for topic in topics.values()),
        ),
        **{
            f'parameters {node.name}': _table(
                ('parameter', 'default', 'unit', 'bounds', 'while it runs', 'meaning'),
                (_parameter(field) for params in node.parameters for field in fields(params)),
            )
            for node in EXECUTABLES
        },
    }


def updated(text: str) -> str:
    """A document with each table between `<!-- table: NAME -->` and `<!-- end -->` made anew.

    Raises:
        ValueError: a marker names no table, or a table has no marker.

    """
    made, seen = tables(), set()

    def replace(match: re.Match[str]) -> str:
        name = match[1]
        if name not in made:
            raise ValueError(f'no table is called {name}; there are {", ".join(made)}')
        seen.add(name)
        return f'<!-- table: {name} -->\n{made[name]}\n<!-- end -->'

    text = re.sub(r'<!-- table: (.+?) -->\n.*?<!-- end -->', replace, text, flags=re.DOTALL)
    if missing := set(made) - seen:
        raise ValueError(f'no place for the tables {", ".join(sorted(missing))}')
    return text


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ['---'] * len(head), *rows]
    return '\n'.join('| ' + ' | '.join(cell.replace('|', '\\|') for cell in line) + ' |' for line in lines)


def _names(topics: Iterable[Topic]) -> str:
    return ', '.join(f'`{topic.name}`' for topic in topics)


def _qos(topic: Topic) -> str:
    return f'reliable, depth {topic.depth}{", transient local" if topic.latched else ""}'


def _parameter(field: Field) -> tuple[str, ...]:
    quantity, shown = field.quantity, shown_default(field)
    if isinstance(field.default, str | tuple):
        shown = f'`{shown}`'
    live = 'changes' if quantity.live else 'fixed'
    return f'`{field.name}`', shown, quantity.unit, quantity.bounds, live, quantity.doc


def shown_default(field: Field) -> str:
    """The default of a parameter, or the rule by which it is derived."""
    default = field.default
    if isinstance(default, float):
        return field.quantity.derived if math.isnan(default) else f'{default:.6g}'
    if isinstance(default, bool):
        return str(default).lower()
    return str(list(default) if isinstance(default, tuple) else default)


def main() -> int:
    """Update the documents that are named."""
    for path in map(Path, sys.argv[1:]):
        path.write_text(updated(path.read_text(encoding='utf-8')), encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())

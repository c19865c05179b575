"""What `--help` of a node says: its declaration."""

import argparse
from collections.abc import Iterable, Iterator

from dcdrw.help_text import HelpFormatter
from dcdrw.suite.executables import EXECUTABLES, HOSTED, Executable
from dcdrw.suite.tables import shown_default
from dcdrw_msgs_py.quantity import Field, fields
from dcdrw_msgs_py.topics import Topic

ARGUMENTS = '--ros-args [--params-file FILE.yaml] [-p NAME:=VALUE]'


def show(name: str) -> int:
    """Print the help of a node, or of `suite`; returns the exit status."""
    node = next((node for node in EXECUTABLES if node.name == name), None)
    parser = argparse.ArgumentParser(
        usage=f'{name} {ARGUMENTS}' if node else f'{name} [NODE ...] {ARGUMENTS}',
        description=f'A ROS 2 node: {node.doc}.' if node else f'Nodes in one process, by default {", ".join(HOSTED)}.',
        epilog='\n'.join(_declared(node) if node else (f'  {node.name}  {node.doc}' for node in EXECUTABLES)),
        formatter_class=HelpFormatter,
        add_help=False,
    )
    parser.print_help()
    return 0


def _declared(node: Executable) -> Iterator[str]:
    yield from _topics('subscribes', node.subscribes)
    yield from _topics('publishes', node.publishes)
    if node.services:
        yield from ('services:', *(f'  {service}' for service in node.services), '')
    yield 'parameters:'
    for params in node.parameters:
        yield from map(_parameter, fields(params))


def _topics(heading: str, topics: Iterable[Topic]) -> Iterator[str]:
    if topics:
        yield from (f'{heading}:', *(f'  {topic.name}  {topic.type}: {topic.doc}' for topic in topics), '')


def _parameter(field: Field) -> str:
    limits = f' ({field.requirement})' if field.quantity.bounds or field.quantity.unit else ''
    return f'  {field.name}  {field.quantity.doc}{limits}; default {shown_default(field) or "empty"}'

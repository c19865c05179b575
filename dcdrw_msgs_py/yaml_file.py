"""YAML files, read and written as ROS nodes do: the one reader for rigs, cameras and the data beside recordings.

YAML 1.1 and 1.2 disagree on what is a number, and PyYAML on `1e-05`. Here a plain scalar is what ROS's own parser
(rcl_yaml_param_parser) takes it for: `35e-3`, `1e5` and `5.` are numbers, `1:30` and `2026-11-25` are text.
"""

import math
import re
from pathlib import Path
from typing import Any

import yaml

from dcdrw_msgs_py.text_file import read_text

MOST_VALUES = 100_000
"""Values and names that are read."""
DEEPEST = 64
"""Levels of nesting that are read."""

_TRUE = frozenset(('Y', 'y', 'yes', 'Yes', 'YES', 'true', 'True', 'TRUE', 'on', 'On', 'ON'))
_FALSE = frozenset(('N', 'n', 'no', 'No', 'NO', 'false', 'False', 'FALSE', 'off', 'Off', 'OFF'))
_NULL = frozenset(('', '~', 'null', 'Null', 'NULL'))
_INTEGER = re.compile(r'[-+]?(?:0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)')
_FLOAT = re.compile(r'[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[-+]?\.?inf|\.?nan|[-+]?infinity', re.I)
_TAG = 'tag:yaml.org,2002:'


def number(text: str) -> int | float | None:
    """The number that a plain scalar is, as C's strtol (base 0) and strtod read it; None where it is none."""
    if _INTEGER.fullmatch(text):
        digits = text.lstrip('+-')
        value = int(digits, 16 if digits[:2] in ('0x', '0X') else 8 if digits[0] == '0' else 10)
        value = -value if text[0] == '-' else value
        if -(2**63) <= value < 2**63:
            return value
        try:
            return float(value)
        except OverflowError:
            return math.inf if value > 0 else -math.inf
    if _FLOAT.fullmatch(text):
        return float(re.sub(r'\.(?=inf|nan)', '', text, flags=re.IGNORECASE))
    return None


class _Scalars:
    """Resolves plain scalars as ROS does."""

    def resolve(self, kind: Any, value: Any, implicit: Any) -> str:
        """The tag of a node that has none."""
        if kind is yaml.MappingNode:
            return f'{_TAG}map'
        if kind is yaml.SequenceNode:
            return f'{_TAG}seq'
        if not implicit[0]:
            return f'{_TAG}str'
        if value in _TRUE or value in _FALSE:
            return f'{_TAG}bool'
        if value in _NULL:
            return f'{_TAG}null'
        found = number(value)
        return f'{_TAG}str' if found is None else f'{_TAG}int' if isinstance(found, int) else f'{_TAG}float'


class _Loader(_Scalars, getattr(yaml, 'CSafeLoader', yaml.SafeLoader)):  # type: ignore[misc]
    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """Take names as text, `y` too; refuse one that stands twice: which of the two is meant nobody knows."""
        seen = set()
        for key, _ in node.value if isinstance(node, yaml.MappingNode) else ():  # else its tag lies, which is refused
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise ValueError(f'line {key.start_mark.line + 1} has {key.value} for the second time')
                seen.add(key.value)
                key.tag = f'{_TAG}str'
        return super().construct_mapping(node, deep)


class _Dumper(_Scalars, getattr(yaml, 'CSafeDumper', yaml.SafeDumper)):  # type: ignore[misc]
    def ignore_aliases(self, data: Any) -> bool:
        """Write every value where it stands: ROS reads no aliases."""
        return True


def _number(loader: Any, node: Any) -> int | float:
    found = number(loader.construct_scalar(node))
    if found is None:
        raise yaml.constructor.ConstructorError(None, None, f'{node.value!r} is not a number', node.start_mark)
    return found


def _truth(loader: Any, node: Any) -> bool:
    word = loader.construct_scalar(node)
    if word not in _TRUE | _FALSE:
        raise yaml.constructor.ConstructorError(None, None, f'{word!r} is not true or false', node.start_mark)
    return word in _TRUE


_Loader.add_constructor(f'{_TAG}int', _number)
_Loader.add_constructor(f'{_TAG}float', _number)
_Loader.add_constructor(f'{_TAG}bool', _truth)
_Loader.add_constructor(f'{_TAG}timestamp', _Loader.construct_yaml_str)  # as a plain one
_Loader.add_constructor(f'{_TAG}opencv-matrix', lambda loader, node: loader.construct_mapping(node, deep=True))
_Dumper.add_representer(float, lambda dumper, value: dumper.represent_scalar(f'{_TAG}float', _written(value)))


def _written(value: float) -> str:
    if math.isnan(value):
        return '.nan'
    if math.isinf(value):
        return '.inf' if value > 0.0 else '-.inf'
    text = repr(value)
    return text if '.' in text or 'e' not in text else text.replace('e', '.0e')


def read_yaml(path: Path) -> Any:
    """The content of a YAML file; one by OpenCV's FileStorage (`%YAML:1.0`, `!!opencv-matrix`) is one, too.

    Raises:
        ValueError: not YAML, too large, nested too deeply, or with aliases, which ROS nodes refuse; names the file.
        OSError: the file cannot be read.

    """
    text = read_text(path)
    try:
        return parse_yaml(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        tab = ' (a tab indents a line: use blanks)' if re.search(r'^ *\t', text, re.MULTILINE) else ''
        raise ValueError(f'{path} is not YAML: {" ".join(str(error).split())}{tab}') from None


def parse_yaml(text: str) -> Any:
    """The content of a YAML text.

    Raises:
        yaml.YAMLError, ValueError: as `read_yaml`, without the file's name.

    """
    if text.startswith('%YAML:'):  # OpenCV's own spelling of the directive
        text = text.partition('\n')[2]
    text = re.sub(r'^---\s*\Z', '', text, flags=re.MULTILINE)  # the end of a message, as `ros2 topic echo` shows it
    depth = 0
    for count, event in enumerate(yaml.parse(text, _Loader)):
        if count > MOST_VALUES:
            raise ValueError(f'it has more than {MOST_VALUES} values: is it the right file?')
        if isinstance(event, yaml.AliasEvent):
            raise ValueError(f'line {event.start_mark.line + 1} has the alias *{event.anchor}: write its value there')
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise ValueError(f'line {event.start_mark.line + 1} is nested more than {DEEPEST} levels deep')
    return yaml.load(text, _Loader)


def yaml_text(content: Any) -> str:
    """YAML that nodes read back as the same values."""
    return str(yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True))

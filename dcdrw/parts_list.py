"""Parts lists of springs and dashpots as people have them: any separator, decimal sign, case and unit."""

import csv
import math
import re
from collections import Counter
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import NamedTuple

from dcdrw_msgs_py.text_file import read_text
from dcdrw_sim.study.parts import DASHPOT, SPRING, Part

MOST_PAIRS = 20_000
"""That are judged in minutes."""
KINDS = {'spring': SPRING, 'dashpot': DASHPOT, 'damper': DASHPOT}
COLUMNS = {
    'kind': 'kind',
    'type': 'kind',
    'value': 'value',
    'rate': 'value',
    'constant': 'value',
    'name': 'name',
    'part': 'name',
    'part_number': 'name',
    'max_force': 'max_force',
    'max_stroke': 'max_stroke',
    'max_speed': 'max_speed',
}
"""Headings that are known, in lower case, and what they head."""
LIMITS = {'max_force': 'N', 'max_stroke': 'm', 'max_speed': 'm/s'}
"""Columns of rated limits, with the units that they have where none stands there."""
VALUES = {SPRING: 'N/m', DASHPOT: 'N·s/m'}
_POUND = 4.4482216152605
_UNITS = {
    'N': (1.0, 'force'),
    'kN': (1e3, 'force'),
    'lbf': (_POUND, 'force'),
    'lb': (_POUND, 'force'),
    'm': (1.0, 'length'),
    'cm': (1e-2, 'length'),
    'mm': (1e-3, 'length'),
    'in': (0.0254, 'length'),
    's': (1.0, 'time'),
}
"""Sizes in SI, and of what."""
_QUANTITY = re.compile(r'([-+]?[\d.,]*\d(?:[eE][-+]?\d+)?)\s*(.*)')


class PartsList(NamedTuple):
    """What a list offers."""

    parts: tuple[Part, ...] = ()
    skipped: tuple[str, ...] = ()
    """What was left out, a sentence each that names the line."""

    @property
    def pairs(self) -> int:
        """How many there are of a spring and a dashpot."""
        springs = sum(part.kind == SPRING for part in self.parts)
        return springs * (len(self.parts) - springs)


class _SkipError(Exception):
    """A row that is no use, and why."""


def read_parts(path: Path) -> PartsList:
    """Read a list of parts: a heading, then a row for each.

    Args:
        path: of a text in UTF-8 whose columns are separated by commas, semicolons or tabs. Its heading names `kind`
            (spring, dashpot or damper) and `value`, and may name `name`, `max_force`, `max_stroke` and `max_speed`.
            Units stand in the heading, as `value [N/mm]`, or in the cell, as `0.1 N·s/mm`; else they are SI.

    Raises:
        ValueError: it is no such list, or offers no spring or no dashpot.
        OSError: it cannot be read.

    """
    text = read_text(path)
    heading = text.lstrip().partition('\n')[0]
    separator = next((sign for sign in '\t;' if sign in heading), ',')
    parts, skipped = [], []
    rows = _rows(path, text, separator)
    _, names = next(rows, (0, []))
    columns = [_column(name) for name in names]
    if not {'kind', 'value'} <= {name for name, _ in columns}:
        raise ValueError(f'{path} must begin with the heading kind,value,name, got {heading[:80]!r}')
    decimal_comma = separator != ',' and re.search(r'\d,\d{1,2}(?!\d)|\d,\d{4}', text) is not None
    for line, row in rows:
        filled = row + [''] * len(columns)
        cells = {name: (cell, unit) for (name, unit), cell in zip(columns, filled, strict=False)}
        try:
            parts.append(_part(cells, decimal_comma))
        except _SkipError as reason:
            skipped.append(f'line {line}: {reason}')
    offer = PartsList(tuple(parts), tuple(skipped))
    for kind in (SPRING, DASHPOT):
        if not any(part.kind == kind for part in parts):
            raise ValueError('; '.join([f'{path} has no {kind} that can be used', *skipped[:3]]))
    if offer.pairs > MOST_PAIRS:
        raise ValueError(f'{path} makes more than {MOST_PAIRS} pairs: leave out what is out of the question')
    return offer


def _rows(path: Path, text: str, separator: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader(StringIO(text, newline=''), delimiter=separator)
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                yield reader.line_num, row
    except csv.Error as error:
        raise ValueError(f'{path}, line {reader.line_num}: {error}') from None


def _column(heading: str) -> tuple[str, str]:
    """What a heading is of, by its name in `Part`, and the unit that stands in it."""
    parts = re.split(r'[\[(]', heading.strip(), maxsplit=1)
    return COLUMNS.get('_'.join(parts[0].lower().split()), ''), parts[1][:-1] if len(parts) > 1 else ''


def _part(cells: dict[str, tuple[str, str]], decimal_comma: bool) -> Part:
    kind = KINDS.get(cells['kind'][0].strip().lower())
    if kind is None:
        raise _SkipError(f'kind must be {", ".join(KINDS)}, got {cells["kind"][0]!r}')
    value = _quantity('value', *cells['value'], VALUES[kind], decimal_comma)
    limits = {
        name: _quantity(name, *cells[name], unit, decimal_comma)
        for name, unit in LIMITS.items()
        if cells.get(name, ('', ''))[0].strip()
    }
    return Part(kind, value, cells.get('name', ('', ''))[0].strip(), **limits)


def _quantity(name: str, cell: str, unit: str, wanted: str, decimal_comma: bool) -> float:
    """What a cell says in the unit that is wanted."""
    if not (match := _QUANTITY.fullmatch(cell.strip())):
        raise _SkipError(f'{name} must be a number > 0, got {cell!r}')
    number, own = match.groups()
    value = _number(number, decimal_comma) * _factor(own or unit or wanted, wanted)
    if not 0.0 < value < math.inf:
        raise _SkipError(f'{name} must be a number > 0, got {cell!r}')
    return value


def _number(text: str, decimal_comma: bool) -> float:
    """A number with a decimal point or comma, which the last sign of two kinds is."""
    if ',' in text and '.' in text:
        thousands, sign = (',', '.') if text.rindex(',') < text.rindex('.') else ('.', ',')
        text = text.replace(thousands, '').replace(sign, '.')
    elif text.count(',') == 1:
        whole, _, rest = text.partition(',')
        if re.fullmatch(r'[-+]?[1-9]\d{0,2}', whole) and re.fullmatch(r'\d{3}', rest) and not decimal_comma:
            raise _SkipError(f'{text} may be {whole}.{rest} or {whole}{rest}: write one of them')
        text = f'{whole}.{rest}'
    else:
        text = text.replace(',', '')
    try:
        return float(text)
    except ValueError:
        raise _SkipError(f'{text!r} is not a number') from None


def _factor(unit: str, wanted: str) -> float:
    """By what to multiply a value in a unit, to have it in SI."""
    size, dimensions = _measure(unit)
    if dimensions != _measure(wanted)[1]:
        raise _SkipError(f'{unit!r} is not a unit like {wanted}')
    return size


def _measure(unit: str) -> tuple[float, Counter[str]]:
    """The size of a unit in SI, and the powers of force, length and time in it."""
    plain = re.sub(r'/\s*\((\w+)\s*/\s*(\w+)\s*\)', r' \2/\1', unit)  # N/(m/s) is N s/m
    plain = re.sub(r'[·⋅×*.-]', ' ', plain).replace('Ns', 'N s')
    size, dimensions, sign = 1.0, Counter[str](), 1
    for token in re.findall(r'[A-Za-z]+|\S', plain):
        if token == '/':
            sign = -1
        elif token in _UNITS:
            of_one, dimension = _UNITS[token]
            size *= of_one**sign
            dimensions[dimension] += sign
        else:
            raise _SkipError(f'{unit!r} is not a unit like N/m')
    return size, Counter({key: power for key, power in dimensions.items() if power})

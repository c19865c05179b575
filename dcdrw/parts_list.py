"""Parts lists of springs and dashpots as people have them: any separator, decimal sign, case and unit."""

import math
import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from dcdrw_msgs_py.text_file import csv_rows, one_line, read_text
from dcdrw_sim.study.parts import DASHPOT, SPRING, Part

MOST_PAIRS = 20_000
"""That are judged in minutes."""
KINDS = {
    **dict.fromkeys(('spring', 'feder'), SPRING),
    **dict.fromkeys(('dashpot', 'damper', 'absorber', 'dämpfer', 'daempfer'), DASHPOT),
}
"""Words within what a kind is called."""
OTHERS = 'gas', 'torsion'
"""Words for springs whose force is not a stiffness times a length."""
COLUMNS = {
    **dict.fromkeys(('kind', 'type', 'typ', 'art'), 'kind'),
    **dict.fromkeys(('value', 'rate', 'constant', 'wert'), 'value'),
    **dict.fromkeys(('stiffness', 'spring_rate', 'k', 'federrate', 'steifigkeit'), SPRING),
    **dict.fromkeys(('damping', 'b', 'c', 'dämpfung', 'daempfung'), DASHPOT),
    **dict.fromkeys(('unit', 'units', 'einheit'), 'unit'),
    **dict.fromkeys(('name', 'part', 'part_number', 'bezeichnung', 'artikel'), 'name'),
    **dict.fromkeys(('max_force', 'maximum_force', 'max_kraft'), 'max_force'),
    **dict.fromkeys(('max_stroke', 'maximum_stroke', 'stroke', 'travel', 'hub'), 'max_stroke'),
    **dict.fromkeys(('free_length', 'l0'), 'free_length'),
    **dict.fromkeys(('max_speed', 'maximum_speed', 'max_velocity'), 'max_speed'),
}
"""Headings that are known, in lower case, and what they head; one of a kind heads values of that kind."""
SEPARATORS = '\t;|,'
FIRST_LINES = 20
"""The heading is sought in so many lines: lists begin with titles and remarks."""
MORE = {'max_force': 'N', 'max_stroke': 'm', 'max_speed': 'm/s', 'free_length': 'm'}
"""Other columns of numbers, with the units that they have where none stands there."""
VALUES = {SPRING: 'N/m', DASHPOT: 'N·s/m'}
LONGEST = 10.0
"""No part is longer [m]: a larger number without a unit is of another."""
_POUND = 4.4482216152605
_WEIGHT = 9.80665
_FORCE = {'mass': 1, 'length': 1, 'time': -2}
_UNITS = {
    **dict.fromkeys(('N', 'Newton', 'newton'), (1.0, _FORCE)),
    'kN': (1e3, _FORCE),
    'daN': (10.0, _FORCE),
    'mN': (1e-3, _FORCE),
    'kgf': (_WEIGHT, _FORCE),
    'gf': (1e-3 * _WEIGHT, _FORCE),
    **dict.fromkeys(('lbf', 'lb', 'lbs'), (_POUND, _FORCE)),
    'kg': (1.0, {'mass': 1}),
    'm': (1.0, {'length': 1}),
    'cm': (1e-2, {'length': 1}),
    'mm': (1e-3, {'length': 1}),
    **dict.fromkeys(('in', 'inch'), (0.0254, {'length': 1})),
    'ft': (0.3048, {'length': 1}),
    **dict.fromkeys(('s', 'sec'), (1.0, {'time': 1})),
}
"""Sizes in SI, and powers of what."""
_THOUSANDS = " \u00a0\u202f'’"
_QUANTITY = re.compile(
    rf'[~≈]?\s*([-+]?(?:\d{{1,3}}(?:[{_THOUSANDS}]\d{{3}})+(?:[.,]\d+)?|[\d.,]*\d(?:[eE][-+]?\d+)?))(?!\d)\s*(.*)'
)
_RANGE = re.compile(r'(?:[-–—]|\.\.+|…|to|bis)\s*\d.*')
_ASIDE = re.compile(r'(?:±|\+/-)\s*[\d.,]+\s*%?|\s\(.*\)$')
"""Tolerances and remarks behind a number."""


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
        path: of a text whose columns are separated by commas, semicolons, tabs or bars. Its heading names `kind`
            (spring, dashpot or damper) and `value`, or `stiffness` and `damping`, and may name `name`, `max_force`,
            `max_stroke`, `max_speed` and `free_length`. Units stand in the heading, as `value [N/mm]`, in a column
            `unit`, or in the cell, as `0.1 N·s/mm`; else they are SI.

    Raises:
        ValueError: it is no such list, or offers no spring or no dashpot.
        OSError: it cannot be read.

    """
    text = read_text(path, windows=True)
    if text.startswith('PK\x03\x04'):
        raise ValueError(f'{path} is a workbook: save its sheet as CSV')
    lines = text.splitlines(keepends=True)
    first, separator = _heading(path, lines)
    parts: dict[Part, int] = {}
    rows = csv_rows(path, ''.join(lines[first:]), separator)
    _, names = next(rows)
    columns = [_column(name) for name in names]
    skipped = [
        f'column {name.strip()!r}: not known'
        for name, (column, _) in zip(names, columns, strict=True)
        if name.strip() and not column
    ]
    for column, count in Counter(column for column, _ in columns).items():
        if column and count > 1:
            raise ValueError(f'{path} has {count} columns of {column}: leave one')
    decimal_comma = separator != ',' and re.search(r'\d,\d{1,2}(?!\d)|\d,\d{4}', text) is not None
    for number, row in rows:
        line = first + number
        if not parts and _are_units(row):
            raise ValueError(f'{path}, line {line}: units belong into the heading, as value [{VALUES[SPRING]}]')
        filled = row + [''] * len(columns)
        cells = {name: (cell, unit) for (name, unit), cell in zip(columns, filled, strict=False)}
        try:
            if any(cell.strip() for cell in row[len(columns) :]):
                raise _SkipError(f'more cells than the heading has: is {separator!r} within a number or a name?')
            part = _part(cells, decimal_comma)
            if part in parts:
                raise _SkipError(f'the same part as in line {parts[part]}')
            parts[part] = line
        except _SkipError as reason:
            skipped.append(f'line {line}: {reason}')
    offer = PartsList(tuple(parts), tuple(skipped))
    for kind in (SPRING, DASHPOT):
        if not any(part.kind == kind for part in parts):
            raise ValueError('; '.join([f'{path} has no {kind} that can be used', *skipped[:3]]))
    if offer.pairs > MOST_PAIRS:
        raise ValueError(f'{path} makes more than {MOST_PAIRS} pairs: leave out what is out of the question')
    return offer


def _heading(path: Path, lines: list[str]) -> tuple[int, str]:
    """The number of lines before the heading, and the separator of columns."""
    for number, line in enumerate(lines[:FIRST_LINES]):
        for separator in SEPARATORS:
            names = {_column(name)[0] for name in line.split(separator)}
            if 'kind' in names and names & {'value', *VALUES}:
                return number, separator
    begins = next((line.strip() for line in lines if line.strip()), '')
    raise ValueError(f'{path} must begin with the heading kind,value,name, got {begins[:80]!r}')


def _column(heading: str) -> tuple[str, str]:
    """What a heading is of, and the unit that stands in it, in brackets or not."""
    words = re.sub(r'[\[(_,]', lambda sign: f' {sign[0].strip("_,")}', heading.strip('"\ufeff \r\n')).split()
    for count in range(len(words), 0, -1):
        if column := COLUMNS.get('_'.join(words[:count]).lower().rstrip(':')):
            unit = ' '.join(words[count:]).removeprefix('in ')
            return column, unit[1:-1].strip() if unit[:1] in ('[', '(') else unit
    return '', ''


def _are_units(row: list[str]) -> bool:
    """Whether nothing but units stands in a row."""
    units = [unit for cell in row if (unit := cell.strip(' []()-'))]
    try:
        return bool(units) and all(_measure(unit)[1] for unit in units)
    except _SkipError:
        return False


def _part(cells: dict[str, tuple[str, str]], decimal_comma: bool) -> Part:
    called = cells['kind'][0].strip().lower()
    kinds = {kind for word, kind in KINDS.items() if word in called}
    if len(kinds) != 1:
        raise _SkipError(f'kind must be spring, dashpot or damper, got {cells["kind"][0]!r}')
    if any(word in called for word in OTHERS):
        raise _SkipError(f'a {called} has no stiffness in N/m')
    (kind,) = kinds
    cell, unit = cells[kind] if cells.get(kind, ('', ''))[0].strip() else cells.get('value', ('', ''))
    unit = cells.get('unit', ('', ''))[0].strip() or unit
    value = _quantity('value', cell, unit, VALUES[kind], decimal_comma)
    more = {
        name: _quantity(name, *cells[name], unit, decimal_comma)
        for name, unit in MORE.items()
        if cells.get(name, ('', ''))[0].strip()
    }
    return Part(kind, value, one_line(cells.get('name', ('', ''))[0].strip()), **more)


def _quantity(name: str, cell: str, unit: str, wanted: str, decimal_comma: bool) -> float:
    """What a cell says in the unit that is wanted."""
    if not (match := _QUANTITY.fullmatch(cell.strip())):
        raise _SkipError(f'{name} must be a number > 0, got {cell!r}')
    number, own = match.groups()
    if _RANGE.match(own):
        raise _SkipError(f'{name} {cell.strip()!r} is a range: write what it is set to')
    own = _ASIDE.sub('', own).strip()
    value = _number(number, decimal_comma) * _factor(own or unit or wanted, wanted)
    if not 0.0 < value < math.inf:
        raise _SkipError(f'{name} must be a number > 0, got {cell!r}')
    if wanted == 'm' and not (own or unit) and value > LONGEST:
        raise _SkipError(f'{name} would be {value:g} m: write its unit')
    return value


def _number(text: str, decimal_comma: bool) -> float:
    """A number with a decimal point or comma, which the last sign of two kinds is."""
    text = re.sub(f'[{_THOUSANDS}]', '', text)
    if ',' in text and '.' in text:
        thousands, sign = (',', '.') if text.rindex(',') < text.rindex('.') else ('.', ',')
        text = text.replace(thousands, '').replace(sign, '.')
    elif re.fullmatch(r'[-+]?[1-9]\d{0,2}[.,]\d{3}', text) and (',' in text) != decimal_comma:
        whole, rest = re.split('[.,]', text)
        point = ',' if decimal_comma else '.'
        raise _SkipError(f'{text} may be {whole}{point}{rest} or {whole}{rest}: write one of them')
    elif text.count(',') == 1:
        text = text.replace(',', '.')
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
    """The size of a unit in SI, and the powers of mass, length and time in it."""
    plain = re.sub(r'/\s*\((\w+)\s*/\s*(\w+)\s*\)', r' \2/\1', unit)  # N/(m/s) is N s/m
    plain = re.sub(r'([A-Za-z]+)\s*(?:\^-1|⁻¹)', r'/\1', plain)
    plain = re.sub(r'[·⋅×*.-]', ' ', plain).replace('Ns', 'N s')
    size, dimensions, sign = 1.0, Counter[str](), 1
    for token in re.findall(r'[A-Za-z]+|\S', plain):
        if token == '/':
            sign = -1
        elif token in _UNITS:
            of_one, powers = _UNITS[token]
            size *= of_one**sign
            for dimension, power in powers.items():
                dimensions[dimension] += sign * power
        else:
            raise _SkipError(f'{unit!r} is not a unit like N/m')
    return size, Counter({key: power for key, power in dimensions.items() if power})

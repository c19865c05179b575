"""Quantities: every parameter's default, unit, bounds and meaning, declared once.

A parameter set is a ``NamedTuple`` whose fields are ``Annotated[type, Quantity(...)]``; a field that is
itself such a tuple is a group, and its fields get dotted names (``front.length``). Nodes, command line,
YAML files and the tables of the docs are all read from these declarations.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

from dcdrw_msgs_py.yaml_file import number, parse_yaml

Params = TypeVar('Params', bound=tuple[Any, ...])


class Quantity(NamedTuple):
    """What a parameter means and which values it may take."""

    doc: str
    unit: str = ''
    low: float = -math.inf
    """Smallest value allowed."""
    high: float = math.inf
    """Largest value allowed."""
    above: float = -math.inf
    """Exclusive lower bound."""
    derived: str = ''
    """Where the default NaN stands for a value derived from others: the rule."""
    live: bool = False
    """May change while a node runs."""
    choices: tuple[Any, ...] = ()
    """The only values allowed; empty where the bounds say all."""

    @property
    def bounds(self) -> str:
        """The allowed values in words; empty where every finite value is allowed."""
        if self.choices:
            return ' or '.join(map(str, self.choices))
        parts = []
        if self.above > -math.inf:
            parts.append(f'> {self.above:g}')
        if self.low > -math.inf:
            parts.append(f'≥ {self.low:g}')
        if self.high < math.inf:
            parts.append(f'≤ {self.high:g}')
        return ', '.join(parts)

    def allows(self, value: float) -> bool:
        """Whether a number is finite and within the bounds (NaN only where a default is derived)."""
        if math.isnan(value):
            return bool(self.derived)
        return math.isfinite(value) and value > self.above and self.low <= value <= self.high


class Field(NamedTuple):
    """One parameter of a set, by its dotted name."""

    name: str
    kind: Any
    """`int`, `float`, `bool`, `str`, or `tuple[int, ...]` and the like: a list of any length."""
    default: Any
    quantity: Quantity

    def coerce(self, value: Any) -> Any:
        """The value as this field's type.

        Raises:
            ValueError: the value is of another type or out of bounds.

        """
        if get_origin(self.kind) is tuple:
            value = () if value is None else value  # ROS reads an empty list in YAML as nothing
            if isinstance(value, str) or not isinstance(value, Iterable):
                raise ValueError(f'{self.name} must be a list, got {value!r}')
            one = self._replace(kind=get_args(self.kind)[0])
            return tuple(one._replace(name=f'{self.name}[{i}]').coerce(item) for i, item in enumerate(value))
        value = self._read(value)
        if self.kind in (int, float) and isinstance(value, (int, float)) and not isinstance(value, bool):
            if not self.quantity.allows(_as_float(value)):
                raise ValueError(f'{self.name} must be {self.requirement}, got {value!r}{self._question(value)}')
            if self.kind is int and value != int(value):
                raise ValueError(f'{self.name} must be a whole number, got {value!r}')
            if self.kind is int and not -(2**63) <= int(value) < 2**63:
                raise ValueError(f'{self.name} must be a whole number of 64 bits, as ROS has them, got {value!r}')
            return self._chosen(self.kind(value))
        if self.kind in (bool, str) and isinstance(value, self.kind):
            return self._chosen(value)
        plain = value.replace('_', '').replace(',', '.') if isinstance(value, str) and self.kind in (int, float) else ''
        mend = f': write {plain}' if number(plain) is not None else ''
        raise ValueError(f'{self.name} must be {_KIND_NAMES[self.kind]}, got {value!r}{mend}')

    def _read(self, value: Any) -> Any:
        """What was meant, where ROS or `ros2 param` takes it for something else."""
        if self.kind is float and isinstance(value, str):  # nan, 1e-05, 0.2%
            found = number(value.removesuffix('%') if self.quantity.unit.startswith('%') else value)
            return value if found is None else found
        if self.kind is str and isinstance(value, bool):  # off
            return next((word for word in self.quantity.choices if parse_yaml(word) is value), value)
        if self.kind is str and isinstance(value, int):  # a camera's name may be 0
            return str(value)
        return value

    def _chosen(self, value: Any) -> Any:
        if self.quantity.choices and value not in self.quantity.choices:
            raise ValueError(f'{self.name} must be {self.quantity.bounds}, got {value!r}')
        return value

    def _question(self, value: float) -> str:
        """Whether an impossible value was meant in another unit; below 1 an angle looks like radians."""
        unit, found = self.quantity.unit, _as_float(value)
        if not math.isfinite(found) or (unit == 'rad' and abs(found) < 1.0):
            return ''
        meant = [
            f'{name}? {found:g}{sign} is {found * size:.6g} {unit}'
            for name, sign, size in _MISTAKEN.get(unit, ())
            if self.quantity.allows(found * size)
        ]
        return f': {"; ".join(meant)}' if meant else ''

    @property
    def requirement(self) -> str:
        """The bounds with their unit, for messages."""
        return ' '.join(filter(None, (self.quantity.bounds or 'finite', self.quantity.unit)))


def _as_float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:  # an integer beyond any double
        return math.inf


_MISTAKEN = {
    'rad': (('degrees', '°', math.radians(1.0)),),
    'rad/s': (('degrees per second', '°/s', math.radians(1.0)),),
    'm': (('millimetres', ' mm', 1e-3), ('centimetres', ' cm', 1e-2)),
    'kg': (('grams', ' g', 1e-3),),
    's': (('milliseconds', ' ms', 1e-3),),
}
"""Units that are mistaken for the one in SI: name, sign and size."""
_KIND_NAMES: dict[type, str] = {int: 'a whole number', float: 'a number', bool: 'true or false', str: 'a string'}


def fields(params: type[tuple[Any, ...]], prefix: str = '') -> Iterator[Field]:
    """Yield every parameter of a set, groups flattened, in the order of declaration."""
    defaults = params._field_defaults  # type: ignore[attr-defined]
    for name, hint in get_type_hints(params, include_extras=True).items():
        if name not in defaults:
            continue
        if get_origin(hint) is Annotated:
            kind, quantity = get_args(hint)
            yield Field(prefix + name, kind, defaults[name], quantity)
        else:
            for inner in fields(hint, f'{prefix}{name}.'):
                group_default = inner.name.removeprefix(f'{prefix}{name}.')
                yield inner._replace(default=lookup(defaults[name], group_default))


def lookup(params: tuple[Any, ...], name: str) -> Any:
    """The value of a dotted name in a parameter set."""
    value: Any = params
    for part in name.split('.'):
        value = getattr(value, part)
    return value


def suggestion(name: object, known: Iterable[str]) -> str:
    """The end of a message on a name that is unknown: the nearest that are known, or all."""
    names, word = list(known), str(name).lower()
    near = [one for one in names if one.lower() == word or one.rpartition('.')[2] == word]  # mass: of either wheel
    near = near or get_close_matches(str(name), names, n=1)
    return f'; did you mean {" and ".join(near)}?' if near else f'; known are {", ".join(names)}'


def build(params: type[Params], values: Mapping[str, Any], source: str = '') -> Params:
    """Make a parameter set from dotted names; what is absent takes its default.

    Raises:
        ValueError: an unknown name, a wrong type or a value out of bounds; `source` (a file's name, say)
            is added to the message.

    """
    where = f' ({source})' if source else ''
    known = {field.name: field for field in fields(params)}
    for name in values:
        if name not in known:
            raise ValueError(f'{name} is not a parameter{where}{suggestion(name, known)}')
    try:
        flat = {name: field.coerce(values.get(name, field.default)) for name, field in known.items()}
    except ValueError as error:
        raise ValueError(f'{error}{where}') from None
    return _nest(params, flat, '')


def _nest(params: type[Params], flat: Mapping[str, Any], prefix: str) -> Params:
    values = {}
    for name, hint in get_type_hints(params, include_extras=True).items():
        if get_origin(hint) is Annotated:
            values[name] = flat[prefix + name]
        elif name in params._fields:  # type: ignore[attr-defined]
            values[name] = _nest(hint, flat, f'{prefix}{name}.')
    return params(**values)


def flatten(params: tuple[Any, ...]) -> dict[str, Any]:
    """Every parameter's value by its dotted name: the inverse of `build`."""
    return {field.name: lookup(params, field.name) for field in fields(type(params))}


def check(params: Params, source: str = '') -> Params:
    """Return the same set with each value checked and made its declared type.

    Raises:
        ValueError: as `build`.

    """
    return build(type(params), flatten(params), source)

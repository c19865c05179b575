"""Rig files: ROS 2 parameter files, so that one file serves the command line and every node."""

import argparse
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar, get_args

import numpy as np

from dcdrw.console import count, degrees, number, part_of_one
from dcdrw.suite.executables import EXECUTABLES
from dcdrw_msgs_py.quantity import Field, Quantity, build, fields, flatten, suggestion
from dcdrw_msgs_py.rig import RigParams, WheelPitch, WheelShape
from dcdrw_msgs_py.text_file import one_line
from dcdrw_msgs_py.yaml_file import read_yaml, yaml_text
from dcdrw_sim.identification.unknowns import Uncertainty, names_of_unknowns
from dcdrw_sim.model.presets import PRESETS
from dcdrw_sim.rig.simulator import SimulatorParams
from dcdrw_tracker.gait.phase import PhaseParams
from dcdrw_tracker.gait.sync import SyncParams

_EVERY_NODE = '/**'
_EVERY = ('**', '*')
"""In place of a node's name, or of a namespace: any, of as many names as may be, or of one."""
_PARAMETERS = 'ros__parameters'
_OF_ROS = ('use_sim_time',)
_PHASE = 'initial_phase_percent'
_UNCERTAINTY = 'uncertainty'
"""The section that tells how well a rig is known: to ROS the parameters of a node that nobody starts."""
_ERRORS, _CORRELATIONS = 'standard_errors', 'correlations'
_NODES_OF = {
    kind: [node.name for node in EXECUTABLES if kind in node.parameters]
    for each in EXECUTABLES
    for kind in each.parameters
}
_NODES = tuple(dict.fromkeys(name for names in _NODES_OF.values() for name in names))
Sets = TypeVar('Sets', bound=tuple[Any, ...])


class TrialParams(NamedTuple):
    """The parameters of all nodes of a trial."""

    rig: RigParams = RigParams()
    simulator: SimulatorParams = SimulatorParams()
    phase: PhaseParams = PhaseParams()
    sync: SyncParams = SyncParams()

    @classmethod
    def of_rig(cls, rig: RigParams) -> 'TrialParams':
        """A rig, and trackers that know its wheels."""
        front, rear = rig.front, rig.rear
        return cls(
            rig,
            phase=PhaseParams(WheelShape(front.length, front.spokes), WheelShape(rear.length, rear.spokes)),
            sync=SyncParams(WheelPitch(front.spokes), WheelPitch(rear.spokes)),
        )


def read_parameter_file(path: Path, base: Sets, namespace: str = '') -> Sets:
    """Read a parameter file as the nodes will; what it does not name is as in `base`.

    Args:
        path: the file.
        base: parameter sets by name, as `TrialParams`; each must be an executable's.
        namespace: of the nodes, where the file has those of several suites.

    Raises:
        ValueError: not YAML, not a parameter file, an unknown or impossible parameter: named with the file.
        OSError: the file cannot be read.

    """
    content = _read(path)
    _uncertainty(content, path)
    sections = {section: _parameters(tree, section, path) for section, tree in content.items()}
    space = _namespace(sections, path, namespace)
    kinds = {name: type(values) for name, values in zip(base._fields, base, strict=True)}  # type: ignore[attr-defined]
    all_names = {field.name for kind in _NODES_OF for field in fields(kind)}.union(_OF_ROS)
    sets: dict[str, Any] = {}
    for name, kind in kinds.items():
        mine = {field.name for field in fields(kind)}
        values: dict[str, Any] = {}
        for section, its in sections.items():
            if any(_is_for(section, node, space) for node in _NODES_OF[kind]):
                values |= its
        chosen = {key: value for key, value in values.items() if key in mine or key not in all_names}
        sets[name] = build(kind, flatten(getattr(base, name)) | chosen, str(path))
        if _PHASE in chosen and (question := part_of_one(getattr(sets[name], _PHASE), str(chosen[_PHASE]))):
            raise ValueError(f'{_PHASE} {question} ({path})')
    return type(base)(**sets)


def read_uncertainty(path: Path) -> Uncertainty | None:
    """How well a parameter file says that its rig is known; None where it says nothing.

    Raises:
        ValueError, OSError: as `read_parameter_file`.

    """
    return _uncertainty(_read(path), path)


def _read(path: Path) -> dict[str, Any]:
    content = read_yaml(path)
    sections: dict[str, Any] = {}
    for name, tree in _nested(content):
        if tree is None or name in sections:
            raise ValueError(
                f'{path} has {one_line(name)} twice'
                if name in sections
                else f'{path} is not a parameter file: it must have the form of config/rig.yaml, '
                f'"{_EVERY_NODE}:", "{_PARAMETERS}:", then the parameters'
            )
        sections[name] = tree
    return sections


def _nested(content: Any, prefix: str = '') -> Iterator[tuple[str, Any]]:
    """Sections by their names, also those within the namespaces of nodes; None where something else stands there."""
    if not isinstance(content, dict) or not content:
        yield prefix, None
        return
    for name, tree in content.items():
        if _is_section(tree):
            yield f'{prefix}{name}', tree
        else:
            yield from _nested(tree, f'{prefix}{name}/')


def _uncertainty(content: Mapping[str, Any], path: Path) -> Uncertainty | None:
    """The section on uncertainty; correlations of each parameter are with those before it."""
    if _UNCERTAINTY not in content:
        return None
    told: dict[str, dict[str, Any]] = {_ERRORS: {}, _CORRELATIONS: {}}
    for key, value in _flatten(content[_UNCERTAINTY][_PARAMETERS] or {}):
        kind, _, name = key.partition('.')
        if kind not in told:
            raise ValueError(f'{path}: {_UNCERTAINTY} has {key}{suggestion(kind, told)}')
        told[kind][name] = value
    where = f'{_UNCERTAINTY} in {path}'
    error = Annotated[float, Quantity('standard error', low=0.0)]
    errors = {name: _coerced(error, name, value, where) for name, value in told[_ERRORS].items()}
    for name in errors:
        if name not in names_of_unknowns():
            raise ValueError(f'{where}: {name} is nothing that can be uncertain{suggestion(name, names_of_unknowns())}')
    names, correlations = list(errors), np.eye(len(errors))
    part = Annotated[tuple[float, ...], Quantity('correlations', low=-1.0, high=1.0)]
    for name, values in told[_CORRELATIONS].items():
        row = _coerced(part, name, values, where)
        place = names.index(name) if name in names else -1
        if len(row) != place:
            raise ValueError(f'{where}: {name} must have a standard error, and correlations with all before it')
        correlations[place, :place] = correlations[:place, place] = row
    if len(names) and np.linalg.eigvalsh(correlations)[0] < -1e-6:
        raise ValueError(f'{where}: no errors can be correlated as these')
    return Uncertainty(errors, correlations)


def _coerced(hint: Any, name: str, value: Any, where: str) -> Any:
    kind, quantity = get_args(hint)
    try:
        return Field(name, kind, None, quantity).coerce(value)
    except ValueError as error:
        raise ValueError(f'{error} ({where})') from None


def _parameters(section: Mapping[str, Any], name: str, path: Path) -> dict[str, Any]:
    """The parameters of a section, by dotted names."""
    own: dict[str, Any] = {}
    for key, value in _flatten(section[_PARAMETERS] or {}):
        if key in own:
            raise ValueError(f'{path} has {one_line(key)} twice (for {one_line(name)})')
        own[key] = value
    return own


def _namespace(sections: Iterable[str], path: Path, namespace: str) -> str:
    """The namespace whose parameters are read: the one asked for, or the only one that there is.

    Raises:
        ValueError: a section is of no node; there are several namespaces, and that asked for is none of them.

    """
    asked, spaces, is_there = namespace.strip('/'), set(), False
    for section in sections:
        if section == _UNCERTAINTY:
            continue
        space, _, node = section.strip('/').rpartition('/')
        if node not in (*_EVERY, *_NODES):
            known = (_EVERY_NODE, *_NODES)
            raise ValueError(
                f'{path} has parameters for {one_line(section)}, which no trial has{suggestion(one_line(node), known)}'
            )
        if space and '*' not in space:
            spaces.add(space)
        if space:
            is_there |= any(_is_for(section, name, asked) for name in _NODES)
    if is_there or not spaces:
        return asked
    if len(spaces) > 1:
        choice = ' or '.join(f'/{one_line(space)}' for space in sorted(spaces))
        raise ValueError(f'{path} has parameters of several suites: choose one with --namespace {choice}')
    return spaces.pop()


def _is_for(section: str, node: str, namespace: str) -> bool:
    """Whether a section is for a node, as ROS has it; a name without a namespace is here for that node in any."""
    parts, names = section.strip('/').split('/'), [*filter(None, namespace.split('/')), node]
    if parts == [node]:
        return True
    places = {0}  # in the node's name, up to which the section's may reach so far
    for part in parts:
        if part == '**':
            places = set(range(min(places, default=len(names) + 1), len(names) + 1))
        else:
            places = {place + 1 for place in places if place < len(names) and part in ('*', names[place])}
    return len(names) in places


class RigOption(NamedTuple):
    """An option that stands for parameters of a rig."""

    parameters: tuple[str, ...]
    read: Callable[[str], Any]
    unit: str
    help: str
    scale: float = 1.0
    """Factor from the option's unit to the parameter's."""


RIG_OPTIONS = {
    '--k': RigOption(('k',), number, 'N/m', 'stiffness of the coupler'),
    '--b': RigOption(('b',), number, 'N·s/m', 'damping of the coupler'),
    '--slope-deg': RigOption(('slope',), degrees, 'DEG', 'slope, downhill', math.radians(1.0)),
    '--mass': RigOption(('front.mass', 'rear.mass'), number, 'KG', 'of each wheel'),
    '--length': RigOption(('front.length', 'rear.length'), number, 'M', 'of each wheel, hub to foot'),
    '--spokes': RigOption(('front.spokes', 'rear.spokes'), count, 'N', 'of each wheel'),
}


def add_rig_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that choose a rig."""
    presets = '; '.join(f'{name}, {preset.doc}' for name, preset in PRESETS.items())
    group = parser.add_argument_group('the rig', 'A preset, then what a file changes, then what an option does.')
    group.add_argument('--preset', choices=PRESETS, default='paper', metavar='NAME', help=f'{presets} (default: paper)')
    group.add_argument(
        '--rig', type=Path, metavar='FILE.yaml', help='a ROS 2 parameter file, as config/rig.yaml; all may be left out'
    )
    for name, option in RIG_OPTIONS.items():
        group.add_argument(name, type=option.read, metavar=option.unit, help=option.help)


def with_rig_options(options: argparse.Namespace, base: Sets) -> Sets:
    """Parameter sets as --rig and the options of a rig change them.

    Raises:
        ValueError, OSError: as `read_parameter_file`.

    """
    if options.rig:
        base = read_parameter_file(options.rig, base)
    changed: dict[str, Any] = {}
    for name, values in zip(base._fields, base, strict=True):  # type: ignore[attr-defined]
        flat = changed[name] = flatten(values)
        for text, option in RIG_OPTIONS.items():
            value = getattr(options, text.strip('-').replace('-', '_'))
            mine = set(option.parameters) & flat.keys()
            if value is not None and mine:
                flat.update(dict.fromkeys(mine, value * option.scale if option.scale != 1.0 else value))
                build(type(values), flat, text)  # what is impossible is told with the option
    kinds = {name: type(values) for name, values in zip(base._fields, base, strict=True)}  # type: ignore[attr-defined]
    return type(base)(**{name: build(kinds[name], flat) for name, flat in changed.items()})


def chosen_params(options: argparse.Namespace) -> TrialParams:
    """The parameters that these options choose.

    Raises:
        ValueError, OSError: as `read_parameter_file`.

    """
    return with_rig_options(options, TrialParams.of_rig(PRESETS[options.preset].rig))


def write_parameter_file(params: Iterable[tuple[Any, ...]], path: Path) -> None:
    """Write every parameter, each under the nodes that read it; derived defaults are left to the nodes."""
    content: dict[str, Any] = {}
    for values in params:
        for node in _NODES_OF[type(values)]:
            content.setdefault(node, {_PARAMETERS: {}})[_PARAMETERS].update(given(values))
    path.write_text(yaml_text(content), encoding='utf-8')


def write_changed(
    source: Path | None,
    changes: Mapping[str, Any],
    path: Path,
    remark: str,
    uncertainty: Uncertainty | None = None,
) -> None:
    """Write a copy of a parameter file in which some parameters have other values, for every node.

    Args:
        source: the file; None: one that holds nothing.
        changes: values by dotted names.
        path: of the copy.
        remark: its first line.
        uncertainty: how well the rig is known now, in the place of what the file says.

    """
    sections = _read(source) if source else {}
    content = {
        section: {name: value for name, value in _flatten(tree[_PARAMETERS] or {}) if name not in changes}
        for section, tree in sections.items()
    }
    content[_EVERY_NODE] = {**content.get(_EVERY_NODE, {}), **changes}
    if uncertainty:
        rows = zip(uncertainty.errors, uncertainty.correlations.tolist(), strict=True)
        content[_UNCERTAINTY] = {
            **{f'{_ERRORS}.{name}': float(error) for name, error in uncertainty.errors.items()},
            **{f'{_CORRELATIONS}.{name}': row[:place] for place, (name, row) in enumerate(rows) if place},
        }
    text = yaml_text({section: {_PARAMETERS: values} for section, values in content.items()})
    path.write_text(f'# {remark}\n{text}', encoding='utf-8')


def given(values: tuple[Any, ...]) -> dict[str, Any]:
    """What a parameter file says of a set: no derived defaults, and lists of their own, for ROS reads no aliases."""
    return {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in flatten(values).items()
        if value == value
    }


def _is_section(section: Any) -> bool:
    return isinstance(section, dict) and isinstance(section.get(_PARAMETERS) or {}, dict) and _PARAMETERS in section


def _flatten(tree: Mapping[str, Any], prefix: str = '') -> Iterator[tuple[str, Any]]:
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from _flatten(value, f'{prefix}{name}.')
        else:
            yield f'{prefix}{name}', value

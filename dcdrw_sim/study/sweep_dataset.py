"""A sweep's results as an xarray Dataset: every variable declared once, in memory and in netCDF files."""

import math
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.quantity import fields, flatten
from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.study.sweep import Block, Sweep, targets
from dcdrw_sim.study.verdict import Verdict

Arrays = Mapping[str, NDArray[Any]]

_POINT, _START = ('x', 'y'), ('x', 'y', 'start')
_SECTION = (*_START, 'step')


class Variable(NamedTuple):
    """One variable; `x` and `y` stand for the axes of the sweep, whose names its dimensions get."""

    name: str
    dims: tuple[str, ...]
    unit: str
    doc: str
    dtype: Any = float


VARIABLES = (
    Variable('verdict', _POINT, '', 'for good, of the worst start: in step only where the limit cycle is', np.int8),
    Variable('in_step', _POINT, '', 'fraction of the starts that come into step for good'),
    Variable('steps', _POINT, '', 'steps to synchronization, from the worst start; NaN: some start never comes to it'),
    Variable('time', _POINT, 's', 'the same as time'),
    Variable('strike_steps', _POINT, '', 'steps until the error at the strikes stays within the band, worst start'),
    Variable('enters', _POINT, '', "fraction of the starts with |θ2| within θ2's band at some strike: the paper's way"),
    Variable('settles', _POINT, '', "fraction of the starts with |θ2| within θ2's band at the last strikes"),
    Variable('cycle_omega1', _POINT, 'rad/s', 'limit cycle at the section: speed of the front wheel'),
    Variable('cycle_theta2', _POINT, 'rad', 'limit cycle at the section: angle of the rear wheel; the goal is 0'),
    Variable('cycle_omega2', _POINT, 'rad/s', 'limit cycle at the section: speed of the rear wheel'),
    Variable('cycle_period', _POINT, 's', 'time of a step on the limit cycle'),
    Variable('cycle_low', _POINT, '%', 'least error 100 (p − 0.5) at any instant of the limit cycle'),
    Variable('cycle_high', _POINT, '%', 'greatest error at any instant of the limit cycle'),
    Variable('stable', _POINT, '', 'whether a limit cycle was found, and every small deviation from it dies out', bool),
    Variable('speed', _POINT, 'm/s', 'mean speed down the slope on the limit cycle'),
    Variable('strike_loss', _POINT, 'J/m', 'energy lost at the strikes per metre, on the limit cycle'),
    Variable('damper_loss', _POINT, 'J/m', 'energy lost in the damper per metre, on the limit cycle'),
    Variable('multipliers', (*_POINT, 'multiplier'), '', 'moduli of the multipliers of the return map, largest first'),
    Variable('multiplier_angles', (*_POINT, 'multiplier'), 'rad', 'their angles in the complex plane'),
    Variable(
        'raw_eigenvalues',
        (*_POINT, 'raw_eigenvalue'),
        '',
        "moduli of the eigenvalues of the paper's regression on [θ1′, θ2, θ2′, D]; the first is 1 (erratum 5)",
    ),
    Variable('raw_eigenvalue_angles', (*_POINT, 'raw_eigenvalue'), 'rad', 'their angles in the complex plane'),
    Variable('raw_rank', _POINT, '', 'directions that the data of that regression hold; 0: no start walks', np.int8),
    Variable(
        'affine_eigenvalues',
        (*_POINT, 'affine_eigenvalue'),
        '',
        'moduli of the eigenvalues of the regression with an offset on [θ1′, θ2, θ2′]',
    ),
    Variable('affine_eigenvalue_angles', (*_POINT, 'affine_eigenvalue'), 'rad', 'their angles in the complex plane'),
    Variable('affine_rank', _POINT, '', 'directions that the data of that regression hold; 0: no start walks', np.int8),
    Variable('start_verdict', _START, '', 'what became of the motion while it was simulated', np.int8),
    Variable('start_steps', _START, '', 'steps to synchronization, as far as was simulated'),
    Variable('start_time', _START, 's', 'the same as time'),
    Variable('start_strike_steps', _START, '', 'steps until the error at the strikes stays within the band'),
    Variable('start_enters', _START, '', "whether |θ2| is within θ2's band at some strike", bool),
    Variable('start_steps_to_enter', _START, '', 'steps to the first such strike'),
    Variable('start_time_to_enter', _START, 's', 'the same as time'),
    Variable('start_settles', _START, '', "whether |θ2| is within θ2's band at the last strikes", bool),
    Variable('start_steps_to_settle', _START, '', 'steps to the first of those strikes'),
    Variable('start_theta2', _START, 'rad', 'θ2 at the last section'),
    Variable('start_sections', _START, '', 'sections that the motion went through, the start among them', np.int64),
    Variable('start_step_difference', _START, '', 'n at the last section', np.int64),
    Variable('start_slips', _START, '', 'how often n at the section changed', np.int64),
    Variable('section_time', _SECTION, 's', 'time at the section'),
    Variable('section_omega1', _SECTION, 'rad/s', 'θ1′ at the section'),
    Variable('section_theta2', _SECTION, 'rad', 'θ2 at the section'),
    Variable('section_omega2', _SECTION, 'rad/s', 'θ2′ at the section'),
    Variable('section_coupler_length', _SECTION, 'm', 'D at the section'),
)

_UNITS = {field.name: field.quantity for field in fields(RigParams)}


def require_extra(*modules: str) -> None:
    """Make sure that libraries are there.

    Raises:
        ValueError: one is missing; the message says what to install.

    """
    for module in modules:
        try:
            import_module(module)
        except ImportError:
            raise ValueError(f"a sweep needs {module}: pip install 'dcdrw[sweep]'") from None


def variables(sweep: Sweep) -> tuple[Variable, ...]:
    """Those that a sweep has."""
    return tuple(v for v in VARIABLES if sweep.trajectories or v.dims != _SECTION)


def to_dataset(sweep: Sweep, arrays: Arrays) -> Any:
    """An xarray Dataset of a sweep and its arrays, as `dcdrw_sim.study.sweep.compute` gives them for all points.

    Raises:
        ValueError: xarray is missing.

    """
    require_extra('xarray')
    import xarray

    names = {'x': sweep.x.name, 'y': sweep.y.name}
    varied = {name for axis in (sweep.x, sweep.y) for name in targets(axis.name)[0]}
    content = {
        v.name: (tuple(names.get(dim, dim) for dim in v.dims), arrays[v.name], _attributes(v)) for v in variables(sweep)
    }
    coordinates = {
        axis.name: (axis.name, np.array(axis.values), _axis_attributes(axis.name)) for axis in (sweep.x, sweep.y)
    }
    coordinates['start'] = (
        'start',
        np.array(sweep.phases),
        {'units': '1', 'long_name': 'phase at the start in steps, both wheels on their uncoupled limit cycles'},
    )
    return xarray.Dataset(
        content,
        coordinates,
        {
            'title': 'sweep of the dynamically coupled double rimless wheel',
            'sweep': sweep.to_json(),
            'units': 'SI; for m = ℓ = g = 1 the nondimensional form: time in √(ℓ/g), mass in m, length in ℓ',
            'section': 'the instant before a strike of the front wheel',
            'seconds': sweep.seconds,
            'band_percent': sweep.band_percent,
            'theta2_band': sweep.theta2_band,
            **{name: value for name, value in flatten(sweep.rig).items() if name not in varied},
        },
    )


def sweep_of(dataset: Any) -> Sweep:
    """The sweep that a Dataset holds: `rig_at` gives the exact parameters of each point."""
    return Sweep.from_json(dataset.attrs['sweep'])


def open_sweep(path: Path) -> Any:
    """The Dataset of a file, read as it is needed.

    Raises:
        ValueError: xarray or netCDF4 is missing, or the file holds no sweep.
        OSError: the file cannot be read.

    """
    require_extra('xarray', 'netCDF4')
    import xarray

    dataset = xarray.open_dataset(path, engine='netcdf4')
    if 'sweep' not in dataset.attrs:
        dataset.close()
        raise ValueError(f'{path} holds no sweep')
    return dataset


def write(path: Path, sweep: Sweep, parts: Iterable[tuple[Block, Arrays]], steps: int) -> None:
    """Write a netCDF file block by block; of the whole, only one block is ever in memory.

    Args:
        path: the file.
        sweep: what is written.
        parts: every block and its arrays, as `compute` gives them.
        steps: length of the dimension `step`: the most sections of any motion.

    """
    require_extra('xarray', 'netCDF4', 'dask.array')
    import dask.array
    import netCDF4

    sizes = {
        'x': sweep.shape[0],
        'y': sweep.shape[1],
        'start': len(sweep.phases),
        'step': steps,
        'multiplier': 3,
        'raw_eigenvalue': 4,
        'affine_eigenvalue': 3,
    }
    # Dask's arrays are not computed: xarray lays out the file, and the blocks fill it.
    empty = {v.name: dask.array.zeros([sizes[dim] for dim in v.dims], dtype=v.dtype) for v in variables(sweep)}
    to_dataset(sweep, empty).to_netcdf(path, engine='netcdf4', compute=False)
    with netCDF4.Dataset(path, 'a') as file:
        file.set_auto_maskandscale(False)
        for block, arrays in parts:
            for v in variables(sweep):
                array = arrays[v.name].astype(np.int8) if v.dtype is bool else arrays[v.name]
                if v.dims == _SECTION:
                    missing = steps - array.shape[-1]
                    array = np.pad(array, [(0, 0)] * 3 + [(0, missing)], constant_values=math.nan)
                file.variables[v.name][block] = array


def _attributes(variable: Variable) -> dict[str, Any]:
    attributes: dict[str, Any] = {'units': variable.unit or '1', 'long_name': variable.doc}
    if variable.name.endswith('verdict'):
        attributes |= {
            'flag_values': np.array([*Verdict], np.int8),
            'flag_meanings': ' '.join(verdict.name.lower() for verdict in Verdict),
            **{verdict.name.lower(): verdict.meaning for verdict in Verdict},
        }
    return attributes


def _axis_attributes(name: str) -> dict[str, str]:
    """Unit and meaning of an axis."""
    if name == 'slope_deg':
        return {'units': '°', 'long_name': _UNITS['slope'].doc}
    if name in WheelParams._fields:
        quantity = _UNITS[f'front.{name}']
        return {'units': quantity.unit or '1', 'long_name': f'{quantity.doc}; of both wheels'}
    return {'units': _UNITS[name].unit or '1', 'long_name': _UNITS[name].doc}

"""The parameters of a rig that a trial may tell, the coordinates in which their errors are even, and what is known.

A coordinate is the logarithm of what is positive and known by its ratio (masses, damping), r² of a gyration, for that
is what the equations hold, and else the parameter itself.
"""

import math
from collections.abc import Collection, Iterable, Mapping
from enum import Enum
from typing import NamedTuple

import numpy as np

from dcdrw_msgs_py.quantity import build, flatten, lookup, suggestion
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams
from dcdrw_msgs_py.values import Floats

FARTHEST = math.log(20.0)
"""So far from where it is thought to be a logarithm is sought."""


class Form(Enum):
    """How a coordinate makes the parameter."""

    PLAIN = 'plain'
    LOGARITHM = 'logarithm'
    SQUARE = 'square'


class Unknown(NamedTuple):
    """A parameter, or the same one of both wheels, that a trial may tell."""

    name: str
    parameters: tuple[str, ...]
    """Dotted names in the rig: all have the same value."""
    form: Form
    unit: str
    width: float
    """Standard deviation that is assumed where nobody states one, of the coordinate; 0: as the rig file has it."""
    low: float
    """Lower bound of the coordinate; of a logarithm, from where it is thought to be."""
    high: float
    """Upper bound, likewise."""
    measurement: str
    """How it is measured without a trial."""
    precision: float
    """Standard error of that measurement, of the coordinate."""

    def coordinate(self, rig: RigParams) -> float:
        """Of this rig.

        Raises:
            ValueError: the parameter is 0, which has no logarithm.

        """
        value = float(lookup(rig, self.parameters[0]))
        if self.form is Form.LOGARITHM:
            if not value > 0.0:
                raise ValueError(f'{self.name} must be > 0 in the rig file to be identified, or fixed; got {value:g}')
            return math.log(value)
        return value**2 if self.form is Form.SQUARE else value

    def columns(self, coordinates: Floats) -> dict[str, Floats]:
        """The parameters at coordinates, one or of shape (N,), as `dcdrw_sim.motion.ensemble.spread` takes them."""
        inside = np.maximum(coordinates, self.low) if self.form is not Form.LOGARITHM else coordinates
        if self.form is not Form.PLAIN:
            inside = np.exp(inside) if self.form is Form.LOGARITHM else np.sqrt(inside)
        return dict.fromkeys(self.parameters, inside)

    def shown(self, coordinate: float) -> float:
        """What people are told: the parameter, or r²."""
        return math.exp(coordinate) if self.form is Form.LOGARITHM else coordinate

    def error(self, coordinate: float, error: float) -> float:
        """The standard error of what people are told."""
        return error * self.shown(coordinate) if self.form is Form.LOGARITHM else error


class Uncertainty(NamedTuple):
    """How well a rig is known: a section of rig files that `dcdrw identify` writes, and people may."""

    errors: Mapping[str, float]
    """Standard errors by the unknowns' names, in the parameters' units; 0: as the rig has it."""
    correlations: Floats
    """Shape (N, N), in the order of the errors."""


class Knowledge(NamedTuple):
    """What is known of a rig: which parameters are sought, around what, and how far."""

    rig: RigParams
    """Derived defaults filled in."""
    unknowns: tuple[Unknown, ...]
    """Those that are sought."""
    coordinates: Floats
    """Shape (P,)."""
    covariance: Floats
    """Shape (P, P)."""

    def rig_with(self, coordinates: Floats) -> RigParams:
        """The rig at such coordinates of what is sought."""
        values = {
            name: float(column)
            for unknown, coordinate in zip(self.unknowns, coordinates, strict=True)
            for name, column in unknown.columns(coordinate).items()
        }
        return build(RigParams, {**flatten(self.rig), **values})

    def held(self, index: int, coordinate: float) -> tuple['Knowledge', float]:
        """What is known where one unknown is given; and the square of what that is off, in standard deviations."""
        others = [i for i in range(len(self.unknowns)) if i != index]
        off, variance = coordinate - self.coordinates[index], self.covariance[index, index]
        column = self.covariance[others, index]
        alone = self._replace(unknowns=self.unknowns[index : index + 1])
        return Knowledge(
            alone.rig_with(np.array([coordinate])),
            tuple(self.unknowns[i] for i in others),
            self.coordinates[others] + column / variance * off,
            self.covariance[np.ix_(others, others)] - np.outer(column, column) / variance,
        ), float(off**2 / variance)

    def draw(self, count: int, seed: int) -> dict[str, Floats]:
        """Columns of rigs, each as likely as this knowledge has it."""
        drawn = np.random.default_rng(seed).multivariate_normal(self.coordinates, self.covariance, count)
        return {
            name: column
            for unknown, coordinates in zip(self.unknowns, drawn.T, strict=True)
            for name, column in unknown.columns(coordinates).items()
        }

    def bounds(self) -> tuple[Floats, Floats]:
        """Between which the coordinates are sought, each of shape (P,)."""
        logarithms = np.array([unknown.form is Form.LOGARITHM for unknown in self.unknowns])
        centre = np.where(logarithms, self.coordinates, 0.0)
        low, high = np.transpose([(unknown.low, unknown.high) for unknown in self.unknowns])
        return centre + low, centre + high

    @property
    def uncertainty(self) -> Uncertainty:
        """As a rig file holds it, with 0 for what is not sought."""
        sought = {
            unknown.name: unknown.error(coordinate, math.sqrt(variance))
            for unknown, coordinate, variance in zip(
                self.unknowns, self.coordinates, np.diag(self.covariance), strict=True
            )
        }
        given = [unknown.name for unknown in unknowns_of(self.rig) if unknown.name not in sought]
        correlations = np.eye(len(sought) + len(given))
        correlations[: len(sought), : len(sought)] = correlation(self.covariance)
        return Uncertainty({**sought, **dict.fromkeys(given, 0.0)}, correlations)


def correlation(covariance: Floats) -> Floats:
    """The correlations of a covariance matrix."""
    errors = np.sqrt(np.diag(covariance))
    return np.asarray(covariance / np.outer(errors, errors))


def unknowns_of(rig: RigParams) -> tuple[Unknown, ...]:
    """All that a trial of this rig may tell.

    Wheels that the rig has alike stay alike; where they differ, each is sought by itself.
    """
    rig = rig.resolved()
    weight, far = 0.5 * (rig.front.mass + rig.rear.mass) * rig.gravity, (-FARTHEST, FARTHEST)
    plain, logarithm, square = Form.PLAIN, Form.LOGARITHM, Form.SQUARE
    return (
        *_of_wheels(rig, 'mass', Unknown('mass', (), logarithm, 'kg', 1.0, *far, 'weigh the wheels', 0.005)),
        *_of_wheels(
            rig,
            'gyration',
            Unknown('gyration_squared', (), square, '', 0.5, 0.0, 4.0, 'swing a wheel as a pendulum', 0.01),
        ),
        *_of_wheels(
            rig,
            'restitution',
            Unknown('restitution', (), plain, '', 0.3, 0.0, 0.99, 'film a strike, a thousand frames a second', 0.02),
        ),
        Unknown('k', ('k',), logarithm, 'N/m', 0.0, *far, 'hang a weight on the spring', 0.01),
        Unknown('b', ('b',), logarithm, 'N·s/m', 1.0, *far, 'pull the dashpot with a known weight', 0.05),
        Unknown(
            'D0',
            ('D0',),
            plain,
            'm',
            rig.front.step_length,
            0.0,
            math.inf,
            'measure the coupler where its spring is at rest',
            0.005,
        ),
        Unknown(
            'slope',
            ('slope',),
            plain,
            'rad',
            math.radians(0.25),
            -math.pi / 4,
            math.pi / 4,
            'lay a digital level on the slope',
            math.radians(0.05),
        ),
        Unknown(
            'coupler_friction',
            ('coupler_friction',),
            plain,
            'N',
            0.03 * weight,
            0.0,
            weight,
            'pull the coupler slowly with a spring balance',
            0.1,
        ),
        Unknown(
            'rolling_resistance',
            ('rolling_resistance',),
            plain,
            '',
            0.01,
            0.0,
            0.2,
            'find the slope on which a wheel without spokes barely rolls',
            0.001,
        ),
    )


def names_of_unknowns() -> tuple[str, ...]:
    """Of rigs with wheels alike, and with wheels that differ."""
    alike = RigParams()
    unlike = alike._replace(front=alike.front._replace(mass=1.0, gyration=0.5, restitution=0.5))
    return tuple(dict.fromkeys(unknown.name for rig in (alike, unlike) for unknown in unknowns_of(rig)))


def _of_wheels(rig: RigParams, parameter: str, unknown: Unknown) -> Iterable[Unknown]:
    both = tuple(f'{side}.{parameter}' for side in (FRONT, REAR))
    if lookup(rig, both[0]) == lookup(rig, both[1]):
        yield unknown._replace(parameters=both)
        return
    for side, one in zip((FRONT, REAR), both, strict=True):
        yield unknown._replace(name=f'{side}.{unknown.name}', parameters=(one,))


def knowledge(
    rig: RigParams, fixed: Collection[str] = (), uncertainty: Uncertainty | None = None, sources: str = 'the rig file'
) -> Knowledge:
    """What is known of a rig before a trial.

    Args:
        rig: around which everything is sought.
        fixed: unknowns that are as the rig has them, by their names, or parameters'.
        uncertainty: what is stated; what it does not name has the unknown's own width.
        sources: of the uncertainty, for messages.

    Raises:
        ValueError: an unknown name, or a parameter that cannot be sought.

    """
    rig = rig.resolved()
    known = unknowns_of(rig)
    stated = uncertainty.errors if uncertainty else {}
    for names, where in ((fixed, '--fix'), (stated, f'the uncertainty in {sources}')):
        accepted = {name for unknown in known for name in _names(unknown)}
        for name in names:
            if name not in accepted:
                raise ValueError(f'{name} of {where} is nothing that a trial tells{suggestion(name, accepted)}')
    widths = {unknown.name: _width(unknown, rig, stated) for unknown in known if not set(_names(unknown)) & set(fixed)}
    sought = tuple(unknown for unknown in known if widths.get(unknown.name, 0.0) > 0.0)
    covariance = np.diag([widths[unknown.name] ** 2 for unknown in sought])
    if uncertainty:
        order = list(stated)
        for i, one in enumerate(sought):
            for j, other in enumerate(sought):
                if one.name in stated and other.name in stated and i != j:
                    part = uncertainty.correlations[order.index(one.name), order.index(other.name)]
                    covariance[i, j] = part * widths[one.name] * widths[other.name]
    return Knowledge(rig, sought, np.array([unknown.coordinate(rig) for unknown in sought]), covariance)


def _names(unknown: Unknown) -> tuple[str, ...]:
    """By which it goes: its own, that of its parameter, and of both wheels'."""
    return (unknown.name, *unknown.parameters, *(name.rpartition('.')[2] for name in unknown.parameters))


def _width(unknown: Unknown, rig: RigParams, stated: Mapping[str, float]) -> float:
    if unknown.name not in stated:
        return unknown.width
    error = stated[unknown.name]
    return error / float(lookup(rig, unknown.parameters[0])) if unknown.form is Form.LOGARITHM and error else error

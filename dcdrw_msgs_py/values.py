"""The number types of the cores, and functions that take either."""

import math
from collections.abc import Callable
from typing import Protocol, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Mask = NDArray[np.bool_]

Real = float | Floats
"""A number, or an array of them side by side."""
Value = TypeVar('Value', float, Floats)
"""A number or an array, whichever is given: the result is of the same kind."""


class Functions(Protocol):
    """Sine and its kin."""

    def sin(self, x: Real, /) -> Real:
        """Sine of an angle [rad]."""

    def cos(self, x: Real, /) -> Real:
        """Cosine of an angle [rad]."""

    def tanh(self, x: Real, /) -> Real:
        """The hyperbolic tangent."""

    def hypot(self, x: Real, y: Real, /) -> Real:
        """√(x² + y²)."""


def functions_of(value: Real) -> Functions:
    """The functions of `math` for a plain number, at a tenth of the cost; numpy's for an array."""
    return math if isinstance(value, float) else np


@overload
def each(function: Callable[[float], float], values: float) -> float: ...
@overload
def each(function: Callable[[float], float], values: Floats) -> Floats: ...
def each(function: Callable[[float], float], values: Real) -> Real:
    """A function of `math` of every value: numpy's own may round the same number in two ways, by its place."""
    if isinstance(values, float):
        return function(values)
    return np.fromiter(map(function, values.tolist()), float, len(values))

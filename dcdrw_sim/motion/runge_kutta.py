"""Runge and Kutta's classic step: for motions whose strikes are known, or that no Taylor series here describes."""

from collections.abc import Callable

import numpy as np

from dcdrw_msgs_py.values import Floats


def runge_kutta(rates: Callable[[Floats, Floats], Floats], state: Floats, h: Floats | float) -> Floats:
    """A state a time h later, with an error of the order h⁵.

    Args:
        rates: its derivative, at a time from the beginning of the step and a state.
        state: shape (S,), or (S, N) of N motions.
        h: or of shape (N,).

    """
    half, none = np.asarray(0.5 * h), np.zeros_like(h)
    k1 = rates(none, state)
    k2 = rates(half, state + half * k1)
    k3 = rates(half, state + half * k2)
    k4 = rates(np.asarray(h), state + h * k3)
    return np.asarray(state + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))

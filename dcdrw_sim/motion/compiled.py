"""Compilation by numba where it is installed; without it everything runs as plain Python, only slower."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

from dcdrw_msgs_py import in_step
from dcdrw_sim.model import dynamics
from dcdrw_sim.motion import events, extremes, taylor
from dcdrw_sim.source import fingerprint

Function = TypeVar('Function', bound=Callable[..., Any])  # whatever it takes

try:
    from numba import njit
    from numba.extending import register_jitable

    AVAILABLE = True
except ImportError:
    AVAILABLE = False

# Contraction to fused multiply-add is the only liberty taken: every lane gets the same result as every other.
_OPTIONS: dict[str, Any] = {  # as numba's decorators take them
    'error_model': 'numpy',
    'fastmath': {'contract'},
}


def compiled(function: Function) -> Function:
    """The function compiled to machine code, or itself where numba is missing."""
    if not AVAILABLE:
        return function
    # numba's cache watches only the function's own file: let its name tell of all that it calls and freezes.
    function.__qualname__ += f'_{_FINGERPRINT}'
    kernel: Function = njit(nogil=True, **_OPTIONS)(function)  # threads run side by side
    with suppress(RuntimeError):  # nowhere to keep it: it is compiled anew at every start
        kernel.enable_caching()  # type: ignore[attr-defined]
    return kernel


if AVAILABLE:
    from dcdrw_sim.motion import lanes  # noqa: F401  # registers the vectors

    _FINGERPRINT = fingerprint('dcdrw_msgs_py', 'dcdrw_sim.model', 'dcdrw_sim.motion')

    for _function in (
        taylor.sin_series,
        taylor.cos_series,
        taylor.step_size,
        taylor._gentle,
        taylor.friction_step,
        taylor.evaluate,
        taylor._grip,
        taylor.expand,
        taylor.motion,
        dynamics.reset,
        events.crossing,
        events.first_strike,
        extremes.phase_at,
        extremes.phase_extremes,
        in_step.in_step_from,
        in_step.strikes_in_step,
        in_step.wrapped_percent,
    ):
        register_jitable(**_OPTIONS)(_function)

"""Two rimless wheels on a slope, joined by a spring and a damper: simulate them, choose a coupler, judge trials.

The names of `dcdrw.api` are names of this package, imported when they are first asked for:

    import dcdrw

    trial = dcdrw.simulate(dcdrw.preset('paper'), phase=0.216)
    print(trial.steps, trial.summary.sentence)
"""

from typing import Any

_API = (
    'PRESETS',
    'Assessment',
    'Axis',
    'ReturnMap',
    'RigParams',
    'Start',
    'Trial',
    'WheelParams',
    'analyze',
    'design',
    'preset',
    'read_rig',
    'return_map',
    'simulate',
    'start',
    'sweep',
)
__all__ = list(_API)


def __getattr__(name: str) -> Any:
    if name not in _API:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    from dcdrw import api

    return getattr(api, name)


def __dir__() -> list[str]:
    return sorted((*globals(), *_API))

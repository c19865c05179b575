"""Rigs and starts to test with."""

import math

from hypothesis import strategies as st

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.model.dynamics import State

UNEQUAL = RigParams(WheelParams(0.95, 9.0, 12), WheelParams(1.05, 11.0, 13), k=20.0, b=30.0, slope=math.radians(2.5))
REAL = RigParams(
    WheelParams(0.9652, 8.0, 12, gyration=0.5, restitution=0.1),
    WheelParams(0.9652, 12.0, 12, gyration=0.3, restitution=0.2),
    k=20.0,
    b=15.0,
    slope=math.radians(2.5),
    coupler_friction=0.5,
    rolling_resistance=0.004,
    friction_speed=0.05,
)
"""With all that the paper leaves out."""
UNCOUPLED = RigParams(k=0.0, b=0.0)
GENTLE = RigParams(slope=math.radians(0.5))
ALPHA = RigParams().front.alpha


def between(low, high):
    return st.floats(low, high, allow_subnormal=False)


wheels = st.builds(
    WheelParams,
    between(0.5, 1.5),
    between(5.0, 20.0),
    between(9.0, 16.0),
    gyration=st.just(0.0) | between(0.0, 0.6),
    restitution=st.just(0.0) | between(0.0, 0.2),
)
rigs = st.builds(
    RigParams,
    wheels,
    wheels,
    k=between(0.0, 50.0),
    b=between(0.0, 150.0),
    D0=between(0.5, 2.0),
    S0=between(0.8, 1.5),
    slope=between(0.06, 0.12),
    gravity=st.just(9.81),
    coupler_friction=st.sampled_from([0.0, 0.0, 0.5]),
    rolling_resistance=st.sampled_from([0.0, 0.0, 0.002]),
    friction_speed=st.just(0.05),
)
"""Pairs that keep rolling for a while."""


def rolling(rig, part1, omega1, part2, omega2):
    """A start at the given parts of ±α."""
    return State(part1 * rig.front.alpha, omega1, part2 * rig.rear.alpha, omega2)


starts = st.tuples(between(-0.9, 0.9), between(1.0, 2.0), between(-0.9, 0.9), between(1.0, 2.0))

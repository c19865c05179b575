"""What a camera sees of a walking pair: views made from the truth, with noise, losses and misreadings."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.rig import WheelShape
from dcdrw_tracker.tags.wheel_view import PairView, WheelView
from tests.tracker.walking import ALPHA, PITCH, START_NS, Walk

Array = NDArray[np.float64]
Hidden = Callable[[Array], NDArray[np.bool_]]

SHAPE = WheelShape()
START_DISTANCE = 1.2
"""Distance of the hubs' places at ψ = 0 [m]."""


def hub(psi: Array) -> Array:
    """Place of a hub [m]: from foot to foot, σ apart, and ℓ sin θ past it."""
    steps = np.floor((psi + ALPHA) / PITCH)
    return 2 * SHAPE.length * math.sin(ALPHA) * steps + SHAPE.length * np.sin(psi - PITCH * steps)


def nothing(time: Array) -> NDArray[np.bool_]:
    return np.zeros(time.shape, bool)


def between(*spans: tuple[float, float]) -> Hidden:
    return lambda time: np.any([(time >= start) & (time < end) for start, end in spans], axis=0)


def film(
    truth: Walk,
    noise_deg: float = 0.05,
    lost: float = 0.0,
    front_hidden: Hidden = nothing,
    rear_hidden: Hidden = nothing,
    follows: bool = False,
    hub_noise: float = 0.01,
    seed: int = 0,
) -> list[PairView]:
    """Views of a walk; frames in which no wheel is seen are there, frames that are lost are not."""
    random = np.random.default_rng(seed)
    count = truth.time.size
    camera = hub(truth.front) if follows else np.zeros(count)
    places = hub(truth.front) + START_DISTANCE - camera, hub(truth.rear) - camera
    views = []
    for psi, place, hidden in zip((truth.front, truth.rear), places, (front_hidden, rear_hidden), strict=True):
        seen = psi + math.radians(noise_deg) * random.standard_normal(count)
        x = place + hub_noise * random.standard_normal(count)
        views.append(
            [
                None if gone else view(rotation, where)
                for rotation, where, gone in zip(seen.tolist(), x.tolist(), hidden(truth.time).tolist(), strict=True)
            ]
        )
    kept = (random.random(count) >= lost).tolist()
    stamps = (START_NS + np.round(truth.time * 1e9).astype(np.int64)).tolist()
    return [PairView(stamp, front, rear) for stamp, front, rear, keep in zip(stamps, *views, kept, strict=True) if keep]


def view(rotation: float, x: float = 0.0, error_px: float = 0.1) -> WheelView:
    return WheelView(math.remainder(rotation, math.tau), (x, 0.9), error_px, 1, 120.0)

"""Corners of a black square to a few hundredths of a pixel: a line fitted to each edge, at its steepest."""

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.values import Floats

SAMPLES = 24
"""Profiles taken across each edge."""
ALONG = np.linspace(0.08, 0.92, SAMPLES)
"""Where, as a share of the edge: its ends are left out, where the other edge begins."""
STEP = 0.5
"""Between the samples of a profile [px]."""
ROUNDS = 6
"""Fits at most, each about the line of the last."""
SETTLED = 0.02
"""A fit that moves no corner by more is the last [px]."""


def refine(image: NDArray[np.uint8], corners: Floats, cells: int) -> Floats:
    """Corners (4, 2) moved to where the lines through the square's edges meet; NaN where an edge has no contrast.

    A profile reaches one cell to each side at most, which is all that a tag grants: its border within, the white
    without. An edge is where the profile's rise has its mean, what is far from the last line counting less: so blur
    and noise, alike on both sides, do not move it.

    Args:
        image: grey.
        corners: clockwise in the picture, to a pixel or two.
        cells: of the square, across, border included.

    """
    cv2 = opencv()
    for round_ in range(ROUNDS):
        start, along = corners[:, None], (np.roll(corners, -1, axis=0) - corners)[:, None]
        side = np.linalg.norm(along, axis=2, keepdims=True)
        outward = np.stack((along[..., 1], -along[..., 0]), axis=-1) / side
        cell = float(side.min()) / cells
        reach = max(min(cell, 6.0) if round_ == 0 else min(0.6 * cell, 5.0), 1.5) + 0.5 * STEP
        across = np.arange(-reach, reach + 0.5 * STEP, STEP)
        points = (start + ALONG[:, None] * along)[:, :, None] + across[:, None] * outward[:, :, None]
        levels = (
            cv2.remap(
                image,
                points.astype(np.float32).reshape(4 * SAMPLES, -1, 2),
                None,
                cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REPLICATE,
            )
            .reshape(4, SAMPLES, -1)
            .astype(float)
        )
        middle = 0.5 * (across[1:] + across[:-1])
        rise = np.maximum(np.diff(levels, axis=2), 0.0) * (1.0 - (middle / reach) ** 2)
        weight = rise.sum(axis=2)
        with np.errstate(invalid='ignore', divide='ignore'):
            offset = np.where(weight > 0.0, (rise * middle).sum(axis=2) / weight, 0.0)
        last, corners = corners, _meet(corners, along[:, 0], outward[:, 0], offset, weight)
        if not np.abs(corners - last).max() > SETTLED:  # or NaN
            break
    return corners


def _meet(corners: Floats, along: Floats, outward: Floats, offset: Floats, weight: Floats) -> Floats:
    """Where neighbouring lines meet: each the weighted fit of offset = a + b · share along its edge, (4, SAMPLES)."""
    with np.errstate(invalid='ignore', divide='ignore'):
        total = weight.sum(axis=1)
        at = (weight * ALONG).sum(axis=1) / total
        mean = (weight * offset).sum(axis=1) / total
        apart = ALONG - at[:, None]
        b = (weight * apart * offset).sum(axis=1) / (weight * apart * apart).sum(axis=1)
        start = corners + (mean - b * at)[:, None] * outward
        heading = along + b[:, None] * outward
        before, previous = np.roll(start, 1, axis=0), np.roll(heading, 1, axis=0)
        gap = start - before
        share = (gap[:, 0] * heading[:, 1] - gap[:, 1] * heading[:, 0]) / (
            previous[:, 0] * heading[:, 1] - previous[:, 1] * heading[:, 0]
        )
        return np.asarray(before + share[:, None] * previous)

"""Frames with tags whose corners are known: made apart from the project's own renderer, by supersampling."""

import numpy as np

from dcdrw_msgs_py.opencv import opencv, tag_cells

CELL = 24
"""Pixels per cell of a tag's texture."""
SUPER = 4


def draw(tags, width=1280, height=720, background=110, blur=0.0, noise=0.0, seed=0, family='36h11', white=1):
    """A grey frame; `tags` are pairs of id and corners (4, 2): top left, top right, bottom right, bottom left.

    Pixel centres have whole coordinates. Around the black square lie `white` cells of white. `blur` is the standard
    deviation of a Gaussian [px], `noise` that of white noise [grey levels].
    """
    cv2 = opencv()
    rng = np.random.default_rng(seed)
    fine = np.full((height * SUPER, width * SUPER), background, np.uint8)
    for tag, corners in tags:
        cells = np.pad(tag_cells(family, tag), white, constant_values=True)
        texture = np.kron(np.where(cells, 230, 25), np.ones((CELL, CELL))).astype(np.uint8)
        low, high = white * CELL - 0.5, texture.shape[0] - white * CELL - 0.5
        square = np.array(((low, low), (high, low), (high, high), (low, high)), np.float32)
        target = (np.asarray(corners) + 0.5) * SUPER - 0.5
        homography = cv2.getPerspectiveTransform(square, target.astype(np.float32))
        cv2.warpPerspective(texture, homography, fine.shape[::-1], fine, cv2.INTER_LINEAR, cv2.BORDER_TRANSPARENT)
    frame = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA).astype(float)
    if blur:
        frame = cv2.GaussianBlur(frame, (0, 0), blur)
    return np.clip(np.rint(frame + rng.normal(0.0, noise, frame.shape)), 0, 255).astype(np.uint8)


def square(x, y, side, angle=0.0):
    """Corners of an upright square about (x, y), turned counter-clockwise as seen [px, rad]."""
    upright = 0.5 * side * np.array((-1 + 1j, 1 + 1j, 1 - 1j, -1 - 1j)) * np.exp(1j * angle)
    return np.stack((x + upright.real, y - upright.imag), axis=1)

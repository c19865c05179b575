"""Which tag a square is: its cells are read and compared with the family's codes."""

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.opencv import opencv, tag_cells
from dcdrw_msgs_py.tagging import FAMILIES
from dcdrw_msgs_py.values import Floats

CORRECTED = {'36h11': 2, '16h5': 0, '25h9': 1, '36h10': 2}
"""Wrong cells that are borne, of each family: few enough that nothing else is read as a tag."""
SHARPEN = 0.25
"""Share of its neighbours' contrast that a cell is given back, which blur has taken."""
SPREAD = np.array((-0.2, 0.2))
"""Where in a cell its level is taken, from its middle, in cells."""


class TagReader:
    """Reads the tags of one family; `ids`, where given, are the only ones that it knows."""

    def __init__(self, family: str, ids: tuple[int, ...] | None = None) -> None:
        self._ids = tuple(range(FAMILIES[family].size)) if ids is None else ids
        self._borne = CORRECTED[family]
        self._across = across = FAMILIES[family].cells + 4  # with the black border, and the white one around it
        codes = [np.rot90(tag_cells(family, tag)[1:-1, 1:-1], turn).ravel() for tag in self._ids for turn in range(4)]
        self._codes = np.where(codes, 1, -1)
        y, x = np.mgrid[:across, :across] - 0.5 * (across - 1)
        ring = np.maximum(np.abs(x), np.abs(y))
        self._white, self._black = ring == ring.max(), ring == ring.max() - 1.0
        self._inner = ring < ring.max() - 1.0
        plane = np.stack((np.ones_like(x), x, y), axis=-1)
        # Levels of the white and of the black ring, each fitted by a plane: light is seldom even.
        self._planes = [
            plane[self._inner | self._black] @ np.linalg.pinv(plane[border]) for border in (self._white, self._black)
        ]
        middle = np.add.outer(np.arange(across) - 0.5 * (across - 1), SPREAD).ravel()
        self._points = np.stack(np.meshgrid(middle, middle), axis=-1).astype(np.float32)
        half = 0.5 * (across - 2)
        self._square = np.array(((-half, -half), (half, -half), (half, half), (-half, half)), np.float32)

    def read(self, image: NDArray[np.uint8], corners: Floats) -> tuple[int, Floats] | None:
        """The tag whose black square has these corners (4, 2), and the corners from its top left; None for no tag."""
        cv2, across = opencv(), self._across
        homography = cv2.getPerspectiveTransform(self._square, corners.astype(np.float32))
        points = cv2.perspectiveTransform(self._points, homography)
        levels = cv2.remap(image, points, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(float)
        levels = levels.reshape(across, 2, across, 2).mean(axis=(1, 3))
        white, black = (
            plane @ levels[border] for plane, border in zip(self._planes, (self._white, self._black), strict=True)
        )
        around = np.pad(levels, 1, mode='edge')
        around = around[1:-1, :-2] + around[1:-1, 2:] + around[:-2, 1:-1] + around[2:, 1:-1]
        sharp = levels + SHARPEN * (4.0 * levels - around)
        bright = np.zeros_like(self._inner)
        bright[self._inner | self._black] = sharp[self._inner | self._black] > 0.5 * (white + black)
        wrong = (len(self._codes[0]) - self._codes @ np.where(bright[self._inner], 1, -1)) // 2
        best = int(wrong.argmin())
        if wrong[best] > self._borne or bright[self._black].sum() > self._borne or not (white > black).all():
            return None
        return self._ids[best // 4], np.roll(corners, best % 4, axis=0)

"""AprilTags in a picture: OpenCV's ArUco module finds them, their edges say where exactly."""

from collections.abc import Callable, Collection, Iterable
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.opencv import opencv, tag_dictionary
from dcdrw_msgs_py.tagging import FAMILIES
from dcdrw_msgs_py.values import Floats
from dcdrw_tracker.tags.edges import refine
from dcdrw_tracker.tags.tag_code import TagReader

Grey = NDArray[np.uint8]
Backend = Literal['aruco', 'apriltag']

SCALES = (1.0, 0.5, 2.0, 3.0)
"""Sizes of the picture that are searched in turn: noisy tags are found in a small one, small tags in a large one."""
SMALLEST_SIDE = 10.0
"""Smaller tags are not looked for, at any scale [px]."""
BEST_SIDE = 48.0
"""A tag whose size is known is looked for at the scale that makes its side this [px]."""
FARTHEST_MOVE = 0.25
"""A candidate whose edges move by more than this share of its side is not a tag's outline."""


class Detection(NamedTuple):
    """One tag in a picture."""

    id: int
    corners: Floats
    """(4, 2) [px]: top left, top right, bottom right, bottom left of the upright tag."""

    @property
    def centre(self) -> Floats:
        """Mean of the corners (2,) [px]."""
        return np.asarray(self.corners.mean(axis=0))

    @property
    def side(self) -> float:
        """Mean length of the four sides [px]."""
        return float(np.linalg.norm(self.corners - np.roll(self.corners, 1, axis=0), axis=1).mean())

    def covers(self, corners: Floats) -> bool:
        """Whether no other tag can have these corners."""
        return float(np.linalg.norm(self.centre - corners.mean(axis=0))) < 0.5 * self.side


class TagDetector:
    """Finds the tags of one family; `ids`, where given, are the only ones that are of interest.

    Raises:
        ValueError: an unknown backend, or one that is not installed.

    """

    def __init__(self, family: str = '36h11', ids: Collection[int] | None = None, backend: Backend = 'aruco') -> None:
        if backend not in _BACKENDS:
            raise ValueError(f'backend must be {" or ".join(_BACKENDS)}, got {backend!r}')
        self.ids = ids
        self._cells = FAMILIES[family].cells + 2
        self._find = _BACKENDS[backend](family)
        self._reader = TagReader(family, None if ids is None else tuple(ids))

    def detect(self, image: Grey, scales: Iterable[float] = SCALES, smallest: float = SMALLEST_SIDE) -> list[Detection]:
        """Every tag of a grey picture; it may hold one id more than once.

        Args:
            image: (height, width).
            scales: at which it is searched, one after the other.
            smallest: side of the smallest tag that is looked for, at any scale [px].

        """
        found: list[Detection] = []
        for scale in scales:
            for tag, rough in self._find(_scaled(image, scale), smallest):
                rough = (rough + 0.5) / scale - 0.5
                if not any(other.covers(rough) for other in found):
                    one = self._look(image, tag, rough)
                    if one and not any(other.covers(one.corners) for other in found):
                        found.append(one)
        return found

    def _look(self, image: Grey, tag: int | None, rough: Floats) -> Detection | None:
        corners = refine(image, rough, self._cells)
        if not np.abs(corners - rough).max() <= FARTHEST_MOVE * np.ptp(rough, axis=0).max():
            return None
        if tag is None:
            read = self._reader.read(image, corners)
            return Detection(*read) if read else None
        return Detection(tag, corners) if self.ids is None or tag in self.ids else None

    def detect_near(self, image: Grey, low: Floats, high: Floats, side: float) -> list[Detection]:
        """The tags about a given size within a region, from the corner `low` to the corner `high` (2,) [px]."""
        x0, y0 = np.maximum(np.floor(low).astype(int), 0)
        x1, y1 = np.minimum(np.ceil(high).astype(int) + 1, image.shape[::-1])
        if min(x1 - x0, y1 - y0) < SMALLEST_SIDE:
            return []
        scale = min(BEST_SIDE / side, 2.0)
        region = np.ascontiguousarray(image[y0:y1, x0:x1])
        return [
            one._replace(corners=one.corners + np.array((x0, y0)))
            for one in self.detect(region, (scale,), 0.5 * side * scale)
        ]


def _scaled(image: Grey, scale: float) -> Grey:
    if scale == 1.0:
        return image
    cv2 = opencv()
    how = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=how))


Find = Callable[[Grey, float], Iterable[tuple[int | None, Floats]]]
"""From a picture and the smallest side that matters [px] to ids and rough corners, in the order of `Detection`; squares
that may be tags have no id."""


def _aruco(family: str) -> Find:
    aruco, dictionary = opencv().aruco, tag_dictionary(family)
    modern = hasattr(aruco, 'ArucoDetector')  # OpenCV 4.7 and later
    settings = aruco.DetectorParameters() if modern else aruco.DetectorParameters_create()
    settings.minDistanceToBorder = 1
    settings.minMarkerDistanceRate = 0.02  # else OpenCV 4.6 keeps only the white square around the black one
    settings.perspectiveRemovePixelPerCell = 8
    detector = aruco.ArucoDetector(dictionary, settings) if modern else None

    def find(image: Grey, smallest: float) -> Iterable[tuple[int | None, Floats]]:
        settings.minMarkerPerimeterRate = 4.0 * smallest / max(image.shape)
        if detector:
            detector.setDetectorParameters(settings)
            quads, ids, others = detector.detectMarkers(image)
        else:
            quads, ids, others = aruco.detectMarkers(image, dictionary, parameters=settings)
        for quad, tag in zip(quads, () if ids is None else np.ravel(ids), strict=True):
            yield int(tag), np.roll(quad.reshape(4, 2).astype(float), 2, axis=0)  # its upright is upside down
        for quad in others:
            yield None, quad.reshape(4, 2).astype(float)

    return find


def _apriltag(family: str) -> Find:
    try:
        from pupil_apriltags import Detector
    except ImportError:
        raise ValueError("the backend apriltag needs pupil-apriltags: pip install 'dcdrw[apriltag]'") from None
    if family == '36h10':
        raise ValueError('the backend apriltag does not know the family 36h10: use another family, or backend aruco')
    detector: Any = Detector(f'tag{family}', quad_decimate=1.0)
    detector.tag_families.clear()  # so that its destructor has nothing to free: it would damage the heap

    def find(image: Grey, smallest: float) -> Iterable[tuple[int | None, Floats]]:
        for tag in detector.detect(np.ascontiguousarray(image)):
            yield tag.tag_id, tag.corners[::-1] - 0.5  # its pixels' centres lie at halves

    return find


_BACKENDS: dict[str, Callable[[str], Find]] = {'aruco': _aruco, 'apriltag': _apriltag}

"""Follows tags from frame to frame: each is searched where it must be next, and in the whole picture once lost."""

from collections import Counter
from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcdrw_msgs_py.values import Floats
from dcdrw_tracker.tags.detector import BEST_SIDE, SCALES, Detection, TagDetector

REACH = 0.7
"""A tag is searched within this many sides of the place where it must be, and half of the way that it has made."""
FORGET_NS = 1_000_000_000
"""A tag that was not seen for so long may be anywhere."""
SEARCH_EVERY = 5
"""While one tag is followed, the whole picture is searched for the others in every so many frames."""


class Sighting(NamedTuple):
    """The tags of one frame."""

    detections: tuple[Detection, ...]
    """The tags that were found, at most one of each id."""
    duplicates: tuple[int, ...] = ()
    """Ids that were seen twice, so that it is unknown which is the rig's."""


class _Track(NamedTuple):
    """A tag that was seen."""

    stamp_ns: int
    detection: Detection
    speed: Floats
    """Speed of the tag's centre (2,) [px/s]."""


class TagFollower:
    """Finds the tags `ids` in one frame after another."""

    def __init__(self, detector: TagDetector, ids: Collection[int]) -> None:
        self._detector, self._ids = detector, tuple(ids)
        self._tracks: dict[int, _Track] = {}
        self._frames = self._searches = 0

    def follow(self, image: NDArray[np.uint8], stamp_ns: int) -> Sighting:
        """The tags in the next frame: grey, (height, width)."""
        self._frames += 1
        self._tracks = {
            tag: track for tag, track in self._tracks.items() if 0 <= stamp_ns - track.stamp_ns <= FORGET_NS
        }
        found: dict[int, Detection] = {}
        duplicates: set[int] = set()
        for tag, track in self._tracks.items():
            near = [one for one in self._search_near(image, track, stamp_ns) if one.id == tag]
            if len(near) == 1:
                found[tag] = near[0]
            elif near:
                duplicates.add(tag)
        missing = [tag for tag in self._ids if tag not in found]
        if missing and (not found or self._frames % SEARCH_EVERY == 0):
            seen = self._detector.detect(image, (self._next_scale(found.values()),))
            counts = Counter(one.id for one in seen)
            duplicates |= {tag for tag in missing if counts[tag] > 1}
            found |= {one.id: one for one in seen if one.id in missing and one.id not in duplicates}
        for tag, one in found.items():
            self._tracks[tag] = self._tracked(one, self._tracks.get(tag), stamp_ns)
        return Sighting(tuple(found.values()), tuple(sorted(duplicates)))

    def _next_scale(self, found: Collection[Detection]) -> float:
        """Scale at which to search the whole picture: that of the tags found; where none is, one after the other."""
        if found:
            return min(BEST_SIDE / max(one.side for one in found), 2.0)
        self._searches += 1
        return SCALES[self._searches % len(SCALES) - 1]

    def _search_near(self, image: NDArray[np.uint8], track: _Track, stamp_ns: int) -> list[Detection]:
        last, way = track.detection, track.speed * (stamp_ns - track.stamp_ns) * 1e-9
        margin = REACH * last.side + 0.5 * np.abs(way)
        low, high = last.corners.min(axis=0) + way - margin, last.corners.max(axis=0) + way + margin
        return self._detector.detect_near(image, low, high, last.side)

    @staticmethod
    def _tracked(one: Detection, last: _Track | None, stamp_ns: int) -> _Track:
        if last is None or stamp_ns <= last.stamp_ns:
            return _Track(stamp_ns, one, np.zeros(2))
        return _Track(stamp_ns, one, (one.centre - last.detection.centre) / ((stamp_ns - last.stamp_ns) * 1e-9))

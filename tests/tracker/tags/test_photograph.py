"""A real photograph, with its published corners: not ours to ship, so it is read where a lab keeps it."""

import re
from pathlib import Path

import numpy as np
import pytest

from dcdrw_tracker.tags.detector import TagDetector
from tests import ROOT

cv2 = pytest.importorskip('cv2')
FOLDER = ROOT.parent / 'shared' / 'reference' / 'tags'
PHOTOGRAPHS = [path for path in sorted(FOLDER.glob('*.jpg')) if path.with_suffix('.txt').exists()]


def published(path: Path) -> list[tuple[int, np.ndarray]]:
    """Ids and corners in our order: the file has them counter-clockwise from the bottom left, and a pixel's centre
    at halves."""
    lines = [re.findall(r'-?[\d.]+', line) for line in path.with_suffix('.txt').read_text().splitlines()]
    return [(int(line[0]), np.array(line[1:], float).reshape(4, 2)[::-1] - 0.5) for line in lines if line]


@pytest.mark.skipif(not PHOTOGRAPHS, reason=f'no photograph with published corners in {FOLDER}')
@pytest.mark.parametrize('path', PHOTOGRAPHS, ids=lambda path: path.stem)
def test_every_published_tag_of_a_photograph_is_found_with_its_corners(path):
    found = TagDetector().detect(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
    for tag, truth in published(path):
        errors = [np.linalg.norm(one.corners - truth, axis=1).mean() for one in found if one.id == tag]
        assert min(errors, default=np.inf) < 2.0, f'tag {tag} at {truth.mean(axis=0)}'

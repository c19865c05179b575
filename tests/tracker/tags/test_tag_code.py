"""A square is read as the tag that it shows, whichever way up, and as none where it shows none."""

import numpy as np
import pytest

from dcdrw_tracker.tags.tag_code import TagReader
from tests.tracker.frames import draw, square

SQUARE = square(160.0, 120.0, 90.0, 0.3)


@pytest.mark.parametrize('family', ['36h11', '16h5', '25h9'])
@pytest.mark.parametrize('turns', range(4))
def test_a_tag_is_read_and_its_corners_are_told_from_its_top_left(family, turns):
    image = draw([(7, SQUARE)], 320, 240, family=family)
    tag, corners = TagReader(family).read(image, np.roll(SQUARE, turns, axis=0))
    assert tag == 7
    assert np.array_equal(corners, SQUARE)


def test_a_tag_that_is_not_on_the_rig_is_none():
    image = draw([(7, SQUARE)], 320, 240)
    assert TagReader('36h11', ids=(0, 1)).read(image, SQUARE) is None


def test_a_plain_square_is_none():
    assert TagReader('36h11').read(np.full((240, 320), 110, np.uint8), SQUARE) is None

import numpy as np
import pytest

from dcdrw_tracker.tags.detector import TagDetector
from dcdrw_tracker.tags.tag_follower import Sighting, TagFollower
from tests.tracker.frames import draw, square

pytest.importorskip('cv2')
FRAME_NS = 16_666_667


def follower() -> TagFollower:
    return TagFollower(TagDetector(ids=(0, 1)), (0, 1))


def places(frame: int, speed: float = 4.0) -> list[tuple[int, np.ndarray]]:
    """Two tags that roll to the left, px per frame."""
    return [(0, square(340 - speed * frame, 90, 50, 0.04 * frame)), (1, square(440 - speed * frame, 110, 50, 1.0))]


def watch(one: TagFollower, frames, hidden=(), stray=()) -> list[Sighting]:
    return [
        one.follow(
            draw([tag for tag in places(k) if tag[0] not in hidden] + list(stray), 520, 200, blur=0.6, noise=2, seed=k),
            k * FRAME_NS,
        )
        for k in frames
    ]


def ids(sighting: Sighting) -> list[int]:
    return sorted(one.id for one in sighting.detections)


def test_moving_tags_are_followed_from_frame_to_frame_as_exactly_as_in_a_search_of_everything():
    for k, sighting in enumerate(watch(follower(), range(12))):
        assert ids(sighting) == [0, 1]
        for one in sighting.detections:
            assert one.corners == pytest.approx(dict(places(k))[one.id], abs=0.15)


def test_frames_that_are_lost_do_no_harm():
    assert [ids(one) for one in watch(follower(), [0, 1, 2, 7, 8, 14, 15])] == [[0, 1]] * 7


def test_a_tag_that_was_hidden_is_found_at_once_where_it_must_be():
    one = follower()
    watch(one, range(4))
    assert [ids(sighting) for sighting in watch(one, range(4, 24), hidden=(0,))] == [[1]] * 20
    assert ids(*watch(one, [24])) == [0, 1]


def test_a_tag_that_appears_anywhere_is_found_within_a_few_frames():
    one = follower()
    watch(one, range(3), hidden=(1,))
    assert ids(watch(one, range(3, 9))[-1]) == [0, 1]


def test_all_is_found_again_after_a_jump_in_time():
    one = follower()
    watch(one, range(3))
    assert ids(watch(one, [64, 65, 66, 67])[-1]) == [0, 1]  # more than a second on, and out of every region
    assert ids(watch(one, [0, 1, 2, 3])[-1]) == [0, 1]  # a recording that starts anew


def test_an_id_that_is_seen_twice_is_told_and_not_used():
    one = follower()
    [sighting] = watch(one, [0], stray=[(1, square(60, 100, 50))])
    assert ids(sighting) == [0]
    assert sighting.duplicates == (1,)


def test_a_stray_of_the_same_id_does_not_draw_a_followed_tag_away():
    one = follower()
    watch(one, range(3))
    for k, sighting in enumerate(watch(one, range(3, 9), stray=[(1, square(60, 100, 50))]), 3):
        assert ids(sighting) == [0, 1]
        rear = next(tag for tag in sighting.detections if tag.id == 1)
        assert rear.corners == pytest.approx(dict(places(k))[1], abs=0.15)

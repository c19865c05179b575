import sys

import numpy as np
import pytest

from dcdrw_msgs_py.tagging import FAMILIES
from dcdrw_tracker.tags.detector import Detection, TagDetector
from tests.tracker.frames import draw, square

pytest.importorskip('cv2')


def backends() -> list[str]:
    try:
        import pupil_apriltags  # noqa: F401
    except ImportError:
        return ['aruco']
    return ['aruco', 'apriltag']


def turn(corners):
    """How far a square is turned from upright, counter-clockwise as seen, and its size: one complex number."""
    flat = corners[:, 0] - 1j * corners[:, 1]
    return ((flat - flat.mean()) * np.array((-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j))).sum()


def errors(side, blur, noise, count=10, **options):
    """Root mean square of the errors of turn [deg] and corners [px], and the mean error of size, over turns."""
    turns, sizes, squares = [], [], []
    for seed in range(count):
        x, y, angle = np.random.default_rng(seed).uniform((118, 98, 0), (122, 102, 2 * np.pi))
        truth = square(x, y, side, angle)
        [one] = TagDetector(ids=(seed,)).detect(
            draw([(seed, truth)], 240, 200, blur=blur, noise=noise, seed=seed, **options)
        )
        ratio = turn(one.corners) / turn(truth)
        turns.append(np.degrees(np.angle(ratio)))
        sizes.append(abs(ratio) - 1.0)
        squares.append(((one.corners - truth) ** 2).sum(axis=1))
    return np.sqrt(np.mean(np.square(turns))), np.sqrt(np.mean(squares)), np.mean(sizes)


@pytest.mark.parametrize('backend', backends())
@pytest.mark.parametrize('family', FAMILIES)
@pytest.mark.parametrize('angle', [0.0, 2.0, 4.0])
def test_corners_go_clockwise_from_the_top_left_of_the_upright_tag(family, backend, angle):
    if (family, backend) == ('36h10', 'apriltag'):
        pytest.skip('this library does not have the family')
    truth = square(80.0, 75.0, 60.0, angle)
    [one] = TagDetector(family, backend=backend).detect(draw([(7, truth)], 160, 150, blur=0.5, noise=1, family=family))
    assert one.id == 7
    assert one.corners == pytest.approx(truth, abs=0.1)


@pytest.mark.parametrize(
    ('side', 'blur', 'noise', 'degrees', 'pixels'),
    [
        (120, 0.7, 2, 0.02, 0.05),
        (40, 0.7, 2, 0.06, 0.05),
        (20, 0.5, 2, 0.2, 0.15),
        (120, 2.0, 2, 0.03, 0.06),
        (40, 2.0, 2, 0.25, 0.5),
        (60, 0.7, 12, 0.1, 0.15),
    ],
)
def test_turn_and_corners_are_exact_to_a_fraction_of_a_pixel(side, blur, noise, degrees, pixels):
    turns, squares, _ = errors(side, blur, noise)
    assert turns < degrees
    assert squares < pixels


@pytest.mark.parametrize('side', [20, 40, 120])
def test_the_size_is_neither_too_large_nor_too_small(side):
    """It is what tells how far away the wheel is."""
    assert errors(side, 0.5, 2)[2] == pytest.approx(0.0, abs=0.1 / side)


@pytest.mark.parametrize('squeeze', [0.5, 0.7])
def test_a_tag_is_found_in_an_oblique_view(squeeze):
    for seed in range(6):
        truth = square(0.0, 0.0, 70.0, float(seed)) * (squeeze, 1.0)
        truth = truth / (1.0 + 0.0005 * truth[:, :1]) + (110.0, 90.0)
        [one] = TagDetector().detect(draw([(seed, truth)], 220, 180, blur=0.7, noise=2, seed=seed))
        assert one.corners == pytest.approx(truth, abs=0.15)


@pytest.mark.parametrize(
    ('side', 'blur', 'noise', 'background'),
    [(14, 0.5, 1, 110), (300, 1.0, 6, 110), (90, 4.0, 2, 110), (60, 1.0, 25, 110), (60, 1.0, 4, 230), (60, 1.0, 4, 20)],
)
def test_small_large_blurred_and_noisy_tags_are_found(side, blur, noise, background):
    size = max(200, 2 * side)
    truth = square(size / 2, size / 2, side, 0.4)
    [one] = TagDetector().detect(draw([(5, truth)], size, size, background, blur, noise))
    assert one.id == 5
    assert one.corners == pytest.approx(truth, abs=0.6)


def test_every_tag_of_a_full_picture_is_found_once():
    tags = [
        (3 * row + column, square(60 + 110 * column, 60 + 110 * row, 30 + 12 * column, row + 0.3 * column))
        for row in range(3)
        for column in range(3)
    ]
    found = TagDetector().detect(draw(tags, 340, 340, blur=0.6, noise=2))
    assert sorted(one.id for one in found) == list(range(9))
    for one in found:
        assert one.corners == pytest.approx(tags[one.id][1], abs=0.15)


def test_two_tags_of_one_id_are_both_told():
    tags = [(4, square(60, 60, 50)), (4, square(160, 60, 50, 1.0))]
    assert [one.id for one in TagDetector().detect(draw(tags, 220, 120))] == [4, 4]


@pytest.mark.parametrize('backend', backends())
def test_tags_that_are_not_mounted_are_ignored(backend):
    tags = [(4, square(60, 60, 50)), (6, square(160, 60, 50, 1.0))]
    assert [one.id for one in TagDetector(ids=(6, 8), backend=backend).detect(draw(tags, 220, 120))] == [6]


@pytest.mark.parametrize('noise', [0, 10, 60])
def test_nothing_is_seen_where_there_is_nothing(noise):
    assert TagDetector().detect(draw([], 320, 240, noise=noise)) == []


@pytest.mark.parametrize('x', [-10.0, 10.0, 30.0])
def test_a_tag_that_is_cut_by_the_pictures_edge_is_no_tag(x):
    assert TagDetector().detect(draw([(2, square(x, 80, 70, 0.2))], 160, 160)) == []


def test_a_known_tag_is_found_in_its_region():
    truth = square(400.0, 300.0, 60.0, 1.2)
    image = draw([(0, truth), (1, square(200, 200, 60))], 640, 480, blur=0.7, noise=3)
    [one] = TagDetector().detect_near(image, truth.min(axis=0) - 40, truth.max(axis=0) + 40, 55.0)
    assert one.id == 0
    assert one.corners == pytest.approx(truth, abs=0.1)
    assert TagDetector().detect_near(image, np.array((900.0, 10.0)), np.array((990.0, 100.0)), 55.0) == []


def test_measures_of_a_detection():
    one = Detection(0, square(10.0, 20.0, 8.0, 0.3))
    assert one.centre == pytest.approx((10.0, 20.0))
    assert one.side == pytest.approx(8.0)


def test_an_unknown_backend_is_refused():
    with pytest.raises(ValueError, match="backend must be aruco or apriltag, got 'yolo'"):
        TagDetector(backend='yolo')


@pytest.mark.parametrize(
    ('module', 'backend', 'message'),
    [
        ('cv2', 'aruco', r"need OpenCV: apt install python3-opencv, or pip install 'dcdrw\[camera\]'"),
        ('pupil_apriltags', 'apriltag', r"needs pupil-apriltags: pip install 'dcdrw\[apriltag\]'"),
    ],
)
def test_a_library_that_is_missing_is_named_with_what_installs_it(module, backend, message, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ValueError, match=message):
        TagDetector(backend=backend)


def test_an_opencv_without_aruco_is_told_from_none(monkeypatch):
    monkeypatch.delattr('cv2.aruco')
    with pytest.raises(ValueError, match='here without its ArUco module'):
        TagDetector()

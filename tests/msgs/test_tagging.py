import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dcdrw_msgs_py.quantity import build
from dcdrw_msgs_py.tagging import FAMILIES, Mount, TagGroup, TagParams, corners, mounts, seen, unseen

angles = st.floats(-10.0, 10.0)


def test_by_default_one_tag_sits_upright_on_each_hub():
    assert mounts(TagParams()) == (Mount('front', 0, 0.0, 0.0, 0.0, 0.16), Mount('rear', 1, 0.0, 0.0, 0.0, 0.16))


def test_downhill_is_the_pictures_left_and_outward_is_up():
    assert seen((1.0, 0.0)) == pytest.approx(-1.0)
    assert seen((0.0, 1.0)) == pytest.approx(1j)


def test_a_wheel_that_rolls_downhill_turns_counter_clockwise():
    assert seen((0.0, 1.0), psi=0.1).real < 0.0  # the spoke that stood up leans to the left, which is downhill


def test_a_slope_falls_to_the_left():
    downhill = complex(seen((1.0, 0.0), slope=0.1))
    assert downhill.real < 0.0
    assert downhill.imag == pytest.approx(-math.sin(0.1))


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), angles, angles)
def test_unseen_undoes_seen(x, y, psi, slope):
    assert unseen(seen((x, y), psi, slope), psi, slope) == pytest.approx((x, y), abs=1e-12)


def test_the_corners_of_an_upright_tag_go_clockwise_from_its_top_left():
    picture = seen(corners(Mount('front', 0, 0.0, 0.0, 0.0, 2.0)))
    assert picture == pytest.approx([-1 + 1j, 1 + 1j, 1 - 1j, -1 - 1j])


@given(angles, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), angles)
def test_a_mounting_angle_turns_a_tag_about_its_centre_as_psi_turns_the_wheel(angle, x, y, psi):
    turned = seen(corners(Mount('front', 0, angle, x, y, 0.3)), psi)
    centre = complex(seen((x, y), psi))
    assert turned.mean() == pytest.approx(centre)
    upright = seen(corners(Mount('front', 0, 0.0, 0.0, 0.0, 0.3)), psi + angle)
    assert turned - centre == pytest.approx(upright)


def test_each_wheel_may_have_several_tags():
    params = build(
        TagParams,
        {'front.ids': [3, 7], 'front.angles_deg': [0, 90.0], 'front.x': [0, 0.3], 'front.y': [0, -0.2], 'size': 0.1},
    )
    front, other, rear = mounts(params)
    assert other == Mount('front', 7, math.pi / 2, 0.3, -0.2, 0.1)
    assert (front.id, rear.id) == (3, 1)


def test_a_wheel_may_have_none():
    assert [mount.id for mount in mounts(TagParams(rear=TagGroup((), (), (), ())))] == [0]


@pytest.mark.parametrize(
    ('params', 'message'),
    [
        (TagParams(family='41h12'), "family must be one of 36h11, 16h5, 25h9, 36h10, got '41h12'"),
        (
            TagParams(front=TagGroup(ids=(0, 2))),
            r'front\.angles_deg must have one entry for each of front\.ids \[0, 2\]',
        ),
        (
            TagParams(rear=TagGroup(ids=(1,), y=())),
            r'rear\.y must have one entry for each of rear\.ids \[1\], got \[\]',
        ),
        (TagParams(rear=TagGroup(ids=(0,))), r'rear\.ids: tag 0 is mounted twice, on the front wheel and on the rear'),
        (TagParams(family='16h5', rear=TagGroup(ids=(30,))), r'rear\.ids: family 16h5 has no tag 30, only 0 to 29'),
    ],
)
def test_an_impossible_mounting_is_refused_by_name(params, message):
    with pytest.raises(ValueError, match=message):
        mounts(params)


def test_families_are_those_of_opencv():
    pytest.importorskip('cv2')
    from dcdrw_msgs_py.opencv import tag_dictionary

    for name, family in FAMILIES.items():
        dictionary = tag_dictionary(name)
        assert (dictionary.markerSize, len(dictionary.bytesList)) == family


def test_upright_is_as_the_apriltag_library_draws_it():
    pytest.importorskip('cv2')
    from dcdrw_msgs_py.opencv import tag_cells

    published = (
        '########',  # tag36_11_00000
        '#..#.#.#',
        '##...#.#',
        '##..####',
        '#.#.####',
        '##.#..##',
        '####.###',
        '########',
    )
    assert [''.join('#.'[cell] for cell in row) for row in tag_cells('36h11', 0).astype(int)] == list(published)


def test_a_tag_that_a_family_lacks_is_refused():
    pytest.importorskip('cv2')
    from dcdrw_msgs_py.opencv import tag_cells

    with pytest.raises(ValueError, match='family 16h5 has the tags 0 to 29, not 30'):
        tag_cells('16h5', 30)

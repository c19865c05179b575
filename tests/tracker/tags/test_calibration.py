"""Calibration: the paths of wheels that roll are taken apart into what made them."""

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dcdrw_msgs_py.rig import WheelShape
from dcdrw_tracker.tags.calibration import Calibration, Estimate, calibrate, rolled_path
from dcdrw_tracker.tags.view_plane import axes
from dcdrw_tracker.tags.wheel_view import PairView, WheelView

FRONT, REAR = WheelShape(0.9652, 12), WheelShape(0.8, 10)
RATE = 60.0


def roll(shape, steps, begin=0.1):
    """ψ at constant speed, and the hub's place: on a circle about each foot in turn."""
    psi = begin + np.linspace(0.0, 2 * shape.alpha * steps, round(35 * steps))
    places, foot, stance = [], 0.0, 0.0
    for angle in psi:
        while angle - stance > shape.alpha:
            foot += 2 * shape.length * math.sin(shape.alpha)
            stance += 2 * shape.alpha
        theta = angle - stance
        places.append((foot + shape.length * math.sin(theta), shape.length * math.cos(theta)))
    return psi, np.array(places)


def seen(shape, steps, zero=0.0, turn=0.0, tag=(0.0, 0.0), noise=0.0, seed=0):
    """ψ and the hub's place as they are seen: downhill is turned, the zero is off, and so is the hub beneath a tag."""
    random = np.random.default_rng(seed)
    psi, hub = roll(shape, steps)
    cos, sin = np.cos(psi), np.sin(psi)
    x, y = tag
    hub = hub + np.stack((cos * x + sin * y, -sin * x + cos * y), axis=1)  # the wheel's frame turns clockwise
    # Turned counter-clockwise in the picture: clockwise where downhill is to the right.
    cos, sin = math.cos(turn), math.sin(turn)
    hub = hub @ np.array(((cos, -sin), (sin, cos))) + (3.0, -1.0)
    hub += noise * random.standard_normal(hub.shape)
    return psi - zero + turn + noise * random.standard_normal(psi.size), hub


def views(front, rear):
    """Views of two such wheels."""
    count = max(len(front[0]), len(rear[0]))

    def wheel(psi, hub, index):
        if index >= len(psi):
            return None
        return WheelView(float(psi[index] % math.tau), tuple(hub[index].tolist()), 0.02, 1, 50.0)

    return [PairView(round(i / RATE * 1e9), wheel(*front, i), wheel(*rear, i)) for i in range(count)]


def test_rolled_path_is_that_of_a_wheel_on_its_feet():
    psi, hub = roll(FRONT, 5)
    path = FRONT.length * rolled_path(FRONT.alpha, psi)
    assert path.real == pytest.approx(hub[:, 0])
    assert path.imag == pytest.approx(hub[:, 1])


ZERO = st.floats(-0.25, 0.25)
PLACE = st.floats(-0.05, 0.05)


@settings(max_examples=12, deadline=None)
@given(ZERO, ZERO, st.floats(-0.1, 0.1), PLACE, PLACE, st.floats(4.0, 9.0), st.floats(0.95, 1.05))
def test_what_made_a_path_is_found(zero1, zero2, turn, x, y, steps, longer):
    """Whatever the zero within half a step, the slope, the place of the tags, and a length that was measured badly."""
    found = calibrate(
        views(seen(FRONT, steps, zero1, turn, (x, y)), seen(REAR, steps, zero2, turn, (y, x))),
        FRONT._replace(length=FRONT.length * longer),
        REAR,
    )
    assert found.turn.value == pytest.approx(turn, abs=1e-5)
    for wheel, zero, shape, (tag_x, tag_y) in ((found.front, zero1, FRONT, (x, y)), (found.rear, zero2, REAR, (y, x))):
        assert wheel.zero.value == pytest.approx(zero, abs=1e-5)
        assert wheel.length.value == pytest.approx(shape.length, abs=1e-5)
        assert (wheel.tag_x.value, wheel.tag_y.value) == pytest.approx((tag_x, tag_y), abs=1e-4)
        assert wheel.misfit < 1e-4


def test_errors_are_about_as_large_as_told():
    """Over many rolls with noise: none is far off by its own measure, and none boasts."""
    ratios = []
    for seed in range(12):
        found = calibrate(
            views(
                seen(FRONT, 7, 0.1, 0.03, noise=0.002, seed=seed),
                seen(REAR, 7, -0.05, 0.03, noise=0.002, seed=100 + seed),
            ),
            FRONT,
            REAR,
        )
        for (value, spread), truth in (
            (found.front.zero, 0.1),
            (found.rear.zero, -0.05),
            (found.turn, 0.03),
            (found.front.length, FRONT.length),
            (found.rear.length, REAR.length),
            (found.front.tag_x, 0.0),
            (found.rear.tag_y, 0.0),
        ):
            ratios.append((value - truth) / spread)
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 2.0


@pytest.mark.parametrize('slant', [(0.0, 0.0), (0.5, -0.1), (-0.6, 0.2)])
@pytest.mark.parametrize('rolls', [(0.0, 0.05), (0.1, -0.2)])
def test_roll_is_that_whose_axes_are_turned_so_far(slant, rolls):
    before, after = (axes(np.array(slant), roll) for roll in rolls)
    turn = math.atan2(after.right @ before.up, after.right @ before.right)
    wheel = None
    assert Calibration(Estimate(turn, 0.0), wheel, wheel).roll(before) == pytest.approx(rolls[1])


def test_a_wheel_that_is_hidden_meanwhile_is_calibrated_from_its_longest_way():
    film = views(seen(FRONT, 12, 0.1), seen(REAR, 8, 0.1))
    for index in range(100, 130):
        film[index] = film[index]._replace(front=None)
    found = calibrate(film, FRONT, REAR)
    assert found.front.steps == pytest.approx((12 * 35 - 130) / 35, abs=1)
    assert found.front.zero.value == pytest.approx(0.1, abs=1e-4)


def test_stray_views_do_not_count():
    film = views(seen(FRONT, 8, 0.1, noise=1e-4), seen(REAR, 8, noise=1e-4))
    for index in range(5, 250, 17):
        front = film[index].front
        film[index] = film[index]._replace(front=front._replace(hub=(front.hub[0] + 0.2, front.hub[1])))
    found = calibrate(film, FRONT, REAR)
    assert found.front.zero.value == pytest.approx(0.1, abs=2e-3)
    assert found.front.frames == len([view for view in film if view.front]) - 15


def spun(shape, steps):
    """Seen by a camera that follows: the hub goes up and down only."""
    psi, hub = seen(shape, steps)
    return psi, hub * (0.001, 1.0)


def walked(shape, steps):
    """Carried along, while it turns, by somebody."""
    psi, hub = seen(shape, steps)
    return psi, hub + np.stack((np.zeros(len(psi)), 0.1 * np.sin(7.0 * psi)), axis=1)


@pytest.mark.parametrize(
    ('front', 'shape', 'message'),
    [
        ((np.empty(0), np.empty((0, 2))), FRONT, 'the front wheel was not seen'),
        (seen(FRONT, 2.5), FRONT, 'the front wheel takes 3 steps before the camera, but 4 are needed'),
        (
            spun(FRONT, 8),
            FRONT,
            'the hub of the front wheel travels 0.00 m in 8 steps, not about 4.00 m: the camera must',
        ),
        (seen(FRONT, 8), FRONT._replace(spokes=10), 'fits a wheel of 12 spokes, not 10 (front.spokes)'),
        (walked(FRONT, 8), FRONT, 'does not travel as that of a rolling wheel: it is '),
        (seen(FRONT, 8, turn=0.02), FRONT, 'the hubs do not travel along one slope: their directions are 1.1° apart'),
    ],
)
def test_what_is_no_roll_is_refused(front, shape, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        calibrate(views(front, seen(REAR, 8)), shape, REAR)

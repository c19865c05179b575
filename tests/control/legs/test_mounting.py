import math

import numpy as np
import pytest

from dcdrw_control.legs.mounting import Direction, SagittalAxis


def test_the_axis_is_the_one_about_which_most_is_turned():
    random, axis = np.random.default_rng(7), np.array((0.36, 0.48, -0.8))
    sagittal = SagittalAxis()
    for turning, other in zip(random.normal(0.0, 4.0, 400), random.normal(0.0, 0.5, (400, 3)), strict=True):
        sagittal.update(tuple((turning * axis + other).tolist()), 0.005)
    assert abs(sagittal.part(tuple(axis.tolist()))) == pytest.approx(1.0, abs=0.01)


def test_the_axis_never_turns_to_its_opposite():
    """However long one walks, and turns about other axes meanwhile."""
    sagittal, random = SagittalAxis(), np.random.default_rng(8)
    sagittal.update((0.0, 5.0, 0.0), 0.005)
    known = sagittal.part((0.0, 5.0, 0.0))
    for stride in range(200):
        for rate in random.normal(0.0, (1.0, 4.0, 1.5), (50, 3)).tolist():
            sagittal.update(tuple(rate), 0.005)
        sagittal.forget()
        assert math.copysign(1.0, sagittal.part((0.0, 5.0, 0.0))) == math.copysign(1.0, known), stride


@pytest.mark.parametrize('sign', [+1, -1])
def test_the_swing_is_what_ends_in_an_impact(sign):
    direction = Direction()
    direction.learn(-sign, 8.0, 6.0)  # a push-off: as rough before as after
    assert direction.sign == 0
    direction.learn(sign, 5.0, 90.0)
    assert direction.sign == sign
    direction.learn(sign, 8.0, 4.0)  # one soft step
    assert direction.sign == sign


def test_an_acceleration_that_never_changes_tells_no_direction():
    direction = Direction()
    for sign in (+1, -1, +1, -1):
        direction.learn(sign, 0.0, 0.0)
    assert direction.sign == 0

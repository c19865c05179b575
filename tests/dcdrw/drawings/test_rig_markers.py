"""The drawing stands where the model does."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dcdrw.drawings.rig_markers import FOOTFALLS, MarkerParams, RigView, Shape, about_y, force_colour
from dcdrw_msgs_py.diagnosis import Diagnosis, Level
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams, WheelParams, WheelShape
from dcdrw_msgs_py.samples import CouplerSample, JointSample, Turn
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams

UNEQUAL = RigParams(WheelParams(0.9, 10.0, 12.0), WheelParams(0.7, 8.0, 10.0), slope=math.radians(6.0))


def view_of(rig: RigParams, **more) -> RigView:
    front, rear = (WheelShape(wheel.length, wheel.spokes) for wheel in (rig.front, rig.rear))
    return RigView(MarkerParams(front, rear, rig.S0, rig.slope, **more))


def samples(rig: RigParams, seconds: float, rate: float = 60.0):
    source = SimulatedRig(rig, SimulatorParams())
    return [source.read(k / rate, 10**9 + round(k * 1e9 / rate)) for k in range(int(seconds * rate))]


def drawn(view: RigView) -> dict[str, Shape]:
    shapes = view.shapes()
    assert len({shape.name for shape in shapes}) == len(shapes)
    return {shape.name: shape for shape in shapes}


def points(shape: Shape) -> np.ndarray:
    """The points of a shape in the frame of the drawing, by SciPy's quaternions."""
    return Rotation.from_quat(about_y(shape.turn)).apply(np.array(shape.points)) + shape.position


def along_slope(position, slope: float):
    """Place down the slope and height above it of a point of the drawing."""
    x, _, z = np.moveaxis(np.asarray(position), -1, 0)
    return x * math.cos(slope) - z * math.sin(slope), x * math.sin(slope) + z * math.cos(slope)


@given(st.floats(-10.0, 10.0))
def test_a_turn_rolls_downhill(turn):
    rotation = Rotation.from_quat(about_y(turn))
    np.testing.assert_allclose(rotation.as_matrix(), Rotation.from_euler('y', turn).as_matrix(), atol=1e-12)
    # The top of a wheel goes where the rig goes.
    np.testing.assert_allclose(Rotation.from_quat(about_y(math.pi / 2)).apply([0, 0, 1]), [1, 0, 0], atol=1e-12)


def test_a_person_s_trial_shows_left_and_right_feet_in_the_order_1_4_2_3_and_the_force_on_the_person():
    view, falls = view_of(RigParams(k=16.0, b=10.0)), []
    for sample in samples(RigParams(k=16.0, b=10.0), 12.0):
        view.update(sample)
        shapes = {shape.name: shape for shape in view.shapes(person_force=8.0)}
        for foot, name in enumerate(('front_left', 'front_right', 'rear_left', 'rear_right'), start=1):
            if shape := shapes.get(f'{name}_feet'):
                ahead = max(x for x, _, _ in shape.points)
                if (foot, ahead) not in falls:
                    falls.append((foot, ahead))
                assert math.copysign(1.0, shape.position[1]) == (1.0 if foot % 2 else -1.0)
    feet = [foot for foot, _ in falls][-12:]
    assert all((one, other) in ((1, 4), (4, 2), (2, 3), (3, 1)) for one, other in pairwise(feet))
    assert not any(name.endswith('_footfalls') for name in shapes)
    forward = shapes['person_force'].points
    backward = next(shape for shape in view.shapes(person_force=-8.0) if shape.name == 'person_force').points
    assert forward[1][0] == -backward[1][0] > 0.0
    assert 'on the person +8.0 N' in shapes['label'].text
    assert 'person_force' not in {shape.name for shape in view.shapes(person_force=math.nan)}


@pytest.mark.parametrize('rig', [RigParams(), UNEQUAL], ids=['equal', 'unequal'])
def test_hubs_are_as_far_apart_as_the_coupler_is_long_and_feet_stand_on_the_slope(rig):
    view = view_of(rig)
    for sample in samples(rig, 6.0):
        assert view.update(sample)
        shapes = drawn(view)
        hubs = {wheel: points(shapes[f'{wheel}_wheel'])[0] for wheel in (FRONT, REAR)}
        (x1, _, z1), (x2, _, z2) = hubs[FRONT], hubs[REAR]
        assert math.hypot(x1 - x2, z1 - z2) == pytest.approx(sample.coupler.length, abs=1e-9)
        for x, z in ((x1, z1), (x2, z2)):  # the coupler reaches from hub to hub
            assert np.hypot(*(points(shapes['coupler'])[:, ::2] - (x, z)).T).min() == pytest.approx(0.0, abs=1e-9)
        for wheel in (FRONT, REAR):
            foot = points(shapes[f'{wheel}_stance_leg'])[1]
            assert along_slope(foot, rig.slope)[1] == pytest.approx(0.0, abs=1e-12)
        middle = along_slope(0.5 * (hubs[FRONT] + hubs[REAR]), rig.slope)[0]
        assert middle == pytest.approx(0.0, abs=1e-12)  # the frame follows


@pytest.mark.parametrize('rig', [RigParams(), UNEQUAL], ids=['equal', 'unequal'])
def test_the_picture_does_not_depend_on_when_one_begins_to_look(rig):
    early, late = view_of(rig), view_of(rig)
    for sample in (all_of := samples(rig, 5.0)):
        early.update(sample)
    for sample in all_of[170:]:
        late.update(sample)
    for name in ('front_wheel', 'rear_stance_leg', 'coupler'):
        one, other = drawn(early)[name], drawn(late)[name]
        np.testing.assert_allclose(points(one), points(other), atol=1e-9)


def test_without_a_coupler_the_feet_are_those_of_a_regular_gait():
    """At any time in a trial that slips no step, whatever its phase: S0 apart, and σ more while n = 1."""
    rig = RigParams()
    heard = [sample._replace(coupler=CouplerSample()) for sample in samples(rig, 8.0)]
    for first in range(0, len(heard), 37):
        view = view_of(rig)
        for sample in heard[first:]:
            view.update(sample)
        truth = samples(rig, 8.0)[-1].coupler.length
        shapes = drawn(view)
        distance = np.subtract(shapes['front_wheel'].position, shapes['rear_wheel'].position)[::2]
        assert np.hypot(*distance) == pytest.approx(truth, abs=1e-9)


def test_spokes_stand_where_the_rotation_says():
    rig, view = UNEQUAL, view_of(UNEQUAL)
    for sample in samples(rig, 3.0):
        view.update(sample)
    for wheel, shape, psi in ((FRONT, rig.front, sample.front.angle), (REAR, rig.rear, sample.rear.angle)):
        spread, stance = drawn(view)[f'{wheel}_wheel'], drawn(view)[f'{wheel}_stance_leg']
        legs = np.vstack((points(spread)[1:-2:2], points(stance)[1:]))
        x, _, z = (legs - spread.position).T
        np.testing.assert_allclose(np.hypot(x, z), shape.length)
        got = np.sort(np.arctan2(-x, -z) % math.tau)
        spokes = np.sort((psi + rig.slope + 2.0 * shape.alpha * np.arange(shape.spokes)) % math.tau)
        np.testing.assert_allclose(got, spokes, atol=1e-9)


def test_footfalls_are_where_the_feet_stood():
    rig, view, stood = RigParams(), view_of(RigParams(), follow=False), {FRONT: [], REAR: []}
    for sample in samples(rig, 8.0):
        view.update(sample)
        for wheel, feet in stood.items():
            foot = along_slope(points(drawn(view)[f'{wheel}_stance_leg'])[1], rig.slope)[0]
            if not feet or abs(foot - feet[-1]) > 1e-9:
                feet.append(foot)
    for wheel, feet in stood.items():
        marks = along_slope(points(drawn(view)[f'{wheel}_footfalls']), rig.slope)
        np.testing.assert_allclose(marks[0][::2], feet[-FOOTFALLS:], atol=1e-9)
        np.testing.assert_allclose(marks[1], 0.0, atol=1e-9)
        np.testing.assert_allclose(np.diff(feet), getattr(rig, wheel).step_length)


def test_the_frame_may_stay_at_the_first_foothold():
    view = view_of(RigParams(), follow=False)
    *_, last = samples(RigParams(), 5.0)
    for sample in samples(RigParams(), 5.0):
        view.update(sample)
    x = drawn(view)['rear_wheel'].position[0]
    assert x == pytest.approx(last.rear.angle * RigParams().rear.length, rel=0.1)


def test_a_source_that_starts_anew_is_drawn_anew():
    view = view_of(RigParams())
    for sample in samples(RigParams(), 4.0):
        view.update(sample)
    assert view.runs == 1
    assert 'front_footfalls' in drawn(view)
    for k in range(5):
        view.update(JointSample(1 + k * 10**7, Turn(-0.2, 0.0), Turn(0.1, 0.0)))
    assert view.runs == 2
    assert 'front_footfalls' not in drawn(view)


def test_nothing_is_drawn_before_the_first_sample_or_from_nonsense():
    view = view_of(RigParams())
    assert view.shapes() == ()
    assert not view.update(JointSample(1, Turn(math.nan), Turn(0.0)))
    assert view.shapes() == ()


def test_what_is_written_is_the_phase_the_coupler_and_what_the_monitor_says():
    view = view_of(RigParams())
    view.update(JointSample(1, Turn(0.0, 1.0), Turn(-math.pi / 24, 1.0), CouplerSample(1.2, 0.0, -3.25)))
    *_, label = view.shapes(Diagnosis(Level.WARN, 'slipped a step: n = 2', {}))
    assert label.text.splitlines() == [
        '25.0 % of a step, 12.5 % of a stride',
        'n = 0, coupler -3.2 N',
        'slipped a step: n = 2',
    ]
    view.update(JointSample(2, Turn(0.0, 1.0), Turn(-math.pi / 24, 1.0)))
    *_, acting = view.shapes(None, 'active')
    assert 'synchronizer active' in acting.text.splitlines()
    *_, silent = view.shapes()
    assert silent.text.splitlines()[1:] == ['n = 0']
    assert silent.colour != label.colour
    assert label.text.isascii()  # RViz has no other letters


def test_colour_tells_the_force():
    shares = np.linspace(-1.0, 1.0, 9)
    colours = [force_colour(share) for share in shares]
    assert all(one != other for one, other in pairwise(colours))
    assert force_colour(-7.0) == force_colour(-1.0)
    assert force_colour(math.nan) not in colours


def test_rviz_can_draw_each_shape():
    """RViz refuses lines without width, points without partner, and invisible colours."""
    view = view_of(UNEQUAL._replace(rear=WheelParams(0.7, 8.0, 9.5)))
    for sample in samples(UNEQUAL, 4.0):
        view.update(sample)
    for shape in view.shapes():
        assert shape.size > 0.0
        assert all(0.0 <= part <= 1.0 for part in shape.colour)
        assert shape.colour[3] > 0.0
        assert bool(shape.text) != (len(shape.points) >= 2 and len(shape.points) % 2 == 0)
        assert np.isfinite([*shape.position, shape.turn, *np.ravel(shape.points)]).all()

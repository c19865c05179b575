import math

import numpy as np
import pytest

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.figures import model_figures as figures
from dcdrw_sim.model.wheel import gentlest_slope
from dcdrw_sim.relatives.footfall_order import steady_contacts
from dcdrw_sim.relatives.rigid_pair import RigidPair, energy_per_metre, fastest_phase, slope_for_velocity
from dcdrw_sim.relatives.rimless_wheel import limit_cycle_velocity

Figure = pytest.importorskip('matplotlib.figure').Figure

PAPER = RigParams().resolved()
WHEEL, SLOPE, GRAVITY = PAPER.front, PAPER.slope, PAPER.gravity


@pytest.fixture
def axes():
    figure = Figure(layout='constrained')
    axes = figure.subplots()
    yield axes
    figure.savefig('/dev/null', format='png')  # whatever was drawn can be rendered


def line(axes, label):
    [found] = [line for line in axes.lines if line.get_label().startswith(label)]
    return np.array(found.get_data())


def labels(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def test_basin_tells_rolling_from_standing(axes):
    figures.draw_basin(axes, WHEEL, SLOPE, GRAVITY, pixels=(20, 40))
    assert labels(axes) == ['limit cycle', 'at rest on two spokes', 'comes to roll', 'comes to stand']
    theta, omega = line(axes, 'limit cycle')
    assert theta[[0, -1]] == pytest.approx([-15.0, 15.0])
    assert omega[0] == pytest.approx(omega[-1] * math.cos(2 * WHEEL.alpha))


@pytest.mark.parametrize('slope_deg', [0.5, 20.0])
def test_basin_of_a_single_fate_is_drawn_too(axes, slope_deg):
    figures.draw_basin(axes, WHEEL, math.radians(slope_deg), GRAVITY, pixels=(10, 10))
    assert (line(axes, 'at rest').size == 0) == (slope_deg > 15.0)


def test_speed_of_a_wheel_begins_at_the_gentlest_slope(axes):
    figures.draw_wheel_speed(axes, WHEEL, SLOPE, GRAVITY)
    slopes, speeds = axes.lines[0].get_data()
    assert slopes[0] == pytest.approx(math.degrees(gentlest_slope(WHEEL)))
    assert np.all(np.diff(speeds) > 0.0)
    assert line(axes, '2.00°')[1] == pytest.approx(limit_cycle_velocity(WHEEL, SLOPE, GRAVITY))


def test_speed_against_phase_shows_its_maximum(axes):
    figures.draw_speed(axes, PAPER, coupled=(0.527, 0.88), points=9)
    phases, speeds = line(axes, 'rigid bar')
    assert phases[4] == pytest.approx(50.0)
    assert np.argmax(speeds) == 4
    assert line(axes, 'fastest')[0] == pytest.approx(100.0 * fastest_phase(PAPER))
    assert line(axes, 'both strike at once')[1] == pytest.approx(limit_cycle_velocity(WHEEL, SLOPE, GRAVITY))
    assert line(axes, 'spring and damper')[:, 0] == pytest.approx([52.7, 0.88])


def test_speed_where_few_phases_roll_is_drawn_without_the_others(axes):
    figures.draw_speed(axes, PAPER._replace(slope=math.radians(0.5)), points=9)
    _, speeds = line(axes, 'rigid bar')
    assert np.isnan(speeds[0])
    assert not np.isnan(speeds[4])
    assert labels(axes)[:1] == ['rigid bar']
    assert len(labels(axes)) == 2


def test_energy_per_metre_is_that_of_the_slope_beside_it(axes):
    figures.draw_energy(axes, PAPER, points=5)
    _, cost = line(axes, 'rigid bar')
    velocity = RigidPair(PAPER, 0.5).gait().velocity
    assert cost[1] == pytest.approx(
        energy_per_metre(PAPER._replace(slope=slope_for_velocity(PAPER, 0.25, velocity))), rel=1e-4
    )
    assert np.argmin(cost) == 2
    [slope] = axes.child_axes
    axes.figure.draw_without_rendering()
    low, high = axes.get_ylim()
    assert slope.get_ylim() == pytest.approx(
        [math.degrees(math.asin(value / (20.0 * GRAVITY))) for value in (low, high)]
    )


def test_energy_on_too_gentle_a_slope_is_refused(axes):
    with pytest.raises(ValueError, match='too gentle'):
        figures.draw_energy(axes, PAPER._replace(slope=0.001))


def test_hildebrand_diagram_has_a_bar_for_every_contact(axes):
    contacts = steady_contacts(0.5, 2)
    figures.draw_hildebrand(axes, contacts, title='walk')
    assert len(axes.patches) == len(contacts)
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names == ['rear right 4', 'front right 2', 'front left 1', 'rear left 3']
    for bar, contact in zip(axes.patches, contacts, strict=True):
        assert bar.get_x() == pytest.approx(contact.start)
        assert bar.get_width() == pytest.approx(0.5)
        assert names[round(bar.get_y() + bar.get_height() / 2)].endswith(str(contact.foot))
    assert axes.get_title() == 'walk   1-4-2-3'

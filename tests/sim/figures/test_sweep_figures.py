"""Drawings of sweeps, regimes, basins and of the experiment: they show what the numbers say."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from dcdrw_sim.map.regression import fit_affine
from dcdrw_sim.map.return_map import ReturnMap
from dcdrw_sim.model.presets import preset
from dcdrw_sim.motion.ensemble import spread
from dcdrw_sim.rig.simulator import SimulatorParams
from dcdrw_sim.study.regimes import basin, gentlest_slopes, least_speeds, stall_bands
from dcdrw_sim.study.sweep import Axis, papers_sweep

Figure = pytest.importorskip('matplotlib.figure').Figure
pytest.importorskip('xarray')
pytest.importorskip('netCDF4')

from dcdrw_sim.figures import regime_figures, sweep_figures  # noqa: E402
from dcdrw_sim.study.sweep_dataset import open_sweep  # noqa: E402
from dcdrw_sim.study.sweep_run import run_sweep  # noqa: E402

RIG = preset('paper-sweep')
SWEEP = papers_sweep()._replace(x=Axis('k', (1e-3, 5e-3, 1e-2)), y=Axis('b', (0.1, 0.2, 0.8, 6.0)), phases=(0.1, 0.9))


@pytest.fixture(scope='module')
def dataset(tmp_path_factory):
    path = tmp_path_factory.mktemp('sweep') / 'sweep.nc'
    with ThreadPoolExecutor(2) as executor:
        run_sweep(SWEEP, path, executor, 3)
    with open_sweep(path) as opened:
        yield opened.load()


@pytest.fixture
def axes():
    figure = Figure(layout='constrained')
    axes = figure.subplots()
    yield axes
    figure.savefig('/dev/null', format='png')  # whatever was drawn can be rendered


def line(axes, label):
    [found] = [line for line in axes.lines if str(line.get_label()).startswith(label)]
    return np.array(found.get_data())


def test_valid_couplers_walk_and_come_into_the_band(dataset):
    valid = sweep_figures.is_valid(dataset)
    assert valid.tolist() == [[True, True, False, False]] * 3


def test_best_coupler_has_the_smallest_multiplier(dataset):
    best = sweep_figures.best_coupler(dataset)
    assert (best.k, best.b) == (1e-2, 0.1)
    exact = ReturnMap(RIG._replace(k=1e-2, b=0.1)).fixed_point()
    assert best.multiplier == pytest.approx(abs(exact.multipliers[0]), abs=1e-7)
    with pytest.raises(ValueError, match='no coupler of this sweep'):
        sweep_figures.best_coupler(dataset.isel(b=[2]))


def test_all_valid_motions_are_drawn(axes, dataset):
    sweep_figures.draw_trajectories(axes, dataset)
    assert [len(collection.get_segments()) for collection in axes.collections] == [6, 6]
    assert axes.get_title() == '6 of 12 couplers, 12 motions'
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ['10 %', '90 %']
    assert axes.collections[0].get_segments()[0][0].tolist() == pytest.approx([0.0, 12.0])


def test_raw_eigenvalues_are_all_one_and_multipliers_are_not(axes, dataset):
    from matplotlib.colors import Normalize

    for name, low, high in (('raw_eigenvalues', 0.99999, 1.00001), ('multipliers', 0.7, 0.96)):
        mesh = sweep_figures.draw_eigenvalues(axes, dataset, name, Normalize(0.7, 1.0))
        shown = mesh.get_array().compressed()
        assert len(shown) == 6
        assert low < shown.min() <= shown.max() < high
    assert axes.get_xscale() == axes.get_yscale() == 'log'


def test_prediction_follows_the_motion(axes, dataset):
    found = sweep_figures.draw_best(axes, dataset, 'affine')
    simulated, predicted = axes.lines[0].get_ydata(), axes.lines[1].get_ydata()
    assert predicted[0] == simulated[0] == pytest.approx(12.0)
    assert predicted[-1] == pytest.approx(simulated[-1], abs=0.1)
    assert np.abs(predicted - simulated).max() < 1.5
    assert found.matrix.shape == (3, 3)


def test_raw_prediction_comes_to_the_same_with_an_eigenvalue_one(axes, dataset):
    found = sweep_figures.draw_best(axes, dataset, 'raw')
    assert abs(found.eigenvalues[0]) == pytest.approx(1.0, abs=1e-5)
    assert axes.lines[1].get_ydata()[-1] == pytest.approx(axes.lines[0].get_ydata()[-1], abs=0.1)


def test_prediction_of_a_linear_motion_is_exact():
    matrix, offset = np.diag([0.5, 0.9, -0.2]), np.array([1.0, 2.0, 3.0])
    states = [np.array([3.0, -1.0, 4.0])]
    for _ in range(6):
        states.append(matrix @ states[-1] + offset)
    found = fit_affine([np.array(states)])
    assert sweep_figures.predict(found, states[0], 7) == pytest.approx(np.array(states), abs=1e-9)


def test_experiment_begins_at_its_phase():
    figure = Figure()
    angles, phase = figure.subplots(2, 1)
    rig, start = SimulatorParams().start(preset('paper'))
    sweep_figures.draw_experiment(angles, phase, rig, start, 5.0, 6.0)
    time, phi = line(phase, 'φ')
    assert (time[0], time[-1]) == (0.0, 5.0)
    assert phi[0] == pytest.approx(0.216 * 30.0)
    assert line(angles, 'θ₁')[1][0] == pytest.approx(-15.0)
    assert np.nanmax(line(angles, 'θ₂')[1]) == pytest.approx(15.0, abs=0.1)
    figure.savefig('/dev/null', format='png')


def test_map_over_couplers_has_the_edges_of_the_stall_band(axes, dataset):
    regime_figures.draw_coupler_regimes(axes, dataset, 200.0)
    regime_figures.label_regimes(axes)
    ks, edge = line(axes, 'the limit cycle ends')
    low, high = stall_bands(spread(RIG, 1, {'k': ks[:1]}))
    assert edge[0] == pytest.approx(low.values[0])
    assert axes.lines[1].get_ydata()[0] == pytest.approx(high.values[0])
    regimes = np.array(axes.collections[0].get_array()).reshape(4, 3)
    assert regimes[:, 0].tolist() == [1.0, 1.0, 4.0, 1.0]  # not yet steady after 200 time units; stalls


def test_map_over_slopes_has_the_gentlest_slopes(axes, tmp_path):
    path = tmp_path / 'slopes.nc'
    sweep = SWEEP._replace(
        x=Axis('slope_deg', (1.2, 1.6, 2.4)), y=Axis('b', (0.05, 1.0, 8.0)), seconds=300.0, trajectories=False
    )
    with ThreadPoolExecutor(2) as executor:
        run_sweep(sweep, path, executor, 3)
    with open_sweep(path) as slopes:
        regime_figures.draw_slope_regimes(axes, slopes)
    regime_figures.label_regimes(axes)
    exact, bs = line(axes, 'the limit cycle ends')
    assert exact[0] == pytest.approx(math.degrees(gentlest_slopes(spread(RIG, 1, {'b': bs[:1]})).values[0]))
    assert line(axes, 'the same in closed form')[0] == pytest.approx(exact, rel=0.03)
    regimes = np.array(axes.collections[0].get_array()).reshape(3, 3)
    assert (regimes == 4.0).tolist() == [[True, False, False], [True, True, False], [False] * 3]


def test_basin_shows_what_stalls_and_the_edge_of_it(axes):
    phases = np.array([0.1, 0.5, 0.9])
    found = basin(RIG, phases, [0.4, 1.0, 1.5], 200.0)
    edge = least_speeds(RIG, phases, 200.0)
    mesh = regime_figures.draw_basin(axes, RIG, found, (phases, edge))
    assert mesh.get_array().reshape(3, 3).mask.tolist() == [[True] * 3, [False] * 3, [False] * 3]
    assert line(axes, 'least speed')[1] == pytest.approx(100.0 * edge)
    assert axes.get_title() == 'k̂ = 0.005, b̂ = 0.15'

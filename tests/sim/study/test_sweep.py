"""Sweeps: what they compute, how they are kept, and that nothing is lost on the way."""

import json
import math
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.model.presets import preset
from dcdrw_sim.study.sweep import (
    Axis,
    Sweep,
    block_size,
    blocks,
    check_sweep,
    compute,
    default_axis,
    default_seconds,
    papers_sweep,
    targets,
)
from dcdrw_sim.study.sweep_dataset import VARIABLES, open_sweep, sweep_of, to_dataset
from dcdrw_sim.study.sweep_run import Progress, is_complete, run_sweep
from dcdrw_sim.study.verdict import Verdict
from tests.patience import PATIENCE

SMALL = Sweep(preset('paper-sweep'), Axis('k', (1e-4, 1e-3, 1e-2)), Axis('b', (0.1, 0.3, 1.0, 3.0)), 80.0, (0.35, 0.6))
ALL = (slice(0, 3), slice(0, 4))


def run(sweep, path, report=lambda progress: None):
    with ThreadPoolExecutor(2) as executor:
        run_sweep(sweep, path, executor, 3, report)


def assert_same(path, other):
    with open_sweep(path) as one, open_sweep(other) as two:
        assert one.attrs == two.attrs or str(one.attrs) == str(two.attrs)  # NaN
        assert set(one.variables) == set(two.variables)
        for name in one.variables:
            assert one[name].values.tobytes() == two[name].values.tobytes(), name


@pytest.fixture
def one_by_one(monkeypatch):
    """Sweeps in blocks of two points."""
    monkeypatch.setattr('dcdrw_sim.study.sweep_run.block_size', lambda sweep: 2)


# What is computed


def test_the_papers_sweep_is_the_default():
    sweep = papers_sweep()
    assert sweep.shape == (50, 50)
    assert (sweep.x.name, sweep.x.values[0], sweep.x.values[-1]) == ('k', 1e-4, 1e-2)
    assert (sweep.y.name, sweep.y.values[0], sweep.y.values[-1]) == ('b', 0.1, 10.0)
    assert np.diff(np.log(sweep.x.values)) == pytest.approx(math.log(100) / 49)
    assert (len(sweep.phases), sweep.seconds) == (9, 200.0)
    assert math.degrees(sweep.rig.slope) == pytest.approx(1.75)
    check_sweep(sweep)


def test_its_ranges_are_scaled_to_a_rig():
    rig, front = RigParams(), RigParams().front
    assert default_axis('k', rig).values[0] == pytest.approx(1e-4 * front.mass * rig.gravity / front.length)
    assert default_axis('b', rig).values[0] == pytest.approx(0.1 * front.mass * math.sqrt(rig.gravity / front.length))
    assert default_seconds(rig) == pytest.approx(200.0 * math.sqrt(front.length / rig.gravity))


@pytest.mark.parametrize('size', [1, 3, 4, 7, 8, 100])
def test_blocks_cover_every_point_once(size):
    points = np.zeros(SMALL.shape, int)
    for block in blocks(SMALL, size):
        assert points[block].size <= max(size, 1)
        points[block] += 1
    assert (points == 1).all()


def test_longer_motions_come_in_smaller_blocks():
    assert block_size(SMALL) > block_size(SMALL._replace(seconds=400.0)) >= 1


@pytest.mark.parametrize('size', [1, 5])
def test_the_result_does_not_depend_on_the_blocks(size):
    whole = compute(SMALL, ALL)
    for block in blocks(SMALL, size):
        for name, value in compute(SMALL, block).items():
            same = whole[name][block]
            same = same[..., : value.shape[-1]] if name.startswith('section_') else same
            assert np.ascontiguousarray(same).tobytes() == np.ascontiguousarray(value).tobytes(), name


def test_a_point_has_the_parameters_of_its_axes():
    sweep = SMALL._replace(x=Axis('slope_deg', (2.0, 3.0)), y=Axis('mass', (0.5, 2.0)))
    rig = sweep.rig_at(1, 0)
    assert rig.slope == pytest.approx(math.radians(3.0), abs=1e-16)
    assert rig.front.mass == rig.rear.mass == 0.5
    assert (rig.k, rig.b) == (sweep.rig.k, sweep.rig.b)
    assert math.isnan(rig.D0)
    found = compute(sweep, (slice(0, 2), slice(0, 2)))
    alone = compute(SMALL._replace(rig=rig, x=Axis('k', (rig.k,)), y=Axis('b', (rig.b,))), (slice(0, 1), slice(0, 1)))
    assert found['speed'][1, 0] == alone['speed'][0, 0]
    assert found['section_theta2'][1, 0, :, :10].tolist() == alone['section_theta2'][0, 0, :, :10].tolist()


def test_a_sweep_survives_its_text():
    assert Sweep.from_json(SMALL.to_json()).to_json() == SMALL.to_json()
    assert Sweep.from_json(SMALL.to_json()).y == SMALL.y


# Refusals


@pytest.mark.parametrize(
    ('text', 'name', 'values'),
    [
        ('k:1:3:3', 'k', (1.0, 2.0, 3.0)),
        ('b:1:100:3:log', 'b', (1.0, 10.0, 100.0)),
        ('rear.mass:2:2:1:lin', 'rear.mass', (2.0,)),
    ],
)
def test_an_axis_is_read(text, name, values):
    axis = Axis.parse(text)
    assert axis.name == name
    assert axis.values == pytest.approx(values)


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('k', 'an axis is NAME:LOW:HIGH:COUNT'),
        ('k:1:2', 'an axis is'),
        ('k:1:2:0', 'an axis is'),
        ('k:1:x:3', 'an axis is'),
        ('k:1:inf:3', 'an axis is'),
        ('k:1:2:3:cubic', 'an axis is'),
        ('k:0:1:3:log', 'needs LOW and HIGH > 0'),
        ('frontmass:1:2:3', "'frontmass' is not a parameter .* did you mean front.mass"),
        ('zzz:1:2:3', 'there are front.length'),
    ],
)
def test_what_is_no_axis_is_refused(text, message):
    with pytest.raises(ValueError, match=message):
        Axis.parse(text)


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'seconds': 0.0}, 'seconds must be'),
        ({'theta2_band': math.nan}, 'theta2_band must be'),
        ({'band_percent': 50.0}, 'band_percent must be'),
        ({'phases': ()}, 'phases must be'),
        ({'phases': (1.0,)}, 'phases must be'),
        ({'x': Axis('b', (1.0,))}, 'both axes set b'),
        ({'x': Axis('slope', (0.1,)), 'y': Axis('slope_deg', (1.0,))}, 'both axes set slope'),
        ({'x': Axis('mass', (1.0,)), 'y': Axis('rear.mass', (1.0,))}, r'both axes set rear\.mass'),
        ({'x': Axis('k', ())}, 'k must have values'),
        ({'x': Axis('k', (math.nan,))}, 'all finite'),
        ({'x': Axis('k', (1.0, 1.0))}, 'k has a value twice'),
        ({'x': Axis('k', (1.0, -1.0))}, 'k must be ≥ 0'),
        ({'y': Axis('b', (1.0, 1e9))}, 'b must be'),
        ({'x': Axis('slope_deg', (2.0, 0.5))}, 'too gentle'),
        ({'x': Axis('none', (1.0,))}, 'is not a parameter'),
    ],
)
def test_an_impossible_sweep_is_refused_before_it_starts(tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        run(SMALL._replace(**change), tmp_path / 'sweep.nc')
    assert not list(tmp_path.iterdir())


def test_every_parameter_of_a_rig_can_be_an_axis():
    for name in ('k', 'b', 'D0', 'S0', 'slope', 'gravity', 'front.length', 'rear.spokes'):
        assert targets(name) == ((name,), 1.0)


# The file


def test_the_file_holds_what_was_computed(tmp_path):
    path, reports = tmp_path / 'sweep.nc', []
    run(SMALL, path, reports.append)
    assert (reports[0], reports[-1]) == (Progress(0, 12), Progress(12, 12))
    assert [*tmp_path.iterdir()] == [path]
    expected = to_dataset(SMALL, compute(SMALL, ALL))
    with open_sweep(path) as dataset:
        assert sweep_of(dataset).to_json() == SMALL.to_json()
        assert dataset.identical(expected) or str(dataset) == str(expected)
        for name in expected.variables:
            assert dataset[name].values.tobytes() == expected[name].values.tobytes(), name
            assert dataset[name].dtype == expected[name].dtype, name
            assert dataset[name].attrs.keys() >= {'units', 'long_name'}
        assert dataset.stable.dtype == bool
        assert dataset.k.attrs['units'] == 'N/m'
        assert dataset.verdict.attrs['flag_meanings'].split()[dataset.verdict.values[0, 2]] == 'stands'
        assert dataset.attrs['front.length'] == 1.0
        assert 'k' not in dataset.attrs
        assert dataset.sel(k=1e-2, b=0.1, method='nearest').speed > 0.2
        assert int((dataset.verdict == Verdict.STANDS).sum()) == 3


def test_variables_are_declared_once_with_unit_and_meaning():
    assert len({variable.name for variable in VARIABLES}) == len(VARIABLES)
    assert all(variable.doc and variable.dims[:2] == ('x', 'y') for variable in VARIABLES)


def test_trajectories_may_be_left_out(tmp_path):
    run(SMALL._replace(trajectories=False), tmp_path / 'sweep.nc')
    with open_sweep(tmp_path / 'sweep.nc') as dataset:
        assert 'step' not in dataset.sizes
        assert dataset.sizes['start'] == 2


def test_dotted_names_make_axes(tmp_path):
    sweep = SMALL._replace(x=Axis('front.mass', (0.9, 1.1)), y=Axis('spokes', (12.0, 13.0)))
    run(sweep, tmp_path / 'sweep.nc')
    with open_sweep(tmp_path / 'sweep.nc') as dataset:
        assert dataset.speed.dims == ('front.mass', 'spokes')
        assert dataset['front.mass'].attrs['units'] == 'kg'
        assert np.isfinite(dataset.speed.values).all()


# Interruptions


class Stop(Exception):
    pass


def stop(progress):
    raise Stop


def test_an_interrupted_sweep_goes_on_where_it_was(tmp_path, one_by_one):
    def stop_half_way(progress):
        if progress.points >= 6:
            raise Stop

    reports = []
    with pytest.raises(Stop):
        run(SMALL, tmp_path / 'parts.nc', stop_half_way)
    assert not (tmp_path / 'parts.nc').exists()
    run(SMALL, tmp_path / 'parts.nc', reports.append)
    assert reports[0].points >= 6
    run(SMALL, tmp_path / 'whole.nc')
    assert_same(tmp_path / 'parts.nc', tmp_path / 'whole.nc')
    assert {path.name for path in tmp_path.iterdir()} == {'parts.nc', 'whole.nc'}


def test_blocks_keep_their_size_when_it_goes_on(tmp_path, monkeypatch):
    def stop_soon(progress):
        if progress.points:
            raise Stop

    for size in (2, 100):
        monkeypatch.setattr('dcdrw_sim.study.sweep_run.block_size', lambda sweep, size=size: size)
        if size == 2:
            with pytest.raises(Stop):
                run(SMALL, tmp_path / 'sweep.nc', stop_soon)
    run(SMALL, tmp_path / 'sweep.nc')
    run(SMALL, tmp_path / 'whole.nc')
    assert_same(tmp_path / 'sweep.nc', tmp_path / 'whole.nc')


def test_a_block_that_was_half_written_is_done_again(tmp_path, one_by_one):
    path = tmp_path / 'sweep.nc'
    with pytest.raises(Stop):
        run(SMALL, path, stop)
    folder = tmp_path / 'sweep.nc.parts'
    (folder / '0-0.tmp').write_bytes(b'half')
    (folder / 'sweep.nc').write_bytes(b'half')
    run(SMALL, path)
    run(SMALL, tmp_path / 'whole.nc')
    assert_same(path, tmp_path / 'whole.nc')


def test_another_sweep_does_not_go_on_with_this_one(tmp_path, one_by_one):
    path = tmp_path / 'sweep.nc'
    with pytest.raises(Stop):
        run(SMALL, path, stop)
    changed = SMALL._replace(rig=SMALL.rig._replace(slope=0.04), seconds=50.0)
    with pytest.raises(ValueError, match=r'sweep\.nc\.parts holds a sweep that differs in rig, seconds; choose'):
        run(changed, path)
    run(SMALL, path)
    with pytest.raises(ValueError, match=r'sweep\.nc holds a sweep that differs in rig, seconds'):
        run(changed, path)


def test_a_folder_that_no_sweep_made_is_left_alone(tmp_path, one_by_one):
    folder = tmp_path / 'sweep.nc.parts'
    folder.mkdir()
    with pytest.raises(ValueError, match=r'sweep\.nc\.parts exists already and holds no unfinished sweep'):
        run(SMALL, tmp_path / 'sweep.nc')
    (folder / 'notes.txt').write_text('mine')
    with pytest.raises(ValueError, match='holds no unfinished sweep'):
        run(SMALL, tmp_path / 'sweep.nc')
    assert [path.name for path in tmp_path.rglob('*')] == ['sweep.nc.parts', 'notes.txt']


def test_what_others_put_into_the_folder_of_a_sweep_stays(tmp_path, one_by_one):
    with pytest.raises(Stop):
        run(SMALL, tmp_path / 'sweep.nc', stop)
    (tmp_path / 'sweep.nc.parts' / 'notes.txt').write_text('mine')
    run(SMALL, tmp_path / 'sweep.nc')
    assert [path.name for path in (tmp_path / 'sweep.nc.parts').iterdir()] == ['notes.txt']


def test_another_sweep_is_overwritten_by_force_alone(tmp_path, one_by_one):
    path, other = tmp_path / 'sweep.nc', SMALL._replace(rig=SMALL.rig._replace(slope=0.04))
    run(SMALL, path)
    with pytest.raises(ValueError, match='holds a sweep that differs in rig'):
        run(other, path)
    run_sweep(other, path, ThreadPoolExecutor(1), 2, force=True)
    assert is_complete(path, other)
    path.write_text('no sweep at all')
    run_sweep(other, path, ThreadPoolExecutor(1), 2, force=True)
    assert is_complete(path, other)


def test_a_sweep_that_is_done_is_not_done_again(tmp_path):
    path, reports = tmp_path / 'sweep.nc', []
    run(SMALL, path)
    made = path.stat().st_mtime_ns
    run(SMALL, path, reports.append)
    assert reports == [Progress(12, 12)]
    assert path.stat().st_mtime_ns == made


def test_two_processes_do_not_write_one_sweep(tmp_path):
    path = tmp_path / 'sweep.nc'
    started, go_on = threading.Event(), threading.Event()

    def hold(progress):
        started.set()
        assert go_on.wait(PATIENCE)

    first = threading.Thread(target=run, args=(SMALL, path, hold))
    first.start()
    assert started.wait(PATIENCE)
    try:
        with pytest.raises(OSError, match='another process is at work in'):
            run(SMALL, path)
    finally:
        go_on.set()
        first.join()
    assert path.exists()


def test_what_is_no_sweep_is_told(tmp_path):
    xarray = pytest.importorskip('xarray')
    xarray.Dataset({'a': 1}).to_netcdf(tmp_path / 'other.nc')
    with pytest.raises(ValueError, match='holds no sweep'):
        open_sweep(tmp_path / 'other.nc')
    (tmp_path / 'text.nc').write_text(json.dumps({}))
    with pytest.raises(OSError, match=r'text\.nc'):
        open_sweep(tmp_path / 'text.nc')

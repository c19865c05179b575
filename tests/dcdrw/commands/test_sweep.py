"""`dcdrw sweep`: what a person is told, and that neither a kill nor a lost worker changes the result."""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack

import pytest

from dcdrw.cli import main
from dcdrw_sim.study.sweep_dataset import open_sweep, sweep_of
from tests import ROOT
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

QUICK = ['--x', 'k:1e-3:1e-2:2:log', '--y', 'b:0.1:1:3', '--seconds', '30', '--starts', '2']
LONG = ['--x', 'k:1e-3:1e-2:24:log', '--y', 'b:0.1:0.3:4', '--seconds', '20000', '--starts', '1', '--no-trajectories']
"""Twelve blocks of some tenths of a second each."""


def assert_same(path, other):
    with open_sweep(path) as one, open_sweep(other) as two:
        assert set(one.variables) == set(two.variables)
        for name in one.variables:
            assert one[name].values.tobytes() == two[name].values.tobytes(), name


def wait_for(condition, what):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.02)


def parts(path):
    return len(list(path.with_name(path.name + '.parts').glob('*.npz')))


@pytest.fixture(scope='module')
def long_sweep(tmp_path_factory):
    path = tmp_path_factory.mktemp('whole') / 'sweep.nc'
    assert main(['sweep', '--out', str(path), *LONG]) == 0
    return path


@pytest.fixture
def start():
    """Start processes that end with the test."""
    with ExitStack() as stack:

        def start_process(*arguments, **options):
            process = subprocess.Popen(
                [sys.executable, '-m', *arguments],
                start_new_session=True,
                text=True,
                env={**os.environ, 'PYTHONPATH': str(ROOT)},
                **options,
            )
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        yield start_process


# What is told


def test_a_sweep_tells_what_became_of_the_points(tmp_path, capsys):
    path = tmp_path / 'new' / 'sweep.nc'
    assert main(['sweep', '--out', str(path), *QUICK]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith(f'{path}: 6 points: ')
    assert not captured.err  # no bar where nobody looks
    with open_sweep(path) as dataset:
        assert dataset.attrs['seconds'] == 30.0
        assert dataset.start.values.tolist() == [1 / 3, 2 / 3]
        assert dataset.sizes['k'] == 2
    assert main(['sweep', '--out', str(path), *QUICK]) == 0
    assert main(['sweep', '--out', str(path), *QUICK, '--band-deg', '2']) == 2
    assert 'differs in theta2_band' in capsys.readouterr().err


def test_a_rig_brings_its_units(tmp_path):
    rig = tmp_path / 'rig.yaml'
    rig.write_text('/**:\n  ros__parameters:\n    front.mass: 8.0\n')
    path = tmp_path / 'sweep.nc'
    assert (
        main(
            [
                'sweep',
                '--out',
                str(path),
                '--preset',
                'paper',
                '--rig',
                str(rig),
                '--y',
                'slope_deg:2:3:2',
                '--starts',
                '1',
                '--seconds',
                '5',
            ]
        )
        == 0
    )
    with open_sweep(path) as dataset:
        assert sweep_of(dataset).rig.front.mass == 8.0
        assert dataset.k.values[0] == pytest.approx(1e-4 * 8.0 * 9.81 / 0.9652)
        assert dataset.slope_deg.attrs['units'] == '°'


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        (['--y', 'slope_deg:0.5:3:4'], 'too gentle for the front wheel'),
        (['--x', 'b:1:2:3'], 'both axes set b'),
        (['--x', 'k:-1:1:3'], 'k must be ≥ 0'),
        (['--scheduler', 'tcp://127.0.0.1:1'], 'no Dask scheduler answers at tcp://127.0.0.1:1'),
    ],
)
def test_what_cannot_be_is_told_in_one_line(tmp_path, monkeypatch, capsys, options, message):
    monkeypatch.setattr('dcdrw.commands.sweep.CONNECT_SECONDS', 0.5)
    assert main(['sweep', '--out', str(tmp_path / 'sweep.nc'), *options]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith('dcdrw sweep: ')
    assert message in captured.err
    assert captured.err.count('\n') == 1
    assert not list(tmp_path.iterdir())


def test_an_axis_that_is_none_is_told(capsys):
    with pytest.raises(SystemExit) as ended:
        main(['sweep', '--out', 'sweep.nc', '--x', 'slop:1:2:3'])
    assert ended.value.code == 2
    assert 'did you mean slope?' in capsys.readouterr().err


@pytest.mark.parametrize('module', ['xarray', 'netCDF4'])
def test_a_missing_library_is_told(tmp_path, monkeypatch, capsys, module):
    monkeypatch.setitem(sys.modules, module, None)
    assert main(['sweep', '--out', str(tmp_path / 'sweep.nc'), *QUICK]) == 2
    assert capsys.readouterr().err == f"dcdrw sweep: a sweep needs {module}: pip install 'dcdrw[sweep]'\n"


def test_help_reads_well(capsys):
    with pytest.raises(SystemExit) as ended:
        main(['sweep', '--help'])
    assert ended.value.code == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 120


# Interruptions


@pytest.mark.parametrize(('number', 'status'), [(signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130)])
def test_a_sweep_that_is_ended_goes_on_where_it_was(tmp_path, start, long_sweep, number, status):
    for attempt in range(5):  # it might be done before the signal comes
        path = tmp_path / f'{attempt}.nc'
        process = start('dcdrw.cli', 'sweep', '--out', str(path), *LONG, stderr=subprocess.PIPE)
        wait_for(lambda path=path, process=process: parts(path) or process.poll() is not None, 'no parts came')
        process.send_signal(number)
        _, error = process.communicate(timeout=PATIENCE)
        if process.returncode:
            break
    assert (process.returncode, error) == (status, '' if number == signal.SIGKILL else 'dcdrw sweep: interrupted\n')
    assert not path.exists()
    assert parts(path)
    assert main(['sweep', '--out', str(path), *LONG]) == 0
    assert_same(path, long_sweep)


# A cluster


def test_a_cluster_makes_the_same_though_a_worker_is_killed(tmp_path, start, long_sweep):
    pytest.importorskip('distributed')
    with socket.socket() as free:
        free.bind(('127.0.0.1', 0))
        address = f'tcp://127.0.0.1:{free.getsockname()[1]}'
    log = open(tmp_path / 'cluster.log', 'w')  # noqa: SIM115
    quiet = {'cwd': tmp_path, 'stdout': log, 'stderr': log}
    start('dask', 'scheduler', '--host', '127.0.0.1', '--port', address.rpartition(':')[2], '--no-dashboard', **quiet)
    workers = [
        start(
            'dask', 'worker', address, '--host', '127.0.0.1', '--nthreads', '1', '--no-dashboard', '--no-nanny', **quiet
        )
        for _ in range(2)
    ]
    from distributed import Client

    with Client(address, timeout=PATIENCE, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=PATIENCE)
        path = tmp_path / 'sweep.nc'
        process = start('dcdrw.cli', 'sweep', '--out', str(path), *LONG, '--scheduler', address)
        wait_for(lambda: parts(path) or process.poll() is not None, 'no parts came')
        workers[0].kill()
        wait_for(lambda: len(client.scheduler_info()['workers']) == 1 or process.poll() is not None, 'still there')
        assert process.wait(PATIENCE) == 0
    log.close()
    assert_same(path, long_sweep)

"""`dcdrw figures`: sweeps are kept and used again, and what is wrong is told."""

import sys

import pytest

from dcdrw.cli import main
from dcdrw.commands import figures
from dcdrw_sim.study.sweep import compute, papers_sweep
from dcdrw_sim.study.sweep_dataset import open_sweep, sweep_of
from tests.drawn import readable_figures
from tests.reader import FEWER

pytest.importorskip('matplotlib')
pytest.importorskip('netCDF4')


@pytest.fixture(autouse=True)
def few_points(monkeypatch):
    for name, few in FEWER.items():
        monkeypatch.setattr(name, few)


def draw(tmp_path, *options):
    return main(['figures', '--out', str(tmp_path / 'out'), '--cache', str(tmp_path / 'cache'), *options])


def test_every_figure_is_drawn(tmp_path, capsys):
    with readable_figures() as drawn:
        assert draw(tmp_path) == 0
    assert len(drawn) == len(figures.FIGURES)
    written = sorted(path.name for path in (tmp_path / 'out').iterdir())
    assert written == sorted(f'{name}.png' for name in figures.FIGURES)
    captured = capsys.readouterr()
    assert captured.out.split() == [str(tmp_path / 'out' / f'{name}.png') for name in figures.FIGURES]
    assert not captured.err  # no bar where nobody looks
    assert all(path.read_bytes().startswith(b'\x89PNG') for path in (tmp_path / 'out').iterdir())


def test_a_sweep_that_is_kept_is_not_computed_again(tmp_path, monkeypatch):
    assert draw(tmp_path, '--only', 'trajectories', '--format', 'pdf') == 0
    [kept] = (tmp_path / 'cache').iterdir()
    with open_sweep(kept) as dataset:
        assert sweep_of(dataset).seconds == papers_sweep().seconds
    monkeypatch.setattr(figures, 'run_sweep', None)
    assert draw(tmp_path, '--only', 'trajectories', 'trajectories') == 0
    assert [path.name for path in (tmp_path / 'out').iterdir()].count('trajectories.pdf') == 1


def test_an_interrupted_sweep_goes_on_where_it_was(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr('dcdrw_sim.study.sweep_run.block_size', lambda sweep: 5)
    computed = []

    def interrupted(sweep, block):
        computed.append(block)
        if len(computed) == 3:
            raise KeyboardInterrupt
        return compute(sweep, block)

    monkeypatch.setattr('dcdrw_sim.study.sweep_run.compute', interrupted)
    monkeypatch.setattr('os.sched_getaffinity', lambda process: {0})
    assert draw(tmp_path, '--only', 'trajectories') == 130
    assert capsys.readouterr().err.endswith('dcdrw figures: interrupted\n')
    [parts] = (tmp_path / 'cache').iterdir()
    done = len(list(parts.glob('*.npz')))
    assert 1 <= done < 5
    before = len(computed)
    assert draw(tmp_path, '--only', 'trajectories') == 0
    assert len(computed) - before == 5 - done


def test_the_name_of_a_kept_sweep_tells_its_parameters_and_the_code(monkeypatch):
    sweep = papers_sweep()
    assert figures._key(sweep) == figures._key(papers_sweep())
    assert figures._key(sweep) != figures._key(sweep._replace(seconds=sweep.seconds + 1e-9))
    assert figures._key(sweep) != figures._key(sweep._replace(band_percent=1.0))
    here = figures._key(sweep)
    monkeypatch.setattr(figures, 'fingerprint', lambda *packages: 'of other code')
    assert figures._key(sweep) != here


def test_cache_is_where_the_desktop_keeps_caches(monkeypatch, tmp_path):
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    assert figures._default_cache() == tmp_path / 'dcdrw'
    monkeypatch.delenv('XDG_CACHE_HOME')
    monkeypatch.setenv('HOME', str(tmp_path / 'home'))
    assert figures._default_cache() == tmp_path / 'home' / '.cache' / 'dcdrw'


@pytest.mark.parametrize(
    ('module', 'message'),
    [
        ('matplotlib.figure', 'a figure needs matplotlib: pip install matplotlib'),
        ('xarray', "a sweep needs xarray: pip install 'dcdrw[sweep]'"),
    ],
)
def test_a_missing_library_is_told(tmp_path, monkeypatch, capsys, module, message):
    monkeypatch.setitem(sys.modules, module, None)
    assert draw(tmp_path) == 2
    assert capsys.readouterr().err == f'dcdrw figures: {message}\n'
    assert not list(tmp_path.iterdir())


def test_an_unknown_figure_is_told(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        draw(tmp_path, '--only', 'nothing')
    assert ended.value.code == 2
    assert 'trajectories' in capsys.readouterr().err


def test_a_folder_that_cannot_be_is_told(tmp_path, capsys):
    (tmp_path / 'out').write_text('')
    assert draw(tmp_path) == 2
    assert capsys.readouterr().err.startswith('dcdrw figures: ')


def test_help_reads_well(capsys):
    with pytest.raises(SystemExit) as ended:
        main(['figures', '--help'])
    assert ended.value.code == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 120
    assert all(name in text for name in figures.FIGURES)

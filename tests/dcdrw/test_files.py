"""Files are written whole or not at all, and never over others unasked."""

import csv
import json
import math
import re
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from dcdrw.files import free_folder, refuse_existing, to_json, write_csv, write_text, write_whole
from tests import ROOT


def test_a_file_gets_its_name_when_it_is_whole(tmp_path):
    path = tmp_path / 'whole.txt'
    with write_whole(path) as unfinished:
        unfinished.write_text('half')
        assert unfinished.suffix == path.suffix
        assert not path.exists()
    assert path.read_text() == 'half'
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize('error', [KeyboardInterrupt, ValueError, OSError])
def test_of_a_failure_nothing_is_left(tmp_path, error):
    def fail() -> None:
        with write_whole(tmp_path / 'file.txt') as unfinished:
            unfinished.write_text('half')
            raise error

    with pytest.raises(error):
        fail()
    assert not list(tmp_path.iterdir())


def test_what_exists_is_overwritten_by_force_alone(tmp_path):
    path = tmp_path / 'file.txt'
    write_text(path, 'first')
    with pytest.raises(ValueError, match=r'file\.txt exists already, not overwriting \(--force does\)'):
        write_text(path, 'second')
    assert path.read_text() == 'first'
    write_text(path, 'second', force=True)
    assert path.read_text() == 'second'
    with pytest.raises(ValueError, match='exists already'):
        refuse_existing([tmp_path / 'new', path])
    refuse_existing([path], force=True)


@pytest.mark.parametrize('text', ['=1+1', '+1', '-1', '@SUM(A1)', '\t=1', '\r=1'])
def test_text_is_never_a_formula_to_a_spreadsheet(text, tmp_path):
    write_csv(tmp_path / 'table.csv', ['trial', 'force'], [[text, -1.5], ['a=b', math.nan]])
    with (tmp_path / 'table.csv').open(newline='') as file:
        assert list(csv.reader(file))[1:] == [[f"'{text}", '-1.5'], ['a=b', '']]


def test_every_table_is_written_in_one_place():
    """By `dcdrw.files`, which sees to it that no text runs as a formula."""
    writers = [path for path in (ROOT / 'dcdrw').rglob('*.py') if 'csv.writer' in path.read_text()]
    assert writers == [ROOT / 'dcdrw' / 'files.py']


def test_a_failed_write_keeps_what_was_there(tmp_path):
    path = tmp_path / 'table.csv'
    write_csv(path, ['a'], [[1]])
    before = path.read_bytes()
    with pytest.raises(ZeroDivisionError):
        write_csv(path, ['a'], ([1 // zero] for zero in (1, 0)), force=True)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(OSError, match=r'file/below\.txt'):
        write_text(tmp_path / 'file' / 'below.txt', '')
    with pytest.raises(OSError, match='/dev/full'):
        write_text(Path('/dev/full'), 'text')
    assert Path('/dev/full').exists()


FULL = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
from dcdrw.cli import main
sys.exit(main(sys.argv[1:]))
"""
"""A command on a disk that takes no more than 4 kB a file, which writers meet as they meet a full one."""


@pytest.mark.skipif(not hasattr(resource, 'RLIMIT_FSIZE'), reason='only where files can be limited')
@pytest.mark.parametrize(
    'arguments',
    [
        ['film', '--out', 'out.mp4', '--seconds', '0.5', '--image-width', '320', '--image-height', '240'],
        ['film', '--out', 'out.avi', '--seconds', '0.5', '--image-width', '320', '--image-height', '240'],
        ['film', '--out', 'out.mkv', '--seconds', '0.5', '--image-width', '320', '--image-height', '240'],
        ['tags', '--out', 'out.pdf'],
        ['urdf', '--out', 'out.urdf'],
        ['models', '--out', '.'],
    ],
    ids=lambda arguments: ' '.join(arguments[:3]),
)
def test_a_full_disk_leaves_no_file_that_looks_whole(arguments, tmp_path):
    done = subprocess.run(
        [sys.executable, '-c', FULL, *arguments],
        cwd=tmp_path,
        env={'PYTHONPATH': str(ROOT), 'PYTHONDONTWRITEBYTECODE': '1', 'MPLCONFIGDIR': str(tmp_path / 'matplotlib')},
        capture_output=True,
        text=True,
        errors='replace',
        check=False,
    )
    assert done.returncode == 2, done.stderr
    message = done.stderr.strip().splitlines()[-1]
    assert 'Traceback' not in done.stderr
    assert message.startswith(f'dcdrw {arguments[0]}: ')
    assert re.search(r'out\.(mp4|avi|mkv|pdf|urdf)|models\.json|wheel\.png', message)
    assert not [path for path in tmp_path.iterdir() if path.stat().st_size >= 4096 and path.is_file()]
    assert not list(tmp_path.glob('out*'))


def test_a_folder_for_results_is_new_or_empty(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert free_folder(None).parent.name == 'trials'
    (tmp_path / 'empty').mkdir()
    assert free_folder(tmp_path / 'empty') == tmp_path / 'empty'
    (tmp_path / 'empty' / 'file').write_text('')
    with pytest.raises(ValueError, match='empty exists already, not overwriting; choose another --out'):
        free_folder(tmp_path / 'empty')


def test_json_knows_no_nan():
    text = to_json({'a': math.nan, 'b': [1.5, -math.inf], 'c': ('φ', None, True)})
    assert json.loads(text) == {'a': None, 'b': [1.5, None], 'c': ['φ', None, True]}
    assert 'φ' in text

"""Files of strangers: each is read, or refused in one line that names it, in bounded time and memory."""

import os
import random
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dcdrw.suite.parameter_file import TrialParams, read_parameter_file
from tests.fuzz import Reader, check, damaged, readers

READERS = readers()
RIG = '/**:\n  ros__parameters:\n'


@pytest.mark.parametrize('kind', READERS)
@settings(max_examples=30, suppress_health_check=list(HealthCheck))
@given(draw=st.randoms(use_true_random=False), number=st.integers(0, 2))
def test_damaged_files_are_read_or_refused_in_a_line(tmp_path_factory, kind, draw: random.Random, number):
    reader = READERS[kind]
    check(reader, damaged(reader.seeds[number % len(reader.seeds)], draw), tmp_path_factory.mktemp('fuzzed'))


@pytest.mark.parametrize('kind', READERS)
@settings(max_examples=20, suppress_health_check=list(HealthCheck))
@given(content=st.binary(max_size=300))
def test_any_bytes_are_read_or_refused_in_a_line(tmp_path_factory, kind, content):
    check(READERS[kind], content, tmp_path_factory.mktemp('fuzzed'))


@pytest.mark.parametrize('kind', READERS)
def test_whole_files_are_read(tmp_path_factory, kind):
    for seed in READERS[kind].seeds:
        assert check(READERS[kind], seed, tmp_path_factory.mktemp('whole')) == ''


def bomb() -> str:
    """2^27 values in 28 lines."""
    lines = ['a0: &a0 {x: 1, y: 2}', *(f'a{k}: &a{k} {{x: *a{k - 1}, y: *a{k - 1}}}' for k in range(1, 28))]
    return RIG + ''.join(f'    {line}\n' for line in lines)


@pytest.mark.parametrize(
    ('content', 'reason'),
    [
        (bomb(), 'alias'),
        (f'{RIG.rstrip()} &r\n    k: 5\n    front: *r\n', 'alias'),
        ('/**: {ros__parameters: {k: ' + '[' * 3000 + ']' * 3000 + '}}\n', 'nest'),
        (f'{RIG}    k: {"9" * 5000}\n', 'digits'),
        (f'{RIG}    k: 5\n    k: 50\n', 'k'),
        (f'{RIG}    front: {{length: 1.0}}\n    front.length: 2.0\n', 'front.length'),
        (f'{RIG}    front: {{spokes: 1000000000}}\n', 'front.spokes must be'),
        (f'{RIG}    k: 1.0e308\n', 'k must be'),
        (RIG + ''.join(f'    p{k}: 1\n' for k in range(200_000)), 'more than 100000 values'),
    ],
    ids=['bomb', 'itself', 'nested', 'digits', 'twice', 'nested twice', 'spokes', 'huge', 'keys'],
)
def test_rig_files_gone_wrong_are_refused(tmp_path_factory, content, reason):
    rig = Reader(lambda path: read_parameter_file(path, TrialParams()), '.yaml', ())
    assert reason in check(rig, content.encode(), tmp_path_factory.mktemp('rig'))


@pytest.mark.parametrize(
    ('kind', 'content', 'reason'),
    [
        ('parts', b'kind,value,name\nspring,5,"x\n' + b'y' * 200_000 + b'\ndashpot,5,y\n', 'field larger than'),
        ('legs', b'time,left_force\n0.0,\xff\xfe\n0.1,5\n', "line 2: 'ÿþ' is not a number"),
    ],
    ids=['parts', 'legs'],
)
def test_tables_gone_wrong_are_refused(tmp_path_factory, kind, content, reason):
    assert reason in check(READERS[kind], content, tmp_path_factory.mktemp(kind))


@pytest.mark.parametrize('kind', ['rig', 'camera', 'cases', 'parts', 'legs'])
def test_a_pipe_that_nobody_writes_to_keeps_nobody_waiting_and_another_is_read(tmp_path, kind):
    reader = READERS[kind]
    os.mkfifo(tmp_path / 'pipe.csv')
    with pytest.raises(ValueError, match='pipe'):
        reader.read(tmp_path / 'pipe.csv')
    end, begin = os.pipe()  # as the shell's <(command)
    os.write(begin, reader.seeds[0])
    os.close(begin)
    reader.read(Path(f'/dev/fd/{end}'))
    os.close(end)

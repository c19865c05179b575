import json
import math

import pytest

from dcdrw_sim.model.dynamics import State
from dcdrw_sim.motion.cases import DEFAULT_STRIKES, read_cases, run_record
from dcdrw_sim.motion.ends import End
from dcdrw_sim.motion.trajectory import run
from tests import ROOT

REFERENCE = ROOT / 'tests' / 'data' / 'strikes.json'
CASE = json.loads(REFERENCE.read_text())[0]['case']


def read(tmp_path, content):
    path = tmp_path / 'case.json'
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return read_cases(path)


def test_the_reference_is_read_as_it_stands():
    cases, is_list = read_cases(REFERENCE)
    assert is_list
    assert [case.name for case in cases] == [
        'paper_rig',
        'paper_sweep_low_damping',
        'paper_sweep_high_damping',
        'unequal_wheels',
    ]
    unequal = cases[3]
    assert (unequal.rig.front.length, unequal.rig.rear.mass, unequal.rig.b) == (0.95, 11.0, 30.0)
    assert unequal.rig.rear.alpha == pytest.approx(unequal.raw['alpha'][1], rel=1e-15)
    assert unequal.state == State(*unequal.raw['x0'])
    assert unequal.listed_strikes == 30


@pytest.mark.parametrize('content', [CASE, {'case': CASE}, {'case': CASE, 'strikes': []}])
def test_one_case_may_stand_alone(tmp_path, content):
    (case,), is_list = read(tmp_path, content)
    assert not is_list
    assert case.raw == CASE
    assert case.listed_strikes == DEFAULT_STRIKES


def test_what_is_written_can_be_read_again(tmp_path):
    (case,), _ = read(tmp_path, {'case': CASE, 'strikes': [None] * 5})
    result = run(case.rig, case.state, strikes=case.listed_strikes)
    record = run_record(case, result)
    (again,), _ = read(tmp_path, record)
    assert again == case
    assert record['strikes'] == [{'wheel': s.wheel, 't': s.t, 'state': list(s.state)} for s in result.strikes]
    assert record['end'] == {'reason': 'strikes', 'meaning': End.STRIKES.meaning, 't': result.duration}


def test_the_record_of_a_run_that_ended_early_names_the_wheel(tmp_path):
    (case,), _ = read(tmp_path, CASE | {'slope': 0.005, 'k': 0.0, 'b': 0.0})
    record = run_record(case, run(case.rig, case.state, strikes=1000))
    assert record['end']['reason'] == 'standing'
    assert 'wheel did not pass its apex' in record['end']['meaning']
    assert record['end']['meaning'].startswith(('the front', 'the rear'))


WITHOUT_K = {key: value for key, value in CASE.items() if key != 'k'}


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        ('', r'case\.json is not JSON: '),
        ('{"g": 9.81', r'case\.json is not JSON: '),
        ('[' * 100_000, r'case\.json is not JSON: '),
        ([], r'case\.json holds no case: the list is empty'),
        ('3', r'case\.json, case 0: must be an object with the keys g, slope, k, b, D0, S0, l, m, alpha, x0'),
        ([CASE, None], r'case 1: must be an object'),
        ({'case': 3}, r'case 0: must be an object'),
        (WITHOUT_K, r'case 0 \(paper_rig\): k is missing'),
        ([CASE, WITHOUT_K], r'case 1 \(paper_rig\): k is missing'),
        (CASE | {'k': math.nan}, 'k must be a finite number, got nan'),
        (CASE | {'b': math.inf}, 'b must be a finite number, got inf'),
        (CASE | {'b': 10**400}, 'b must be a finite number, got 1000'),
        (CASE | {'g': '9.81'}, "g must be a finite number, got '9.81'"),
        (CASE | {'g': True}, 'g must be a finite number, got True'),
        (CASE | {'g': None}, 'g must be a finite number, got None'),
        (CASE | {'l': 1.0}, r'l must be 2 finite numbers, got 1\.0'),
        (CASE | {'m': [1.0, 2.0, 3.0]}, r'm must be 2 finite numbers, got \[1\.0, 2\.0, 3\.0\]'),
        (CASE | {'x0': [0.0, 1.0, 0.0]}, r'x0 must be 4 finite numbers, got \[0\.0, 1\.0, 0\.0\]'),
        (CASE | {'x0': [0.0, math.nan, 0.0, 1.0]}, 'x0 must be 4 finite numbers'),
        (CASE | {'x0': [0.5, 1.0, 0.0, 1.0]}, r'case 0 \(paper_rig\): theta1 of the start must be within ±α'),
        (CASE | {'alpha': [0.0, 0.2]}, r'alpha must be in \(0, π/4\] rad, got 0\.0'),
        (CASE | {'alpha': [0.2, 1.0]}, r'alpha must be in \(0, π/4\] rad, got 1\.0'),
        (CASE | {'l': [1.0, -1.0]}, r'case 0 \(paper_rig\): rear\.length must be > 0, ≤ 10 m, got -1\.0'),
        (CASE | {'k': -1}, 'k must be ≥ 0'),
        (CASE | {'S0': 0.0, 'x0': [0.1, 1.0, 0.1, 1.0]}, 'the hubs met'),
    ],
)
def test_a_bad_file_is_refused_with_what_is_wrong_in_it(tmp_path, content, message):
    with pytest.raises(ValueError, match=message) as error:
        read(tmp_path, content)
    assert 'case.json' in str(error.value)


def test_a_key_that_stands_twice_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r'case\.json.*the key k stands in one object twice'):
        read(tmp_path, '{"k": 5, "b": 1, "k": 50}')


def test_bytes_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / 'case.json'
    path.write_bytes(b'\xff\x00')
    with pytest.raises(ValueError, match=r'case\.json, line 1: byte 0xff is not UTF-8 text'):
        read_cases(path)


def test_a_directory_and_a_missing_file_are_named(tmp_path):
    with pytest.raises(IsADirectoryError, match=tmp_path.name):
        read_cases(tmp_path)
    with pytest.raises(FileNotFoundError, match='absent'):
        read_cases(tmp_path / 'absent')


def test_square_wheels_are_allowed(tmp_path):
    (case,), _ = read(tmp_path, CASE | {'alpha': [math.pi / 4, math.pi / 4]})
    assert case.rig.front.spokes == 4.0


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        (CASE | {'sloep': 0.03}, r'sloep is not a key of a case; did you mean slope\?'),
        ({'case': CASE | {'bb': 1.0}}, 'bb is not a key of a case'),
        ({'case': CASE, 'strike': []}, r'strike is not a key of a case; did you mean strikes\?'),
    ],
)
def test_unknown_keys_are_refused_with_a_suggestion(tmp_path, content, message):
    with pytest.raises(ValueError, match=message):
        read(tmp_path, content)

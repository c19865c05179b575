import math

import pytest

from dcdrw_msgs_py.diagnosis import LOST_SAMPLES, RATE_IN, Diagnosis, Level, lost_since


@pytest.mark.parametrize(
    ('level', 'lost', 'rate', 'expected'),
    [
        (Level.OK, 699, 1000.0, Level.WARN),
        (Level.OK, 40, 1000.0, Level.OK),
        (Level.ERROR, 699, 1000.0, Level.ERROR),
        (Level.OK, 699, math.nan, Level.OK),
    ],
)
def test_a_second_that_lost_many_samples_is_a_warning(level, lost, rate, expected):
    said = lost_since(Diagnosis(level, 'tracking', {LOST_SAMPLES: 10 + lost, RATE_IN: rate}), 10)
    assert said.level is expected
    assert said.message.endswith('tracking')
    assert said.message.startswith('699 samples were lost') is (lost == 699 and rate == 1000.0)


def test_of_a_node_without_samples_nothing_is_said():
    diagnosis = Diagnosis(Level.OK, 'running', {})
    assert lost_since(diagnosis, 0) is diagnosis

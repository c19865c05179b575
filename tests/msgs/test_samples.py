"""Runs of a source, as it announces them."""

import hypothesis.strategies as st
from hypothesis import given

from dcdrw_msgs_py.samples import Runs


def test_a_sample_belongs_to_the_last_run_that_began_before_it():
    runs = Runs()
    assert runs.of(5) == 0
    runs.announce(10, 'run_7')
    runs.announce(20, 'run_8')
    assert [runs.of(stamp) for stamp in (9, 10, 19, 20, 10**18)] == [0, 7, 7, 8, 8]


def test_a_source_whose_time_goes_back_takes_back_what_lay_ahead():
    runs = Runs()
    runs.announce(100, 'run_1')
    runs.announce(10, 'run_2')
    assert [runs.of(stamp) for stamp in (5, 10, 1000)] == [0, 2, 2]


@given(st.text())
def test_what_is_no_run_is_passed_over(name):
    runs = Runs()
    runs.announce(1, name)
    assert runs.of(2) == (int(name[4:]) if name.startswith('run_') and name[4:].isdecimal() else 0)

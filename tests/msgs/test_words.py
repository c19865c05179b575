"""Counts in sentences have the noun that goes with them."""

import pytest

from dcdrw_msgs_py.words import by_count, counted, listed


@pytest.mark.parametrize(
    ('count', 'words'),
    [(0, '0 steps'), (1, '1 step'), (2, '2 steps'), (11, '11 steps'), ('1', '1 step'), ('1 to 2', '1 to 2 steps')],
)
def test_one_alone_is_singular(count, words):
    assert counted(count, 'step') == words


def test_so_is_its_verb():
    assert [by_count(count, 'is', 'are') for count in (0, 1, 2)] == ['are', 'is', 'are']


def test_of_many_names_the_first_are_told():
    assert listed('abc') == 'a, b, c'
    assert listed(map(str, range(10_000)), ' or ') == ' or '.join([*map(str, range(20)), '9980 more'])

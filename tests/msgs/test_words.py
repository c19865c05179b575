"""Counts in sentences have the noun that goes with them."""

import pytest

from dcdrw_msgs_py.words import by_count, counted


@pytest.mark.parametrize(
    ('count', 'words'),
    [(0, '0 steps'), (1, '1 step'), (2, '2 steps'), (11, '11 steps'), ('1', '1 step'), ('1 to 2', '1 to 2 steps')],
)
def test_one_alone_is_singular(count, words):
    assert counted(count, 'step') == words


def test_so_is_its_verb():
    assert [by_count(count, 'is', 'are') for count in (0, 1, 2)] == ['are', 'is', 'are']

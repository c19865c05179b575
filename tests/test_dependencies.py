"""Every dependency has a lower bound, and one exact version on each Python that CI may run."""

from itertools import chain

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests import ROOT
from tests.test_packaging import config

PYTHONS = ('3.10', '3.11', '3.12', '3.13')


TOOLS = ('docs', 'dist')
"""Extras of `make docs` and `make dist`, which no test needs."""


def requirements(without: tuple[str, ...] = ()) -> list[Requirement]:
    options = config()
    extras = options['options.extras_require']
    lists = (options['options']['install_requires'], *(extras[name] for name in extras if name not in without))
    return [Requirement(line) for line in chain.from_iterable(text.split('\n') for text in lists) if line]


def constraints(python: str) -> dict[str, str]:
    lines = (ROOT / 'constraints.txt').read_text().splitlines()
    found = [Requirement(line) for line in lines if not line.startswith('#')]
    chosen = [one for one in found if one.marker is None or one.marker.evaluate({'python_version': python})]
    assert len({canonicalize_name(one.name) for one in chosen}) == len(chosen)
    assert all([part.operator for part in one.specifier] == ['=='] for one in chosen)
    return {canonicalize_name(one.name): next(iter(one.specifier)).version for one in chosen}


def test_every_dependency_has_a_lower_bound_and_no_other():
    assert {str(one): [part.operator for part in one.specifier] for one in requirements()} == {
        str(one): ['>='] for one in requirements()
    }


@pytest.mark.parametrize('python', PYTHONS)
def test_the_constraints_hold_each_dependency_at_a_version_within_its_bound(python):
    exact = constraints(python)
    assert exact.keys() == {canonicalize_name(one.name) for one in requirements(without=TOOLS)}
    for one in requirements(without=TOOLS):
        assert one.specifier.contains(exact[canonicalize_name(one.name)]), one

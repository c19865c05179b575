"""The docs say what the code does."""

import pytest

from dcdrw.suite.parameter_file import TrialParams, read_parameter_file
from dcdrw.suite.tables import updated
from tests import ROOT


def test_tables_of_the_reference_are_current():
    text = (ROOT / 'docs' / 'reference.md').read_text(encoding='utf-8')
    assert updated(text) == text, 'run: python -m dcdrw.suite.tables docs/reference.md'


def test_a_table_without_a_place_is_told():
    with pytest.raises(ValueError, match='no place for the tables'):
        updated('<!-- table: topics -->\n<!-- end -->')


def test_example_rig_is_the_default_rig():
    default = TrialParams().rig.resolved()
    read = read_parameter_file(ROOT / 'config' / 'rig.yaml', TrialParams()).rig.resolved()
    assert read._replace(slope=0.0) == default._replace(slope=0.0)
    assert read.slope == pytest.approx(default.slope, abs=1e-4)

"""ROS's own linters, as `colcon test` runs them where they are installed; elsewhere ruff checks the same."""

import os
import re
from urllib.request import urlopen

import pytest

from tests import ROOT
from tests.test_packaging import PACKAGES

SOURCES = [str(ROOT / name) for name in (*PACKAGES, 'launch', 'setup.py')]
# Of the rules that exclude each other, the others; pyproject.toml says so to ruff.
OTHER_STYLE = ['D105', 'D107', 'D203', 'D213', 'D401', 'D403', 'D406', 'D407']
pytestmark = pytest.mark.filterwarnings('default')  # theirs


def test_copyright():
    """The license is stated once, in LICENSE and package.xml; no file repeats it."""
    linter = pytest.importorskip('ament_copyright.main')
    assert linter.main([str(ROOT / 'LICENSE'), str(ROOT / 'CONTRIBUTING.md')]) == 0


def test_flake8():
    linter = pytest.importorskip('ament_flake8.main')
    count, errors = linter.main_with_errors(['--config', str(ROOT / 'setup.cfg'), *SOURCES])
    assert count == 0, '\n'.join(errors)


def test_pep257():
    linter = pytest.importorskip('ament_pep257.main')
    assert linter.main([*SOURCES, '--add-ignore', *OTHER_STYLE]) == 0


def test_xmllint():
    """The schema that package.xml names is fetched, unless a catalog of XML (XML_CATALOG_FILES) has it."""
    linter = pytest.importorskip('ament_xmllint.main')
    schema = re.findall('http://[^"]*[.]xsd', (ROOT / 'package.xml').read_text())[0]
    try:
        urlopen(schema, timeout=10.0).close()
    except OSError:
        if 'XML_CATALOG_FILES' not in os.environ:
            pytest.skip(f'no network: {schema} cannot be fetched')
    assert linter.main([str(ROOT / 'package.xml'), str(ROOT / 'config')]) == 0

"""One ament_python package that pip and colcon install alike."""

import ast
import os
import re
import shutil
import subprocess
import sys
from configparser import ConfigParser
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from catkin_pkg.changelog import get_changelog_from_path

from dcdrw import entry
from dcdrw.suite.executables import EXECUTABLES
from tests import ROOT

PACKAGES = ('dcdrw_msgs_py', 'dcdrw_sim', 'dcdrw_tracker', 'dcdrw_control', 'dcdrw')
COMMANDS = set(entry.EXECUTABLES)
# Third-party modules and the package.xml key (rosdep) that brings each; those without a key come from PyPI alone.
KEYS = {
    'aiohttp': 'python3-aiohttp',
    'argcomplete': 'python3-argcomplete',
    'cv2': 'python3-opencv',
    'dask': None,
    'distributed': None,
    'llvmlite': 'python3-numba',
    'lz4': 'mcap-ros2-support',
    'matplotlib': 'python3-matplotlib',
    'mcap': 'mcap-ros2-support',
    'netCDF4': 'python3-netcdf4',
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'pupil_apriltags': None,
    'rich': 'python3-rich',
    'rosbags': 'python3-rosbags-pip',
    'scipy': 'python3-scipy',
    'xarray': None,
    'yaml': 'python3-yaml',
    'zstandard': 'mcap-ros2-support',
}


def config() -> ConfigParser:
    parser = ConfigParser()
    parser.read(ROOT / 'setup.cfg')
    return parser


def manifest() -> ElementTree.Element:
    return ElementTree.parse(ROOT / 'package.xml').getroot()


def imported() -> set[str]:
    """Top-level names that the packages and launch files import."""
    names: set[str] = set()
    for path in [*(path for package in PACKAGES for path in (ROOT / package).rglob('*.py')), *ROOT.glob('launch/*.py')]:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name.split('.')[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add((node.module or '').split('.')[0])
    return names - set(sys.stdlib_module_names) - set(PACKAGES)


def test_dependencies_are_exactly_what_is_imported():
    named_in_topics = {'std_msgs', 'sensor_msgs', 'geometry_msgs', 'diagnostic_msgs', 'rosgraph_msgs'}
    launched = set(re.findall("package='([^']+)'", (ROOT / 'launch/dcdrw.launch.py').read_text())) - {'dcdrw'}
    needed = {KEYS.get(name, name) for name in imported() | named_in_topics} - {None} | launched | {'ros2launch'}
    assert {element.text for element in manifest().findall('exec_depend')} == needed


def test_versions_and_names_agree():
    assert manifest().findtext('version') == config()['metadata']['version']
    assert manifest().findtext('name') == config()['metadata']['name'] == 'dcdrw'
    assert manifest().get('format') == '3'


def test_the_package_leads_to_the_paper_that_is_to_be_cited():
    (paper,) = yaml.safe_load((ROOT / 'CITATION.cff').read_text())['references']
    assert manifest().findtext('url') == paper['url']
    assert paper['url'] in (ROOT / 'docs/paper.md').read_text()


def test_each_executable_has_an_entry_point_and_a_script():
    lines = config()['options.entry_points']['console_scripts'].strip().splitlines()
    entries = dict(line.split(' = ') for line in lines)
    assert entries == {name: f'dcdrw.entry:{name}' for name in COMMANDS}
    for name in entries:
        script = ROOT / 'scripts' / name
        assert os.access(script, os.X_OK)
        assert f'from dcdrw.entry import {name}\n' in script.read_text()


def test_each_executable_has_a_declaration():
    assert {'dcdrw', 'suite', *(node.name for node in EXECUTABLES)} == COMMANDS


@pytest.fixture(scope='module')
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where pip installed a copy of the package; the copy keeps build files out of the tree."""
    folder = tmp_path_factory.mktemp('pip')
    source = folder / 'source'
    tracked = subprocess.run(['git', 'ls-files', '-z'], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for file in tracked.rstrip('\0').split('\0'):
        (source / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, source / file)
    # --ignore-installed: pip would take away the copy that this environment works with.
    subprocess.run(
        [
            sys.executable,
            '-m',
            'pip',
            'install',
            '--quiet',
            '--ignore-installed',
            '--no-deps',
            '--no-build-isolation',
            '--prefix',
            folder / 'prefix',
            source,
        ],
        check=True,
        capture_output=True,
    )
    return folder / 'prefix'


def test_pip_installs_what_ros2_run_looks_for(prefix):
    assert {path.name for path in (prefix / 'lib' / 'dcdrw').iterdir() if os.access(path, os.X_OK)} == COMMANDS
    assert (prefix / 'share/ament_index/resource_index/packages/dcdrw').exists()
    for file in (
        'package.xml',
        'config/rig.yaml',
        'config/foxglove_layout.json',
        'launch/trial.launch.py',
        'rviz/dcdrw.rviz',
    ):
        assert (prefix / 'share' / 'dcdrw' / file).exists()
    (site,) = prefix.glob('lib/python3*/site-packages')
    assert {path.name for path in site.iterdir() if not path.name.endswith('-info')} == set(PACKAGES)
    assert {path.parent.relative_to(site) for path in site.rglob('__init__.py')} == {
        path.parent.relative_to(ROOT) for package in PACKAGES for path in (ROOT / package).rglob('__init__.py')
    }


def test_installed_command_runs(prefix):
    (site,) = prefix.glob('lib/python3*/site-packages')
    done = subprocess.run(
        [sys.executable, prefix / 'lib' / 'dcdrw' / 'dcdrw', '--help'],
        capture_output=True,
        text=True,
        env={**os.environ, 'PYTHONPATH': str(site)},
        check=False,
    )
    assert done.returncode == 0
    assert 'simulate' in done.stdout


@pytest.mark.filterwarnings('ignore:nodes.Node.traverse:DeprecationWarning')  # catkin_pkg's own
def test_the_changelog_reads_as_catkin_reads_it_and_ends_with_this_version():
    changelog = get_changelog_from_path(str(ROOT), 'dcdrw')
    latest, _, entries = next(changelog.foreach_version())
    assert latest == manifest().findtext('version')
    assert entries

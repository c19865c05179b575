"""Imports point one way, and only nodes and message conversions know ROS."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import ROOT

PACKAGES = ('dcdrw_msgs_py', 'dcdrw_sim', 'dcdrw_tracker', 'dcdrw_control', 'dcdrw')
ALLOWED = {
    'dcdrw_msgs_py': set(),
    'dcdrw_sim': {'dcdrw_msgs_py'},
    'dcdrw_tracker': {'dcdrw_msgs_py'},
    'dcdrw_control': {'dcdrw_msgs_py'},
    'dcdrw': {'dcdrw_msgs_py', 'dcdrw_sim', 'dcdrw_tracker', 'dcdrw_control'},
}
KNOW_ROS = {
    'dcdrw_msgs_py.node',
    'dcdrw_msgs_py.executor',
    'dcdrw_msgs_py.messages',
    'dcdrw_msgs_py.image_messages',
    'dcdrw_msgs_py.wire',
    'dcdrw.nodes.observer',
    'dcdrw.nodes.suite',
}
MODULES = [
    '.'.join(path.relative_to(ROOT).with_suffix('').parts)
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob('*.py'))
    if path.stem != '__init__'
]
CORES = [module for module in MODULES if module not in KNOW_ROS and not module.endswith(('_node', '__main__'))]

BLOCK_ROS = """
import sys
from collections.abc import Iterator
from pathlib import Path
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in ('rclpy', 'std_msgs', 'sensor_msgs', 'geometry_msgs', 'diagnostic_msgs',
                                  'trajectory_msgs', 'builtin_interfaces', 'rcl_interfaces', 'rosgraph_msgs',
                                  'std_srvs'):
            raise ImportError(f'{name} is blocked')
sys.meta_path.insert(0, Blocked())
"""


def imports(path: Path) -> Iterator[str]:
    """The modules that a file imports anywhere, but for what type checkers alone read."""
    waiting: list[ast.AST] = [ast.parse(path.read_text(encoding='utf-8'))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ''
            yield from (f'{node.module}.{alias.name}' for alias in node.names)
        elif not (isinstance(node, ast.If) and ast.unparse(node.test) == 'TYPE_CHECKING'):
            waiting += ast.iter_child_nodes(node)


@pytest.mark.parametrize('package', PACKAGES)
def test_imports_point_one_way(package):
    for path in (ROOT / package).rglob('*.py'):
        for name in imports(path):
            top = name.split('.')[0]
            assert top not in PACKAGES or top == package or top in ALLOWED[package], f'{path} imports {name}'


def test_no_command_imports_another():
    commands = sorted((ROOT / 'dcdrw' / 'commands').glob('*.py'))
    assert len(commands) > 15
    for path in commands:
        others = {name for name in imports(path) if name.startswith('dcdrw.commands.')}
        assert not others, f'{path} imports {others}'


def test_no_module_imports_itself_through_others():
    """Imports made while a module runs count, too; those for type checkers do not."""
    paths = {'.'.join(p.relative_to(ROOT).with_suffix('').parts): p for k in PACKAGES for p in (ROOT / k).rglob('*.py')}
    ahead = {module: {name for name in imports(path) if name in paths} for module, path in paths.items()}
    while leaves := {module for module, names in ahead.items() if not names}:
        ahead = {module: names - leaves for module, names in ahead.items() if module not in leaves}
    assert not ahead


def test_arrows_between_the_rooms_of_the_command_line_point_down():
    """A room imports those after it alone."""
    rooms = ('commands', 'trials', 'nodes', 'page', 'recordings', 'suite', 'drawings')
    for path in (ROOT / 'dcdrw').rglob('*.py'):
        room = path.relative_to(ROOT / 'dcdrw').parts[0]
        if room not in rooms:
            continue
        for name in imports(path):
            other = name.split('.')[1] if name.startswith('dcdrw.') and name.count('.') > 1 else room
            assert other not in rooms or rooms.index(other) >= rooms.index(room), f'{path} imports {name}'


def test_cores_import_without_ros():
    code = BLOCK_ROS + '\n'.join(f'import {module}' for module in CORES)
    done = subprocess.run([sys.executable, '-c', code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_simulate_runs_without_ros(tmp_path):
    case = ROOT / 'tests' / 'data' / 'strikes.json'
    code = BLOCK_ROS + f'from dcdrw.cli import main; sys.exit(main(["simulate", {str(case)!r}, "--count", "2"]))'
    done = subprocess.run([sys.executable, '-c', code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert '"strikes"' in done.stdout


def test_trial_without_ros_says_what_to_install(tmp_path):
    code = BLOCK_ROS + 'from dcdrw.cli import main; sys.exit(main(["trial"]))'
    done = subprocess.run(
        [sys.executable, '-c', code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env={'PYTHONPATH': str(ROOT), 'PATH': ''},
    )
    assert done.returncode == 2
    assert done.stderr.startswith('dcdrw trial: a trial needs rclpy:')
    assert not list(tmp_path.iterdir())

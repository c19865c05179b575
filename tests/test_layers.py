"""Imports point one way, and only nodes and message conversions know ROS."""

import ast
import subprocess
import sys

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
    'dcdrw.nodes.observer',
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
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in ('rclpy', 'std_msgs', 'sensor_msgs', 'geometry_msgs', 'diagnostic_msgs',
                                  'builtin_interfaces', 'rcl_interfaces', 'rosgraph_msgs', 'std_srvs'):
            raise ImportError(f'{name} is blocked')
sys.meta_path.insert(0, Blocked())
"""


@pytest.mark.parametrize('package', PACKAGES)
def test_imports_point_one_way(package):
    for path in (ROOT / package).rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            names = (
                [alias.name for alias in node.names]
                if isinstance(node, ast.Import)
                else [node.module or '']
                if isinstance(node, ast.ImportFrom)
                else []
            )
            for name in names:
                top = name.split('.')[0]
                assert top not in PACKAGES or top == package or top in ALLOWED[package], f'{path} imports {name}'


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

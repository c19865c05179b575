"""Launch files start what there is. What they make of their arguments is seen where ROS's launch is installed."""

import ast
import runpy

import pytest

from dcdrw import cli
from dcdrw.suite.executables import EXECUTABLES, TRIAL
from tests import ROOT

FILES = sorted((ROOT / 'launch').glob('*.launch.py'))
COMPOSITION = ROOT / 'launch' / 'dcdrw.launch.py'
NAMES = {node.name for node in EXECUTABLES}
CORE = {'phase_estimator', 'sync_monitor'}


def first_arguments(function: str) -> set[str]:
    """The constants that the composition gives to a function first."""
    return {
        call.args[0].value
        for call in ast.walk(ast.parse(COMPOSITION.read_text(encoding='utf-8')))
        if isinstance(call, ast.Call)
        and getattr(call.func, 'id', '') == function
        and call.args
        and isinstance(call.args[0], ast.Constant)
    }


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.name)
def test_each_file_makes_a_description(file):
    tree = ast.parse(file.read_text(encoding='utf-8'))
    assert 'generate_launch_description' in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert ast.get_docstring(tree)


def test_every_node_and_command_of_the_composition_exists(capsys):
    assert first_arguments('node') <= NAMES
    assert first_arguments('node') >= {node.name for node in TRIAL}
    with pytest.raises(SystemExit):
        cli.main(['--help'])
    words = set(capsys.readouterr().out.split())
    assert first_arguments('command') <= words


def test_the_docs_name_every_argument():
    for statement in ast.parse(COMPOSITION.read_text(encoding='utf-8')).body:
        if isinstance(statement, ast.Assign) and statement.targets[0].id == 'ARGUMENTS':
            names = {key.value for key in statement.value.keys}
    told = (ROOT / 'docs' / 'tools.md').read_text(encoding='utf-8').split('## Launch files')[1]
    assert {name for name in names if f'`{name}`' not in told and f'`{name}:=' not in told} == set()


@pytest.fixture
def started():
    launch = pytest.importorskip('launch')
    launch_ros = pytest.importorskip('launch_ros')
    module = runpy.run_path(str(COMPOSITION))

    def start(**arguments: str) -> dict[str, list[str]]:
        """What runs with these arguments: nodes by their executables, commands by their names."""
        context = launch.LaunchContext()
        context.launch_configurations.update({name: default for name, (default, *_) in module['ARGUMENTS'].items()})
        context.launch_configurations.update(arguments)
        actions = module['_actions'](context)
        nodes = [action for action in actions if isinstance(action, launch_ros.actions.Node)]
        handlers = [action for action in actions if isinstance(action, launch.actions.RegisterEventHandler)]
        return {
            'nodes': [node.node_executable for node in nodes],
            'respawned': [node.node_executable for node in nodes if node._ExecuteLocal__respawn],
            'ending_all': len(handlers),
            'enclaves': {
                node.node_executable: node._Node__ros_arguments[1] for node in nodes if node._Node__ros_arguments
            },
            'environments': [
                {
                    launch.utilities.perform_substitutions(context, name): launch.utilities.perform_substitutions(
                        context, value
                    )
                    for name, value in action.additional_env or ()
                }
                for action in actions
                if action not in [*nodes, *handlers]
            ],
            'commands': [
                [launch.utilities.perform_substitutions(context, part) for part in action.cmd[1:]]
                for action in actions
                if action not in [*nodes, *handlers]
            ],
        }

    return start


def test_simulation_is_what_runs_without_arguments(started):
    running = started()
    assert set(running['nodes']) == {node.name for node in TRIAL}
    assert running['commands'] == []


def test_switches_add_their_tools(started):
    assert set(started(markers='true')['nodes']) == {*CORE, 'simulator', 'rig_markers'}
    assert set(started(record='true')['nodes']) == {*CORE, 'simulator', 'recorder'}
    watched = started(live='true', namespace='lab')
    assert 'recorder' in watched['nodes']  # for the page's button
    assert watched['commands'] == [['live', '--namespace', 'lab']]


def test_the_robots_legs_follow_people_or_the_front_wheel(started):
    assert set(started(source='legs', xrl_reference='true')['nodes']) == {*CORE, 'leg_tracker', 'xrl_reference'}
    assert set(started(xrl_reference='true')['nodes']) == {*CORE, 'simulator', 'xrl_reference'}


def test_one_process_takes_the_place_of_several(started):
    assert set(started(one_process='true')['nodes']) == {'suite', 'simulator'}


def test_a_recording_takes_the_place_of_the_simulator(started):
    running = started(source='recording', recording='day/7', real_time_factor='2')
    assert set(running['nodes']) == CORE
    assert running['commands'] == [['replay', 'day/7', '--rate', '2']]
    spaced = started(source='recording', recording='day/7', namespace='lab')
    assert spaced['commands'] == [['replay', 'day/7', '--into', 'lab']]
    with pytest.raises(ValueError, match='needs recording:='):
        started(source='recording')


def test_a_node_that_ends_ends_all_or_starts_again_as_an_argument_says(started):
    assert (started()['respawned'], started()['ending_all']) == ([], 0)
    assert set(started(on_exit='respawn')['respawned']) == {*CORE, 'simulator'}
    assert started(on_exit='end', live='true')['ending_all'] == 5  # simulator, estimator, monitor, recorder, page


def test_a_person_in_front_comes_with_the_synchronizer(started):
    assert set(started(person='true', xrl_reference='true')['nodes']) == {
        *CORE,
        'simulator',
        'synchronizer',
        'xrl_reference',
    }
    assert set(started(person='true', one_process='true')['nodes']) == {'suite', 'simulator'}
    assert set(started(synchronizer='true')['nodes']) == {*CORE, 'simulator', 'synchronizer'}


def test_nodes_have_enclaves_of_their_own_and_the_page_the_operators(started):
    guarded = started(enclaves='true', record='true', live='true')
    assert guarded['enclaves'] == {name: f'/dcdrw/{name}' for name in (*CORE, 'simulator', 'recorder')}
    assert guarded['environments'] == [{'ROS_SECURITY_ENCLAVE_OVERRIDE': '/dcdrw/operator'}]
    assert (started()['enclaves'], started(live='true')['environments']) == ({}, [{}])
    for other in ({'one_process': 'true'}, {'rviz': 'true'}, {'source': 'recording', 'recording': 'day/7'}):
        with pytest.raises(ValueError, match='enclaves:=true has none for'):
            started(enclaves='true', **other)


def test_a_rig_is_seen_by_the_tag_tracker(started):
    assert set(started(source='rig', camera='0', calibration='lens.yaml')['nodes']) == {*CORE, 'tag_tracker'}


def test_people_are_followed_by_the_leg_tracker(started):
    assert set(started(source='legs')['nodes']) == {*CORE, 'leg_tracker'}

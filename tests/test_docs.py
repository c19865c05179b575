"""The docs say what the code does: their commands, examples, links and tables."""

import re
import runpy
import shlex
import shutil
from configparser import ConfigParser
from glob import glob
from itertools import pairwise

import pytest

from dcdrw.cli import COMMANDS, main
from dcdrw.command_line import CommandLine
from dcdrw.suite.executables import EXECUTABLES
from dcdrw.suite.parameter_file import TrialParams, read_parameter_file
from dcdrw.suite.tables import updated
from dcdrw_msgs_py.quantity import fields
from tests import ROOT
from tests.snippets import ELSEWHERE, PAGES, blocks, commands, inline, targets
from tests.trials import STIFF

QUICK = {'legs', 'map', 'simulate', 'tags', 'urdf'}
"""Commands that are run as they stand in the docs. Of the others the arguments are read; their own tests run them."""
ON_TRIALS = {'analyze', 'control', 'mend', 'models', 'report'}
"""Likewise, where `trials` and recordings lie that were made before."""
NODES = {node.name: {field.name for params in node.parameters for field in fields(params)} for node in EXECUTABLES}
TOPICS = {topic.name.lstrip('/'): topic.type for node in EXECUTABLES for topic in (*node.subscribes, *node.publishes)}
SERVICES = {
    f'/{node.name}/{name}': type_.rstrip(')')
    for node in EXECUTABLES
    for name, type_ in (service.removeprefix('~/').split(' (') for service in node.services)
}
STANDING = list(commands())


def dcdrw(words: list[str]) -> None:
    _, unknown = CommandLine(COMMANDS, '', '').parser.parse_known_args(words)
    assert not unknown


def ros2(words: list[str]) -> None:
    match words:
        case ['run', 'dcdrw', 'dcdrw', *rest]:
            dcdrw(rest)
        case ['run', 'dcdrw', node, *rest]:
            assert node in {*NODES, 'suite'}
            for before, assignment in pairwise(rest):
                if before == '-p':
                    assert assignment.split(':=')[0] in NODES[node]
        case ['launch', 'dcdrw', file, *rest]:
            assert (ROOT / 'launch' / file).exists()
            text = (ROOT / 'launch' / 'dcdrw.launch.py').read_text(encoding='utf-8')
            for argument in rest:
                assert argument == '--show-args' or f"    '{argument.split(':=')[0]}': (" in text
        case ['topic', *_]:
            (topic,) = (word for word in words if word.startswith('/'))
            kind = [word for word in words if '/msg/' in word]
            assert kind in ([], [TOPICS[topic.lstrip('/')]])
        case ['service', 'call', service, kind, *_]:
            assert SERVICES[service] == kind
        case ['param', 'set', node, name, _]:
            assert name in NODES[node.lstrip('/')]
        case [('run' | 'pkg'), *_]:  # another package's, which is not here
            pass
        case _:
            raise AssertionError('what does ros2 do with this?')


def make(words: list[str]) -> None:
    assert re.search(rf'^{words[0]}:', (ROOT / 'Makefile').read_text(encoding='utf-8'), re.MULTILINE)


def pip(words: list[str]) -> None:
    setup = ConfigParser()
    setup.read(ROOT / 'setup.cfg')
    for extras in re.findall(r'\[(.*?)\]', ' '.join(words)):
        known = {'distributed', *setup['options.extras_require']}
        assert set(extras.split(',')) <= known


def python(words: list[str]) -> None:
    assert (ROOT / words[0]).exists()


READERS = {'dcdrw': dcdrw, 'ros2': ros2, 'make': make, 'pip': pip, 'python': python}


@pytest.mark.parametrize(('snippet', 'words'), STANDING, ids=[str(snippet) for snippet, _ in STANDING])
def test_every_command_takes_its_arguments(snippet, words, capsys):
    program = words[0].removeprefix('.venv/bin/')
    if program not in READERS:
        assert program in ELSEWHERE or program.startswith('share=') or program == 'pre-commit'
        return
    status: object = None
    try:
        READERS[program](words[1:])
    except SystemExit as end:  # by --help, or by what the parser refuses
        status = end.code
    assert not status, capsys.readouterr().err


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_quick_commands_of_a_page_run(page, tmp_path, monkeypatch, capsys):
    (tmp_path / 'tests').symlink_to(ROOT / 'tests')
    shutil.copy(ROOT / 'config' / 'rig.yaml', tmp_path / 'my_rig.yaml')
    shutil.copy(ROOT / 'tests' / 'data' / 'strikes.json', tmp_path / 'case.json')
    monkeypatch.chdir(tmp_path)
    for snippet, words in STANDING:
        if snippet.page == page and words[0] == 'dcdrw' and words[1] in QUICK:
            assert main(words[1:]) == 0, (str(snippet), capsys.readouterr().err)


@pytest.mark.processes
@pytest.mark.parametrize(
    'line', sorted({shlex.join(words) for _, words in STANDING if words[0] == 'dcdrw' and words[1] in ON_TRIALS})
)
def test_commands_on_trials_run(line, live_trial, tmp_path, monkeypatch, capsys):
    for trial in ('first', 'second'):
        shutil.copytree(live_trial, tmp_path / 'trials' / trial)
    for bag in ('my_bag', 'killed_bag'):
        shutil.copytree(live_trial / 'recording', tmp_path / bag)
    (tmp_path / 'my_rig.yaml').write_text(STIFF)
    monkeypatch.chdir(tmp_path)
    words = [path for word in shlex.split(line)[1:] for path in sorted(glob(word)) or [word]]
    assert main(words) == 0, capsys.readouterr().err


def test_commands_within_sentences_exist():
    known = CommandLine(COMMANDS, '', '').commands
    for snippet in inline():
        if snippet.code.startswith('dcdrw ') and not snippet.code.startswith('dcdrw --'):
            name, *rest = shlex.split(snippet.code)[1:]
            assert name in known, str(snippet)
            known[name].load()
            options = {word.split('=')[0] for word in rest if word.startswith('--')}
            assert options <= set(known[name].option_strings), str(snippet)


def test_links_lead_somewhere():
    for snippet in targets():
        file, _, anchor = snippet.code.partition('#')
        path = snippet.page.parent / file if file else snippet.page
        assert path.exists(), f'{snippet}: {snippet.code}'
        if anchor:
            headings = re.findall(r'^#+ (.*)', path.read_text(encoding='utf-8'), re.MULTILINE)
            slugs = {re.sub(r'[^\w -]', '', heading.lower()).replace(' ', '-') for heading in headings}
            assert anchor in slugs, f'{snippet}: {snippet.code}'


def test_every_page_is_on_the_site():
    listed = (ROOT / 'docs' / 'index.md').read_text(encoding='utf-8').splitlines()
    assert {path.stem for path in (ROOT / 'docs').glob('*.md')} - {'index'} <= set(listed)


def test_files_that_are_named_exist():
    tops = {path.name for path in ROOT.iterdir() if path.is_dir()}
    for snippet in inline():
        if re.fullmatch(r'[\w./-]+/[\w-]+\.[a-z]+', snippet.code) and snippet.code.split('/')[0] in tops:
            assert (ROOT / snippet.code).exists(), f'{snippet}: {snippet.code}'


FEWER = {'3000': '20', 'seconds, 24)': 'seconds, 2)', '(200.0, 1000.0)': '(50.0,)', '(8, 10, 12, 16, 20, 24)': '(12,)'}
"""What makes the block that takes a minute take seconds."""


def test_what_takes_a_minute_runs_with_fewer_starts(capsys):
    (snippet,) = blocks('python slow')
    code = snippet.code
    for many, few in FEWER.items():
        assert many in code
        code = code.replace(many, few)
    exec(compile(code, str(snippet), 'exec'), {})
    told = capsys.readouterr().out
    assert re.search(r'^12 \S+ 1\.8655', told, re.MULTILINE), 'the gentlest slope on which no damper stalls, as above'
    assert "('IN_STEP', np.int64(20))" in told, 'with the stiff damper'


@pytest.mark.parametrize('snippet', list(blocks('python')), ids=str)
def test_example_runs_as_it_stands(snippet, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'example.py').write_text(snippet.code, encoding='utf-8')
    runpy.run_path('example.py')


def test_readme_is_read_in_a_minute():
    assert len((ROOT / 'README.md').read_text(encoding='utf-8').splitlines()) <= 150


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

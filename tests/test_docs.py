"""The docs say what the code does: their examples, links, tables and what they quote."""

import re
import runpy

import pytest

from dcdrw import preset, simulate
from dcdrw.suite.executables import EXECUTABLES
from dcdrw.suite.parameter_file import TrialParams, read_parameter_file, read_uncertainty
from dcdrw.suite.tables import updated
from dcdrw_msgs_py.messages import PhaseSampleWriter
from dcdrw_msgs_py.samples import PhaseSample, Turn
from tests import ROOT
from tests.snippets import blocks, fences, inline, targets


def test_every_block_says_what_it_is():
    """What is indented is commands (tests/test_docs_commands.py); all else has a language, and a test that reads it."""
    for language, block in fences():
        assert language.startswith(('python', 'yaml', 'text', '{')) or block.page.name == 'CONTRIBUTING.md', str(block)
        assert not re.search(r'^(\$ )?(dcdrw|ros2|python|pip|make) ', block.code, re.MULTILINE), str(block)


@pytest.mark.parametrize('block', blocks('yaml'), ids=str)
def test_a_parameter_file_is_read(block, tmp_path):
    path = tmp_path / 'rig.yaml'
    path.write_text(block.code, encoding='utf-8')
    assert read_parameter_file(path, TrialParams()) != TrialParams()
    assert (read_uncertainty(path) is not None) == ('uncertainty:' in block.code)


def test_a_diagram_names_nodes_topics_and_packages_that_there_are():
    there = {topic.name for node in EXECUTABLES for topic in (*node.subscribes, *node.publishes)}
    there |= {node.name for node in EXECUTABLES} | {path.name for path in ROOT.glob('dcdrw_*')}
    there |= {'joint_trajectory_controller'}
    for block in blocks('text'):
        if '▶' in block.code:
            assert set(re.findall(r'\b[a-z/]+_[a-z_]+\b', block.code)) <= there, str(block)


def test_the_verdict_in_the_readme_is_that_of_the_papers_trial():
    (told,) = (block.code for block in blocks('text') if block.page.name == 'README.md')
    assert told.strip() == simulate(preset('paper'), phase=0.216, seconds=30.0).summary.sentence


@pytest.mark.parametrize('page', ['contract.md', 'reference.md'])
def test_phase_state_is_told_name_by_name(page):
    (told,) = re.findall(r'^- `phase_state`.*?(?=^- )', (ROOT / 'docs' / page).read_text(), re.MULTILINE | re.DOTALL)
    sample = PhaseSample(1, *[Turn(0.0, 0.0)] * 3, 0, 0, 0, 0, sources=2, resolution=0.1)
    assert set(re.findall(r'`(\w+)`', told)) == {'phase_state', *PhaseSampleWriter().write(sample).name}


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


@pytest.mark.parametrize('snippet', blocks('python'), ids=str)
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

"""Nothing is overwritten unasked, whatever command would write it; the refusal comes before the work."""

import pytest

from dcdrw.cli import main

FILES = {
    'analyze --json mine.json there': 'mine.json',
    'calibrate roll.mp4 --camera camera.yaml --out mine.yaml': 'mine.yaml',
    'control --json mine.json': 'mine.json',
    'control --out mine.yaml': 'mine.yaml',
    'design --json mine.json': 'mine.json',
    'design --out mine': 'mine/card.pdf',
    'design --out mine --format svg': 'mine/design.json',
    'figures --out mine --only riddle': 'mine/riddle.png',
    'film --out film.mkv': 'film.rig.yaml',
    'film --out mine.mp4': 'mine.mp4',
    'identify there --rig rig.yaml --out mine': 'mine/rig.yaml',
    'legs walk.csv --json mine.json': 'mine.json',
    'legs walk.csv --out mine': 'mine/summary.json',
    'map --json mine.json': 'mine.json',
    'mend there --out mine': 'mine/recording.mcap',
    'models --json mine.json': 'mine.json',
    'models --out mine': 'mine/pair.png',
    'regimes --json mine.json': 'mine.json',
    'report there --out mine.html': 'mine.html',
    'report there --out page.html': 'page.csv',
    'simulate case.json --strikes mine.json': 'mine.json',
    'simulate case.json --strikes s.json --trajectory mine.csv --rate 10': 'mine.csv',
    'sweep --out mine.nc': 'mine.nc',
    'sweep --out s.nc': 's.nc.parts/mine',
    'tags --out mine.pdf': 'mine.pdf',
    'track film.mp4 --camera camera.yaml --out mine': 'mine/summary.json',
    'trial --out mine': 'mine/summary.json',
    'urdf --out mine.urdf': 'mine.urdf',
}
"""What is there before each command."""


@pytest.mark.parametrize(('line', 'name'), FILES.items(), ids=FILES)
def test_nothing_is_overwritten_unasked(line, name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mine = tmp_path / name
    mine.parent.mkdir(exist_ok=True)
    mine.write_text('mine')
    before = sorted(tmp_path.rglob('*'))
    assert main(line.split()) == 2
    assert f'{name.split("/")[0]}' in capsys.readouterr().err
    assert mine.read_text() == 'mine'
    assert sorted(tmp_path.rglob('*')) == before

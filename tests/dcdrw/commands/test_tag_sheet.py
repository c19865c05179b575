"""`dcdrw tags`: what is printed is as large as it says, and is the right tag the right way up."""

import re
import shutil
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest

from dcdrw.cli import main
from dcdrw.commands.tag_sheet import PAPERS, draw_pages
from dcdrw_msgs_py.opencv import tag_dictionary
from dcdrw_msgs_py.tagging import TagGroup, TagParams

pytestmark = pytest.mark.processes

cv2 = pytest.importorskip('cv2')
pytest.importorskip('matplotlib')
POINTS = 72.0 / 25.4
DPI = 100
SEVERAL = TagParams(
    size=0.05,
    front=TagGroup((3, 8, 21), (0.0, 90.0, 0.0), (0.0, 0.1, 0.2), (0.0, 0.0, 0.1)),
    rear=TagGroup((5, 6), (45.0, 0.0), (0.0, 0.0), (0.0, 0.1)),
)


def grey(page) -> np.ndarray:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(page)
    page.set_dpi(DPI)
    canvas.draw()
    return cv2.cvtColor(np.asarray(canvas.buffer_rgba())[..., :3].copy(), cv2.COLOR_RGB2GRAY)


def detect(image: np.ndarray) -> dict[int, np.ndarray]:
    """Corners by id, from the tag's upper left one; ArUco's upright is half a turn from AprilTag's."""
    dictionary = tag_dictionary('36h11')
    found, ids = (
        cv2.aruco.ArucoDetector(dictionary).detectMarkers(image)[:2]
        if hasattr(cv2.aruco, 'ArucoDetector')
        else cv2.aruco.detectMarkers(image, dictionary)[:2]
    )
    return {int(tag): np.roll(corner[0], 2, axis=0) for tag, corner in zip(np.ravel(ids), found, strict=True)}


def outlines(path: Path) -> list[list[np.ndarray]]:
    """For each page of a PDF, the points of each path that it draws [mm]."""
    pages = []
    for stream in re.findall(rb'stream\r?\n(.*?)\r?\nendstream', path.read_bytes(), re.DOTALL):
        try:
            text = zlib.decompress(stream).decode('latin-1')
        except zlib.error:
            continue
        drawn = [re.findall(r'([-\d.]+) ([-\d.]+) [ml]\b', block) for block in re.split(r'\n(?:S|f|B|b|s|n)\b', text)]
        paths = [np.array(points, float) / POINTS for points in drawn if points]
        if len(paths) > 20:  # not a letter's shape
            pages.append(paths)
    return pages


@pytest.mark.parametrize('paper', ['a4', 'letter'])
def test_pdf_is_true_to_scale(tmp_path, paper):
    out = tmp_path / 'tags.pdf'
    assert main(['tags', '--out', str(out), '--paper', paper]) == 0
    boxes = re.findall(rb'/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]', out.read_bytes())
    assert len(boxes) == 2
    for box in boxes:
        assert [float(side) / POINTS for side in box] == pytest.approx(PAPERS[paper], abs=0.01)
    pages = outlines(out)
    assert len(pages) == 2
    for paths in pages:
        sizes = [np.ptp(points, axis=0) for points in paths]
        assert any(size == pytest.approx((160.0, 160.0), abs=0.01) for size in sizes), 'the black square'
        assert any(size == pytest.approx((100.0, 0.0), abs=0.01) for size in sizes), 'the ruler'
        assert any(size == pytest.approx((200.0, 211.0), abs=0.01) for size in sizes), 'the cut line'
        everything = np.concatenate(
            [
                points
                for points, size in zip(paths, sizes, strict=True)
                if size != pytest.approx(PAPERS[paper], abs=0.01)
            ]
        )  # the paper itself
        assert everything.min() >= 5.0 - 1e-3
        assert np.all(everything.max(axis=0) <= np.array(PAPERS[paper]) - 5.0 + 1e-3)


@pytest.mark.parametrize('paper', PAPERS)
def test_each_tag_is_found_upright_and_as_large_as_it_says(paper):
    found = {}
    for page in draw_pages(TagParams(), paper):
        found |= detect(grey(page))
    assert found.keys() == {0, 1}
    for corner in found.values():
        top_left, top_right, bottom_right, bottom_left = corner
        side = 160.0 / 25.4 * DPI
        assert top_right - top_left == pytest.approx((side, 0.0), abs=2.5)
        assert bottom_left - top_left == pytest.approx((0.0, side), abs=2.5)
        assert bottom_right - top_left == pytest.approx((side, side), abs=2.5)


def test_small_tags_share_a_page():
    pages = draw_pages(SEVERAL, 'a4')
    assert len(pages) == 1
    assert detect(grey(pages[0])).keys() == {3, 8, 21, 5, 6}


def test_many_tags_take_several_pages():
    many = TagParams(size=0.08, front=TagGroup(*((tuple(range(9)), *((0.0,) * 9,) * 3))))
    many = many._replace(rear=TagGroup((20,)))
    pages = draw_pages(many, 'a4')
    found = [detect(grey(page)).keys() for page in pages]
    assert len(pages) > 1
    assert set().union(*found) == {*range(9), 20}
    assert sum(map(len, found)) == 10


def test_the_arrow_shows_the_slope_normal_whatever_the_mounting_angle():
    tags = TagParams(front=TagGroup((0,), (90.0,)))
    arrows = [text for page in draw_pages(tags, 'a4') for text in page.axes[0].texts if hasattr(text, 'arrow_patch')]
    turned, straight = (np.subtract(arrow.xy, arrow.get_position()) for arrow in arrows)
    assert straight / np.linalg.norm(straight) == pytest.approx((0.0, 1.0))
    # This tag's upright is a quarter turn counter-clockwise from the normal, which so is to the upright's right.
    assert turned / np.linalg.norm(turned) == pytest.approx((1.0, 0.0), abs=1e-9)


@pytest.mark.skipif(not shutil.which('pdftoppm'), reason='pdftoppm (poppler-utils) is not installed')
def test_another_program_prints_the_same(tmp_path):
    assert main(['tags', '--out', str(tmp_path / 'tags.pdf')]) == 0
    subprocess.run(['pdftoppm', '-r', str(DPI), '-gray', '-png', 'tags.pdf', 'page'], cwd=tmp_path, check=True)
    found = {}
    for image in sorted(tmp_path.glob('page*.png')):
        found |= detect(cv2.imread(str(image), cv2.IMREAD_GRAYSCALE))
    assert found.keys() == {0, 1}
    for corner in found.values():
        assert np.hypot(*(corner[1] - corner[0])) == pytest.approx(160.0 / 25.4 * DPI, abs=2.5)


@pytest.mark.parametrize(
    ('arguments', 'rig', 'message'),
    [
        (['--out', 'tags.png'], '', '--out must end in .pdf, got tags.png'),
        (['--out', 'there.pdf'], '', 'there.pdf exists already, not overwriting'),
        (['--out', 'tags.pdf'], 'size: 0.3', 'a tag of 300 mm is 375 mm wide with its white border; a4 takes tags of'),
        (['--out', 'tags.pdf'], 'front.ids: [1]', 'tag 1 is mounted twice'),
        (['--out', 'tags.pdf'], 'family: 99h9', 'family must be one of'),
        (['--out', 'tags.pdf'], 'sise: 0.1', 'sise is not a parameter'),
    ],
)
def test_wrong_input_is_told_in_one_line(tmp_path, monkeypatch, capsys, arguments, rig, message):
    monkeypatch.chdir(tmp_path)
    Path('there.pdf').write_text('')
    Path('rig.yaml').write_text(f'/**:\n  ros__parameters: {{{rig}}}\n')
    assert main(['tags', '--rig', 'rig.yaml', *arguments]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith('dcdrw tags: ')
    assert message in lines[0]
    assert not Path('tags.pdf').exists()

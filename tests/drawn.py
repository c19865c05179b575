"""What a figure shows once it is drawn: its words, and where they stand."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from typing import Any
from unittest.mock import patch

from matplotlib.text import Text

from dcdrw.drawings import figure_files
from dcdrw_sim.figures.style import POINTS


def words(figure: Any) -> list[Text]:
    """The texts that were drawn: neither hidden ones, nor ticks beyond an axis' limits."""
    drawn = []
    draw = Text.draw

    def note(text: Text, *args: Any, **kwargs: Any) -> None:
        if text.get_visible() and text.get_text().strip():
            drawn.append(text)
        draw(text, *args, **kwargs)

    with patch.object(Text, 'draw', note):
        figure.canvas.draw()
    return drawn


def assert_readable(figure: Any) -> None:
    """Assert that no words cover others or leave the figure, and that all can be read in print."""
    boxes = [(text, (text.get_bbox_patch() or text).get_window_extent()) for text in words(figure)]
    for text, box in boxes:
        assert text.get_fontsize() >= POINTS, text
        assert figure.bbox.x0 <= box.x0 <= box.x1 <= figure.bbox.x1, text
        assert figure.bbox.y0 <= box.y0 <= box.y1 <= figure.bbox.y1, text
    for (one, first), (other, second) in combinations(boxes, 2):
        assert not first.shrunk(0.98, 0.9).overlaps(second.shrunk(0.98, 0.9)), (one, other)


@contextmanager
def readable_figures() -> Iterator[list[Any]]:
    """Assert of each figure that a command writes meanwhile that it is readable; they are noted in the list."""
    written = []
    save = figure_files.save

    def check(figure: Any, path: Path) -> None:
        assert_readable(figure)
        written.append(figure)
        save(figure, path)

    with patch.object(figure_files, 'save', check):
        yield written

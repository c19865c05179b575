"""What all pictures share: a figure without a window, the colours, and how it is saved."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dcdrw_msgs_py.rig import FRONT, REAR

# Okabe and Ito's palette: told apart by the colour-blind, and in grey by lightness.
BLUE, ORANGE, VERMILION, GREEN, BLACK = '#0072B2', '#E69F00', '#D55E00', '#009E73', '#000000'
SKY, PINK = '#56B4E9', '#CC79A7'
WHEELS = {FRONT: BLUE, REAR: VERMILION}
BAND = GREEN
"""Colour of what is in step."""
FORMATS = 'png', 'pdf', 'svg'
COLUMN, PAGE = 3.5, 7.2
"""Width of a journal's column and of its page [inch]."""
POINTS = 8
"""Size of letters in print [pt]."""
_PRINT = {
    **{f'{what}.labelsize': POINTS for what in ('axes', 'xtick', 'ytick')},
    **{f'{what}.titlesize': POINTS for what in ('axes', 'figure')},
    'font.size': POINTS,
    'legend.fontsize': POINTS,
    'legend.columnspacing': 0.9,
    'legend.handlelength': 1.3,
    'legend.handletextpad': 0.5,
    'axes.linewidth': 0.6,
    'lines.linewidth': 1.0,
    'lines.markersize': 4,
    'xtick.major.width': 0.6,
    'ytick.major.width': 0.6,
}


def new_figure(width: float, height: float, what: str = 'a picture') -> Any:
    """An empty matplotlib figure of this size [inch]; `what` it is, for a message.

    Raises:
        ValueError: matplotlib is not installed.

    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise ValueError(f'{what} needs matplotlib: pip install matplotlib') from None
    figure = Figure(figsize=(width, height), layout='constrained')
    FigureCanvasAgg(figure)
    return figure


@contextmanager
def for_print() -> Iterator[None]:
    """What is drawn within has letters to be read at the size that it is drawn at.

    Raises:
        ValueError: matplotlib is not installed.

    """
    new_figure(1, 1)  # tells where it is missing
    from matplotlib import rc_context

    with rc_context(_PRINT):
        yield


def save(figure: Any, path: Path) -> None:
    """Save a figure as PNG, PDF or SVG, by the ending of the name; words stay words, that they can be edited."""
    from matplotlib import rc_context

    with rc_context({'pdf.fonttype': 42, 'svg.fonttype': 'none'}):
        figure.savefig(path, dpi=300)

"""What all pictures share: a figure without a window, the colours, and how it is saved."""

from pathlib import Path
from typing import Any

from dcdrw_msgs_py.rig import FRONT, REAR

# Okabe and Ito's palette: told apart by the colour-blind, and in grey by lightness.
BLUE, ORANGE, VERMILION, GREEN, BLACK = '#0072B2', '#E69F00', '#D55E00', '#009E73', '#000000'
SKY, PINK = '#56B4E9', '#CC79A7'
WHEELS = {FRONT: BLUE, REAR: VERMILION}
BAND = GREEN
"""Of what is in step."""
FORMATS = 'png', 'pdf', 'svg'


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


def save(figure: Any, path: Path) -> None:
    """Save a figure as PNG, PDF or SVG, by the ending of the name; words stay words, that they can be edited."""
    from matplotlib import rc_context

    with rc_context({'pdf.fonttype': 42, 'svg.fonttype': 'none'}):
        figure.savefig(path, dpi=160)

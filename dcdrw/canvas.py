"""Figures to draw on and to save, without a window."""

from typing import Any


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

"""What all figures have in common."""

import numpy as np

from dcdrw_sim.figures.style import new_figure, save


def test_a_curve_without_a_gap_is_drawn_without_one(tmp_path):
    from matplotlib.image import imread

    figure = new_figure(16.0, 1.0)
    figure.subplots().plot(np.resize([0.0, 1.0], 1200), color='red', linewidth=0.5)
    save(figure, tmp_path / 'curve.png')
    picture = imread(tmp_path / 'curve.png')
    columns = np.flatnonzero(((picture[..., 0] > 0.9) & (picture[..., 1] < 0.5)).any(axis=0))
    assert (np.diff(columns) == 1).all()

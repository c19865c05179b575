"""The axes of a view, and the similarity within its plane."""

import math

import numpy as np
import pytest

from dcdrw_tracker.tags.view_plane import axes, fit_similarity


@pytest.mark.parametrize('slant', [(0.0, 0.0), (0.6, 0.0), (-0.4, 0.3)])
@pytest.mark.parametrize('roll', [0.0, 0.1])
def test_axes_are_orthonormal_and_flattening_is_undone(slant, roll):
    view = axes(np.array(slant), roll)
    assert np.array(view) @ np.array(view).T == pytest.approx(np.eye(3), abs=1e-12)
    rays = np.array([(0.1, 0.2), (-0.3, 0.05), (0.0, 0.0)])
    assert view.unflatten(view.flatten(rays)) == pytest.approx(rays, abs=1e-12)


def test_a_similarity_is_found_again():
    shape = np.array([0.0, 1.0, 1.0 + 1.0j, 2.0j])
    c, s = 0.3 - 0.2j, 0.5 * np.exp(1j * math.radians(20.0))
    assert fit_similarity(shape, c + s * shape) == (pytest.approx(c), pytest.approx(s))

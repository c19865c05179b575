"""The card of a design: its words stay apart, and large print is where it is wanted."""

import itertools
import math

import numpy as np
import pytest

from dcdrw.drawings.design_card import LARGE_POINTS, draw_card
from dcdrw_msgs_py.rig import RigParams
from dcdrw_sim.figures.style import POINTS, for_print
from dcdrw_sim.study.design import GRID, Assessment, Scores, Task, Variation, mesh
from dcdrw_sim.study.loads import UNKNOWN
from dcdrw_sim.study.verdict import Verdict

NAN = math.nan
TASK = Task(RigParams().resolved(), 60.0)


def assessment(steps):
    verdict = Verdict.STANDS if math.isnan(steps) else Verdict.IN_STEP
    varied = tuple(
        Variation(name, factor, verdict, steps) for name in ('k', 'b', 'mass', 'slope') for factor in (0.7, 1.3)
    )
    paths = np.linspace(-0.2, 0.0, 5)[:, None] * np.ones(4)
    return Assessment(
        10.0, 20.0, verdict, (steps,) * 9, (steps,) * 9, NAN, paths, (NAN, NAN), NAN, NAN, NAN, UNKNOWN, NAN, varied, {}
    )


def card_of(names, said, large, steps):
    k, b = mesh((0.01, 100.0), (0.3, 3000.0))
    known = np.full(GRID**2, steps)
    grid = Scores(k, b, np.full(GRID**2, 0, np.int8), known, known, known, known)
    with for_print():
        return draw_card(
            'Two wheels', dict.fromkeys(names, said), large, TASK, grid, dict.fromkeys(names, assessment(steps)),
            {'spring': [5.0], 'dashpot': [8.0]},
        )  # fmt: skip


def test_a_unit_stands_in_the_line_of_its_number():
    said = '\n'.join('x' * begin + ' 94 J of heat, 0.4 m/s, 20 N, 5 %' * 8 for begin in range(1, 12))
    card = card_of(['fastest'], said, {'fastest': ''}, 5.0)
    lines = [line.strip() for text in card.texts for line in text.get_text().splitlines()]
    assert len(lines) > 22
    assert not [line for line in lines if line.startswith(('J', 'm/s', 'N', '%'))]


@pytest.mark.parametrize('names', [['fastest', 'most forgiving'], ['fastest', 'most forgiving', 'surest', 'given']])
@pytest.mark.parametrize('steps', [5.0, 300.0, NAN], ids=['quick', 'slow', 'stalls'])
def test_no_text_covers_another(names, steps):
    said = '\n'.join([f'COUPLER {"word " * 15}', *['what: ' + 'so many words of it; ' * 8] * 5, 'and: this'])
    large = dict.fromkeys(names, 'In step only above 1.97°, stalls at 1.67° and below') | {names[-1]: ''}
    card = card_of(names, said, large, steps)
    card.draw_without_rendering()
    written = [text for text in card.texts if text.get_text()]
    boxes = [(text.get_bbox_patch() or text).get_window_extent() for text in written]
    boxes += [axes.get_tightbbox() for axes in card.axes[:3]]
    for i, one in enumerate(boxes):
        assert card.bbox.x0 <= one.x0 <= one.x1 <= card.bbox.x1
        assert card.bbox.y0 <= one.y0 <= one.y1 <= card.bbox.y1
        assert not any(one.overlaps(other) for other in boxes[i + 1 :])
    for axes in card.axes[:3]:
        legend, title = axes.get_legend(), axes._left_title
        assert not legend or not legend.get_window_extent().overlaps(title.get_window_extent())
        ticks = [text.get_window_extent() for text in axes.get_xticklabels() if text.get_text()]
        assert not any(one.overlaps(other) for one, other in itertools.pairwise(ticks))
    sizes = {text.get_fontsize() for text in written}
    assert {POINTS, LARGE_POINTS} <= sizes
    assert min(sizes) >= POINTS

"""The page of a report: HTML that needs nothing but itself."""

import base64
import html
import math
from collections.abc import Mapping, Sequence
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from dcdrw.trials.day import RecordedTrial
from dcdrw.trials.figure import draw_trial
from dcdrw.trials.summary import final_band
from dcdrw_msgs_py.diagnosis import PairState
from dcdrw_sim.figures.style import BAND, BLACK, BLUE, GREEN, ORANGE, PINK, SKY, VERMILION

_COLOURS = BLUE, VERMILION, GREEN, PINK, SKY, ORANGE, BLACK

_STYLE = """
:root { color-scheme: light dark; --line: #d0d4da; --soft: #f3f5f7; --ok: #006b4a; --bad: #a33c00; }
@media (prefers-color-scheme: dark) { :root { --line: #444b55; --soft: #22262c; --ok: #3fcf9f; --bad: #ff9a5c; } }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; }
h2 { margin-top: 3rem; border-bottom: 1px solid var(--line); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .3rem .5rem; border-bottom: 1px solid var(--line); text-align: right; white-space: nowrap; }
th:first-child, td:first-child, .text { text-align: left; }
.ok { color: var(--ok); font-weight: 600; } .bad { color: var(--bad); font-weight: 600; } .none { opacity: .7; }
figure { margin: 1rem 0; background: white; border-radius: .4rem; padding: .4rem; }
figure svg { display: block; width: 100%; height: auto; }
figcaption { color: #333; font-size: .9rem; padding: 0 .6rem .4rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .1rem 1rem; background: var(--soft);
  padding: .6rem 1rem; border-radius: .4rem; }
dt { font-weight: 600; } dd { margin: 0; overflow-wrap: anywhere; }
@media print { h2 { break-before: page; } }
"""

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<h1>{title}</h1>
{overview}
{trials}
</body>
</html>
"""


def page(title: str, trials: Sequence[RecordedTrial], tables: Mapping[str, str]) -> str:
    """The page.

    Args:
        title: its heading.
        trials: what it tells of.
        tables: CSV files to be had from it, by name.

    Raises:
        ValueError: matplotlib is not installed.

    """
    downloads = ' · '.join(
        f'<a download="{name}" href="data:text/csv;base64,{base64.b64encode(text.encode()).decode()}">{name}</a>'
        for name, text in tables.items()
    )
    overview = f'<div class="wide">{_table(trials)}</div>\n<p>{downloads}</p>\n'
    if any(trial.analysis.ran for trial in trials):
        overview += _figure(
            _overlay([trial for trial in trials if trial.analysis.ran]),
            'Phase difference at the strikes of the front wheel, dashed where it was '
            'measured. 50 % of a step is 25 % of a stride.',
        )
    return _PAGE.format(
        title=html.escape(title),
        style=_STYLE,
        overview=overview,
        trials='\n'.join(_section(number, trial) for number, trial in enumerate(trials)),
    )


def _table(trials: Sequence[RecordedTrial]) -> str:
    heads = (
        'trial',
        'source',
        'from',
        'in step after',
        'final band',
        'a step leaves',
        'tends to',
        'k',
        'b',
        'slope',
        'verdict',
    )
    units = ('', '', '% of a step', 'steps', '% of a step', '% of the error', '% of a step', 'N/m', 'N·s/m', '°', '')
    rows = [''.join(f'<th>{head}<br><small>{unit}</small></th>' for head, unit in zip(heads, units, strict=True))]
    for number, trial in enumerate(trials):
        rig, summary = trial.rig, trial.summary
        low, high = final_band(trial.analysis)
        steps = summary.steps_to_synchronization
        cells = (
            f'<a href="#trial{number}">{html.escape(trial.name)}</a>',
            trial.source,
            _number(100 * trial.analysis.status.initial_phase, 1),
            '–' if steps is None else str(steps),
            f'{_number(50 + low, 1)} to {_number(50 + high, 1)}',
            _number(100 * trial.decay.ratio, 1),
            _number(50 + trial.decay.limit, 1),
            *map(_short, (rig.k, rig.b, math.degrees(rig.slope))),
            _verdict(trial),
        )
        rows.append(''.join(f'<td>{cell}</td>' for cell in cells))
    return '<table>' + '\n'.join(f'<tr>{row}</tr>' for row in rows) + '</table>'


_VERDICTS = {
    PairState.NO_DATA: ('not run: no data', 'none'),
    PairState.HELD: ('not run: held', 'none'),
    PairState.STALLED: ('stalled', 'bad'),
    PairState.SLIPPED: ('slipped a step', 'bad'),
    PairState.LOST: ('lost again', 'bad'),
    PairState.SYNCHRONIZED: ('synchronized', 'ok'),
    PairState.CONVERGING: ('not synchronized', 'bad'),
}
"""What each state at the end of a trial means, and the class of the cell that says so."""


def _verdict(trial: RecordedTrial) -> str:
    words, kind = _VERDICTS[trial.summary.state]
    return f'<span class="{kind}">{words}</span>'


def _section(number: int, trial: RecordedTrial) -> str:
    about = ''.join(
        f'<dt>{html.escape(name.replace("_", " "))}</dt><dd>{html.escape(value)}</dd>'
        for name, value in trial.about.items()
    )
    text = f'<h2 id="trial{number}">{html.escape(trial.name)}</h2>\n<p>{html.escape(trial.summary.sentence)}</p>\n'
    text += f'<dl>{about}</dl>\n' if about else ''
    if not trial.analysis.ran:
        return text
    return (
        text
        + _figure(_picture(trial), 'Stance angles, phase difference with its band, footfalls and coupler force.')
        + _figure(_decay(trial), 'Error at each strike of the front wheel, and the geometric decay fitted to it.')
    )


def _figure(svg: str, caption: str) -> str:
    return f'<figure>{svg}<figcaption>{caption}</figcaption></figure>\n'


def _picture(trial: RecordedTrial) -> str:
    with TemporaryDirectory() as folder:
        path = Path(folder) / 'trial.svg'
        draw_trial(trial.analysis, '', path)
        return _inline(path.read_text(encoding='utf-8'))


def _overlay(trials: Sequence[RecordedTrial]) -> str:
    figure, axes = _axes()
    band = max(trial.analysis.params.sync.band_percent for trial in trials)
    axes.axhspan(50 - band, 50 + band, color=BAND, alpha=0.18, linewidth=0, label=f'±{band:g} % of 50 %')
    for number, trial in enumerate(trials):
        phases = 50.0 + np.array(trial.analysis.status.history)
        axes.plot(
            np.arange(1, len(phases) + 1),
            phases,
            linestyle='-' if trial.source == 'simulated' else '--',
            marker='.',
            markersize=5,
            linewidth=1.2,
            color=_COLOURS[number % len(_COLOURS)],
            label=trial.name,
        )
    axes.set(xlabel='steps of the front wheel', ylabel='phase [% of a step]')
    axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    return _svg(figure)


def _decay(trial: RecordedTrial) -> str:
    figure, axes = _axes()
    band, errors = trial.analysis.params.sync.band_percent, np.array(trial.analysis.status.history)
    steps = np.arange(1, len(errors) + 1)
    axes.axhspan(-band, band, color=BAND, alpha=0.18, linewidth=0, label=f'±{band:g} %')
    axes.axhline(0.0, color='0.85', linewidth=0.8, zorder=0)
    axes.plot(steps, errors, 'o', color=_COLOURS[0], markersize=4, label='error')
    if not math.isnan(trial.decay.ratio):
        fine = np.linspace(0.0, max(len(errors) - 1, 1), 400)
        axes.plot(
            fine + 1,
            trial.decay(fine),
            color=_COLOURS[1],
            linewidth=1.2,
            label=f'{trial.decay.limit:+.1f} % {trial.decay.start:+.1f} % · {trial.decay.ratio:.3f}ᵏ',
        )
    axes.set(xlabel='steps of the front wheel', ylabel='error [% of a step]')
    axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    return _svg(figure)


def _axes() -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.6), layout='constrained')
    axes = figure.subplots()
    axes.spines[['top', 'right']].set_visible(False)
    axes.margins(x=0.01)
    axes.locator_params(axis='x', integer=True)
    return figure, axes


def _svg(figure: Any) -> str:
    from matplotlib import rc_context

    file = StringIO()
    with rc_context({'svg.fonttype': 'path'}):
        figure.savefig(file, format='svg')
    return _inline(file.getvalue())


def _inline(svg: str) -> str:
    return svg[svg.index('<svg') :]


def _number(value: float, digits: int) -> str:
    return '–' if math.isnan(value) else f'{value:.{digits}f}'


def _short(value: float) -> str:
    return '–' if math.isnan(value) else f'{value:.4g}'

"""The page of a report: HTML that needs nothing but itself."""

import base64
import html
import math
from collections.abc import Mapping, Sequence
from io import StringIO
from typing import Any

from dcdrw.trials.day import RecordedTrial
from dcdrw.trials.figure import trial_figure
from dcdrw.trials.report_figures import colour, dashes, draw_decay, draw_steps, draw_times
from dcdrw.trials.summary import verdict
from dcdrw_msgs_py.diagnosis import PairState
from dcdrw_msgs_py.samples import SECOND

_STYLE = """
:root { color-scheme: light; --line: #d0d4da; --soft: #f3f5f7; --ok: #006b4a; --bad: #a33c00; --text: #16191d; }
@media screen and (prefers-color-scheme: dark) {
  :root { color-scheme: dark; --line: #444b55; --soft: #22262c; --ok: #3fcf9f; --bad: #ff9a5c; --text: #e9ecef; }
  body { background: #14171b; }
}
body { font: 16px/1.5 system-ui, sans-serif; max-width: 78rem; margin: 2rem auto; padding: 0 1rem; color: var(--text); }
h2 { margin-top: 3rem; border-bottom: 1px solid var(--line); }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .92rem; width: 100%; }
th, td { padding: .3rem .45rem; border-bottom: 1px solid var(--line); text-align: right; vertical-align: top; }
th { font-weight: 600; line-height: 1.25; vertical-align: bottom; } th small { font-weight: 400; }
td { white-space: nowrap; }
th.text, td.text { text-align: left; white-space: normal; }
td.name { min-width: 8em; max-width: 18em; overflow-wrap: break-word; }
td :is(.ok, .bad, .none) { white-space: nowrap; }
.wide { overflow-x: auto; }
.ok { color: var(--ok); font-weight: 600; } .bad { color: var(--bad); font-weight: 600; } .none { opacity: .75; }
.verdict { font-size: 1.15rem; } .remarks { margin-top: .3rem; }
figure { margin: 1rem 0; background: white; border-radius: .4rem; padding: .4rem; break-inside: avoid; }
figure svg { display: block; width: 100%; height: auto; }
figcaption { color: #333; font-size: .9rem; padding: 0 .6rem .4rem; }
fieldset { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; border: 1px solid var(--line); border-radius: .4rem; }
fieldset label { white-space: nowrap; } fieldset i { display: inline-block; width: 1.6rem; height: 0; margin: 0 .3rem;
  vertical-align: middle; border-top: 3px solid; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .1rem 1rem; background: var(--soft);
  padding: .6rem 1rem; border-radius: .4rem; }
dt { font-weight: 600; } dd { margin: 0; overflow-wrap: anywhere; }
@media print {
  @page { margin: 12mm; }
  body { font-size: 10pt; max-width: none; margin: 0; padding: 0; }
  table { font-size: 7pt; } th, td { padding: .15rem .2rem; }
  figure { margin: .4rem 0; padding: 0; } figure svg { width: 96%; max-height: 125mm; margin: auto; }
  figcaption { font-size: 8pt; padding: 0; } dl { font-size: 8pt; padding: .2rem .6rem; break-inside: avoid; }
  h2 { margin-top: 0; }
  .verdict { font-size: 11pt; }
  h2 { break-before: page; } .wide { overflow: visible; } .downloads, fieldset button { display: none; }
  a { color: inherit; text-decoration: none; }
}
"""
_SCRIPT = """
const boxes = [...document.querySelectorAll('#choice input')];
function show() {
  for (const box of boxes) {
    for (const kind of ['steps', 'time']) {
      const curve = document.getElementById(kind + box.value);
      if (curve) curve.style.display = box.checked ? '' : 'none';
    }
  }
}
for (const button of document.querySelectorAll('#choice button')) {
  button.addEventListener('click', () => { for (const box of boxes) box.checked = button.value === 'all'; show(); });
}
document.getElementById('choice')?.addEventListener('change', show);
show();
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
<script>{script}</script>
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
    ran = [(number, trial) for number, trial in enumerate(trials) if trial.analysis.ran]
    return _PAGE.format(
        title=html.escape(title),
        style=_STYLE,
        script=_SCRIPT,
        overview=f'<div class="wide">{_table(trials)}</div>\n<p class="downloads">{downloads}</p>\n'
        + (_overlays(ran) if ran else ''),
        trials='\n'.join(_section(number, trial) for number, trial in enumerate(trials)),
    )


_HEADS = (
    ('trial', ''),
    ('verdict', ''),
    ('from', '% of a step'),
    ('in step after', 'steps'),
    ('final band', '% of a step'),
    ('a step leaves', '% of the error'),
    ('tends to', '% of a step'),
    ('k', 'N/m'),
    ('b', 'N·s/m'),
    ('slope', '°'),
    ('samples missing', ''),
    ('refused', ''),
    ('began anew', 'times'),
    ('source', ''),
)
_CLASSES = {0: ' class="text name"', 1: ' class="text"'}
"""Classes of the columns that hold text."""
_UNKNOWN = '–'
"""A column that holds nothing else is left out."""


def _table(trials: Sequence[RecordedTrial]) -> str:
    rows = []
    for number, trial in enumerate(trials):
        rig, summary, samples = trial.rig, trial.summary, trial.summary.samples
        low, high = trial.analysis.status.final_band_percent
        ran = trial.analysis.ran
        cells = (
            f'<a href="#trial{number}">{html.escape(trial.name)}</a>',
            _verdict(trial),
            _number(100 * trial.analysis.status.initial_phase, 1) if ran else _UNKNOWN,
            trial.analysis.status.steps_text if summary.synchronized else _UNKNOWN,
            f'{_number(50 + low, 1)} to {_number(50 + high, 1)}' if ran else _UNKNOWN,
            _number(100 * trial.analysis.status.contraction, 1),
            _number(50 + trial.decay.limit, 1),
            *map(_short, (rig.k, rig.b, math.degrees(rig.slope))),
            str(samples.lost),
            str(sum(samples.refused.values())),
            str(trial.analysis.status.restarts),
            trial.source,
        )
        rows.append(cells)
    known = [column for column in range(len(_HEADS)) if any(row[column] != _UNKNOWN for row in rows)]
    heads = ''.join(
        f'<th{_CLASSES.get(column, "")}>{head}<br><small>{unit}</small></th>'
        for column, (head, unit) in enumerate(_HEADS)
        if column in known
    )
    lines = (''.join(f'<td{_CLASSES.get(column, "")}>{row[column]}</td>' for column in known) for row in rows)
    return f'<table><tr>{heads}</tr>\n' + '\n'.join(f'<tr>{line}</tr>' for line in lines) + '</table>'


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
_TOO_LITTLE = 'too little to judge', 'none'


def _words(trial: RecordedTrial) -> tuple[str, str]:
    return _TOO_LITTLE if trial.analysis.why_not_judged else _VERDICTS[trial.summary.state]


def _verdict(trial: RecordedTrial) -> str:
    words, kind = _words(trial)
    less = '' if trial.summary.complete or trial.summary.reason else ', of a part'
    return f'<span class="{kind}">{words}</span>{less}'


def _sentence(trial: RecordedTrial) -> str:
    """The verdict in large print, its first words as in the table."""
    words, kind = _words(trial)
    sentence = verdict(trial.analysis)
    if sentence.lower().startswith(words):
        return f'<span class="{kind}">{sentence[: len(words)]}</span>{html.escape(sentence[len(words) :])}'
    return f'{_verdict(trial)}. {html.escape(sentence)}'


def _overlays(trials: Sequence[tuple[int, RecordedTrial]]) -> str:
    """All trials in one picture each of steps and of time, and the choice of those to be seen."""
    choice = ''.join(
        f'<label><input type="checkbox" checked value="{number}">'
        f'<i style="color:{colour(number)};border-top-style:{_BORDERS[dashes(trial)]}"></i>{html.escape(trial.name)}'
        '</label>'
        for number, trial in trials
    )
    return (
        f'<fieldset id="choice"><legend>shown</legend>{choice}'
        '<button type="button" value="all">all</button><button type="button" value="none">none</button></fieldset>\n'
        + _figure(
            _svg(draw_steps(trials)),
            'Phase difference at the strikes of the front wheel, dashed where it was measured. 50 % of a step is '
            '25 % of a stride.',
        )
        + _figure(_svg(draw_times(trials)), 'Phase difference against time, from where the wheels were let go.')
    )


_BORDERS = {'-': 'solid', '--': 'dashed'}


def _section(number: int, trial: RecordedTrial) -> str:
    said = (*(remark.text for remark in trial.summary.remarks), *trial.analysis.damage, *_gaps(trial))
    about = ''.join(
        f'<dt>{html.escape(name.replace("_", " "))}</dt><dd>{html.escape(value)}</dd>'
        for name, value in trial.about.items()
    )
    text = f'<h2 id="trial{number}">{html.escape(trial.name)}</h2>\n'
    text += f'<p class="verdict">{_sentence(trial)}</p>\n'
    if said:
        text += f'<ul class="remarks">{"".join(f"<li>{html.escape(one)}</li>" for one in said)}</ul>\n'
    if trial.analysis.ran:
        text += _figure(_svg(trial_figure(trial.analysis, '')), _CAPTION)
        if trial.analysis.status.history:
            text += _figure(_svg(draw_decay(trial)), 'Error at each strike of the front wheel, and the decay of it.')
    return text + (f'<dl>{about}</dl>\n' if about else '')


_CAPTION = 'Stance angles, phase difference with its band, footfalls and, where it is known, the coupler force.'


def _gaps(trial: RecordedTrial) -> list[str]:
    """A line that lists the gaps."""
    analysis = trial.analysis
    if not analysis.longest_gaps:
        return []
    listed = ', '.join(
        f'{gap.seconds:.2g} s at {(gap.begin_ns - analysis.start_ns) / SECOND:.1f} s' for gap in analysis.longest_gaps
    )
    others = analysis.gaps - len(analysis.longest_gaps)
    more = f', and {others} shorter ones' if others else ''
    return [f'Gaps, the longest first: {listed}{more}.']


def _figure(svg: str, caption: str) -> str:
    return f'<figure>{svg}<figcaption>{caption}</figcaption></figure>\n'


def _svg(figure: Any) -> str:
    from matplotlib import rc_context

    file = StringIO()
    with rc_context({'svg.fonttype': 'path', 'svg.hashsalt': 'dcdrw'}):
        figure.savefig(file, format='svg')
    return _inline(file.getvalue())


def _inline(svg: str) -> str:
    return svg[svg.index('<svg') :]


def _number(value: float, digits: int) -> str:
    return _UNKNOWN if math.isnan(value) else f'{value:.{digits}f}'


def _short(value: float) -> str:
    return _UNKNOWN if math.isnan(value) else f'{value:.4g}'

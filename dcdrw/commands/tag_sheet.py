"""`dcdrw tags`: the rig's tags as a PDF to print, true to scale, with marks and instructions for mounting."""

import argparse
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dcdrw.console import need
from dcdrw.files import add_force, refuse_existing, write_whole
from dcdrw.suite.parameter_file import read_parameter_file
from dcdrw_msgs_py.opencv import tag_cells
from dcdrw_msgs_py.quantity import check
from dcdrw_msgs_py.tagging import Mount, TagParams, mounts
from dcdrw_msgs_py.words import counted

PAPERS = {'a4': (210.0, 297.0), 'letter': (215.9, 279.4), 'a3': (297.0, 420.0), 'tabloid': (279.4, 431.8)}
"""Width and height [mm]."""
_MM = 1.0 / 25.4
"""An inch's part."""
_EDGE, _GAP, _TAB, _FOOT = 5.0, 4.0, 11.0, 50.0
"""What printers leave white, between two tags, a tag's label, and the instructions [mm]."""
_WHITE_CELLS = 1
"""White around the black square that every detector needs, in cells of the tag."""
_GREY = '0.45'


class SheetParams(NamedTuple):
    """What a sheet is made of."""

    tags: TagParams = TagParams()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = (
        'Write the AprilTags of a rig to a PDF: true to scale, with a ruler to check it, cut lines and '
        'instructions for mounting.'
    )
    parser.add_argument('--out', type=Path, required=True, metavar='FILE.pdf', help='the sheet')
    add_force(parser)
    parser.add_argument(
        '--rig',
        type=Path,
        metavar='FILE.yaml',
        help='the rig: family, size, and front.ids, rear.ids and so on (default: a tag of '
        f'{1000 * TagParams().size:g} mm on each hub)',
    )
    parser.add_argument('--paper', choices=PAPERS, default='a4', help='(default: %(default)s)')


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    if options.out.suffix != '.pdf':
        raise ValueError(f'--out must end in .pdf, got {options.out}')
    refuse_existing([options.out], options.force)
    params = read_parameter_file(options.rig, SheetParams()) if options.rig else SheetParams()
    pages = draw_pages(params.tags, options.paper)
    from matplotlib import rc_context
    from matplotlib.backends.backend_pdf import PdfPages

    title = {'Title': 'AprilTags of a dcdrw rig'}
    with (
        rc_context({'pdf.fonttype': 42}),
        write_whole(options.out, options.force) as unfinished,
        PdfPages(unfinished, metadata=title) as pdf,
    ):
        for page in pages:
            pdf.savefig(page)
    print(
        f'Written: {options.out}, {counted(len(pages), "page")} of {options.paper}. Print at 100 %: the '
        'ruler must be 100 mm long.'
    )
    return 0


def draw_pages(tags: TagParams, paper: str) -> list[Any]:
    """The sheet's pages as matplotlib figures of the paper's size.

    Args:
        tags: the tags.
        paper: a name of `PAPERS`.

    Raises:
        ValueError: matplotlib or OpenCV is missing, or a tag is impossible or larger than the paper.

    """
    need('a tag sheet', 'matplotlib')
    from matplotlib.figure import Figure

    width, height = PAPERS[paper]
    all_mounts = mounts(check(tags))
    boards = [_board(mount, tags.family) for mount in all_mounts]
    places = list(_places(width, height, max(boards, default=1.0)))
    if not places:
        fits = min(width - 2 * _EDGE, height - 2 * _EDGE - _FOOT - _TAB)
        side = 1000.0 * tags.size
        raise ValueError(
            f'a tag of {side:g} mm is {boards[0]:g} mm wide with its white border; {paper} takes tags of '
            f'up to {math.floor(fits * side / boards[0])} mm: choose a larger --paper '
            f'({", ".join(PAPERS)}), or a smaller size in the rig file'
        )
    pages = []
    for first in range(0, len(all_mounts), len(places)):
        page = Figure(figsize=(width * _MM, height * _MM))
        axes = page.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(0.0, width), ylim=(0.0, height))
        axes.set_axis_off()
        chosen = all_mounts[first : first + len(places)]
        for mount, place in zip(chosen, places, strict=False):
            _draw_tag(axes, mount, tags.family, *place)
        _draw_foot(axes, width, tags, chosen)
        pages.append(page)
    return pages


def _board(mount: Mount, family: str) -> float:
    """Side of the white square [mm]."""
    return 1000.0 * mount.size * (1.0 + 2.0 * _WHITE_CELLS / len(tag_cells(family, mount.id)))


def _places(width: float, height: float, board: float) -> Iterator[tuple[float, float]]:
    """Lower left corners of the tags on a page, from the top left on [mm]."""
    room = height - 2 * _EDGE - _FOOT
    columns = int((width - 2 * _EDGE + _GAP + 1e-9) / (board + _GAP))
    rows = int((room + _GAP + 1e-9) / (board + _TAB + _GAP))
    left = 0.5 * (width - columns * (board + _GAP) + _GAP)
    for row in range(rows):
        for column in range(columns):
            yield (left + column * (board + _GAP), height - _EDGE - (row + 1) * (board + _TAB) - row * _GAP)


def _draw_tag(axes: Any, mount: Mount, family: str, left: float, low: float) -> None:
    """A tag with its cut line; the tab above it tells which it is, and which way it goes."""
    from matplotlib.patches import PathPatch, Rectangle
    from matplotlib.path import Path as Outline

    cells, board = tag_cells(family, mount.id), _board(mount, family)
    cell = 1000.0 * mount.size / len(cells)
    white = _WHITE_CELLS * cell
    # One path for all black cells: between shapes of their own, viewers show hairlines.
    rows, columns = np.nonzero(~cells)
    x, y = left + white + columns * cell, low + board - white - (rows + 1) * cell
    squares = np.stack(
        [np.stack((x + dx * cell, y + dy * cell), axis=-1) for dx, dy in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))],
        axis=1,
    )
    codes = np.tile((Outline.MOVETO, Outline.LINETO, Outline.LINETO, Outline.LINETO, Outline.CLOSEPOLY), len(x))
    axes.add_patch(PathPatch(Outline(squares.reshape(-1, 2), codes), facecolor='black', linewidth=0))
    axes.add_patch(
        Rectangle((left, low), board, board + _TAB, fill=False, edgecolor=_GREY, linewidth=0.4, linestyle=(0, (6, 4)))
    )
    tick, middle = min(3.0, 0.3 * white), 0.5 * board
    for x0, x1, y0, y1 in (
        (0.0, tick, middle, middle),
        (board, board - tick, middle, middle),
        (middle, middle, 0.0, tick),
        (middle, middle, board, board - tick),
    ):
        axes.plot((left + x0, left + x1), (low + y0, low + y1), color=_GREY, linewidth=0.4)
    # Where the slope's normal at ψ = 0 points, seen from the upright tag: the upright is turned from it by the angle.
    at, length = (left + 7.0, low + board + 0.5 * _TAB), 0.38 * _TAB
    dx, dy = length * math.sin(mount.angle), length * math.cos(mount.angle)
    axes.annotate(
        '',
        (at[0] + dx, at[1] + dy),
        (at[0] - dx, at[1] - dy),
        arrowprops={'arrowstyle': '-|>', 'color': 'black', 'linewidth': 1.2, 'shrinkA': 0, 'shrinkB': 0},
    )
    on_hub = not (mount.x or mount.y)
    place = 'on the hub' if on_hub else f'x {1000 * mount.x:g} mm, y {1000 * mount.y:g} mm from the hub'
    size = min(9.0, 9.0 * board / 90.0)
    axes.text(left + 14.0, at[1], f'{mount.wheel} wheel   id {mount.id}', fontsize=size, weight='bold', va='center')
    axes.text(
        left + board - 3.0,
        at[1],
        f'{family}   {1000 * mount.size:g} mm   {place}',
        fontsize=0.75 * size,
        va='center',
        ha='right',
    )


def _draw_foot(axes: Any, width: float, tags: TagParams, shown: Sequence[Mount]) -> None:
    """Ruler and instructions."""
    left, ruler = 0.5 * (width - 100.0), _EDGE + 40.0
    axes.plot((left, left + 100.0), (ruler, ruler), color='black', linewidth=0.5, solid_capstyle='butt')
    for mm in range(0, 101, 5):
        axes.plot(
            (left + mm, left + mm),
            (ruler, ruler + (3.5 if mm % 50 == 0 else 2.0 if mm % 10 == 0 else 1.2)),
            color='black',
            linewidth=0.4,
            solid_capstyle='butt',
        )
    for mm in (0, 50, 100):
        axes.text(left + mm, ruler + 4.2, f'{mm}{" mm" * (mm == 100)}', fontsize=7, ha='center')
    off_hub = any(mount.x or mount.y for mount in shown)
    elsewhere = ', or as far from it as its label says: x downhill, y away from the slope' if off_hub else ''
    lines = (
        '1. Print at 100 % ("actual size", no scaling) on matt paper. The ruler must be 100 mm long; if it is not,',
        '    measure a black square and put its side into the rig file (size).',
        '2. Glue each tag to a stiff flat board and cut along the dashed lines: a tag needs all of its white border.',
        "3. Mount each on its own wheel, on the side towards the camera: the rig's left, with downhill to the left.",
        f"    The tag's middle, where lines between the ticks cross, goes on the hub's axis{elsewhere}.",
        '4. Turn it so that the arrow points straight away from the slope while a spoke stands square on the slope.',
        '    A degree askew is a degree of error: measure it and put it into the rig file (front.angles_deg,',
        '    rear.angles_deg), or let "dcdrw calibrate" find it.',
        f'Rig file: family {tags.family}, size {tags.size:g} (the side of the black square, in m).',
    )
    for i, line in enumerate(lines):
        axes.text(0.5 * width - 82.0, ruler - 5.0 - 4.0 * i, line, fontsize=7.3, va='center')

"""Figures as files, in the formats that are asked for."""

import argparse
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from dcdrw.files import write_whole
from dcdrw_sim.figures.style import FORMATS, save


def add_formats(parser: argparse.ArgumentParser, *default: str) -> None:
    """Add the option that chooses the formats of figures, by default png."""
    default = default or ('png',)
    parser.add_argument(
        '--format',
        dest='formats',
        type=formats,
        default=default,
        metavar='png,pdf,svg',
        help=f'of figures; several, separated by commas (default: {",".join(default)})',
    )


def formats(text: str) -> tuple[str, ...]:
    """Parse a list of formats."""
    chosen = tuple(dict.fromkeys(text.split(',')))
    for name in chosen:
        if name not in FORMATS:
            raise argparse.ArgumentTypeError(f'must be among {", ".join(FORMATS)}, got {name!r}')
    return chosen


def figure_files(folder: Path, names: Iterable[str], formats: Sequence[str]) -> list[Path]:
    """The files of figures with these names."""
    return [folder / f'{name}.{end}' for name in names for end in formats]


def write_figure(figure: Any, folder: Path, name: str, formats: Sequence[str], force: bool = False) -> list[Path]:
    """Write a matplotlib figure in each format; returns the files.

    Raises:
        ValueError, OSError: as `dcdrw.files.write_whole`.

    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = figure_files(folder, [name], formats)
    for path in paths:
        with write_whole(path, force) as unfinished:
            save(figure, unfinished)
    return paths

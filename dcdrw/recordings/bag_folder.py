"""Which files a recording consists of, and what its metadata tell of them."""

import re
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from dcdrw.console import in_words
from dcdrw.recordings.recorder import INFORMATION, METADATA
from dcdrw_msgs_py.yaml_file import read_yaml

RECORDING = 'recording'
"""The folder of the recording within that of a trial."""
STORAGES = ('.mcap', '.db3')
COMPRESSIONS = ('.zstd', '.zst')
"""Endings of files that are compressed as a whole."""
_ROS1 = '.bag'
_PART = re.compile(r'(.*)_(\d+)')


class Bag(NamedTuple):
    """The files of a recording."""

    path: Path
    """Its folder, or its lone file."""
    files: list[Path]
    notes: list[str]
    """What in its folder is not as it should be."""
    about: dict[str, str]
    """rosbag2's custom_data."""
    messages: int
    """How many the metadata tell of."""
    lost: list[str]
    """What was recorded and is not there."""


def find_bag(path: Path) -> Bag:
    """The recording that a path means: its folder, that of a trial, or one of its files.

    Raises:
        ValueError: there is none.
        OSError: the folder cannot be read.

    """
    if not path.exists():
        raise ValueError(f'{path} does not exist')
    if not path.is_dir():
        if not (path.is_file() and is_storage(path)):  # a pipe would keep its reader waiting
            raise _no_recording(
                path,
                f'give its folder, or a file that ends in {", ".join(STORAGES)}, or one of these and {COMPRESSIONS[0]}',
            )
        return Bag(path, [path], [], {}, 0, [])
    for folder in (path, path / RECORDING):
        files = sorted((file for file in folder.glob('*') if file.is_file() and is_storage(file)), key=_number)
        if files:
            return _described(folder, files)
    if (path / METADATA).exists():
        raise ValueError(f'{path} has {METADATA} but none of the files that this tells of')
    raise _no_recording(path, f'it has no {", ".join(f"*{end}" for end in STORAGES)} file')


def _no_recording(path: Path, why: str) -> ValueError:
    """What to say of a path that means none."""
    old = [path] if path.suffix == _ROS1 else sorted(path.glob(f'*{_ROS1}'))
    if old:
        return ValueError(
            f'{old[0]} is a recording of ROS 1: `rosbags-convert --src {old[0]} --dst NEW` makes one of ROS 2 of it'
        )
    return ValueError(f'{path} is not a recording: {why}')


def is_storage(path: Path) -> bool:
    """Whether a name is that of a recording's file."""
    return _plain(path).suffix in STORAGES


def _described(folder: Path, files: list[Path]) -> Bag:
    """The files of a folder, as its metadata tell, where they can be read and tell of what is there."""
    told, notes = _metadata(folder / METADATA)
    paths = told.get('relative_file_paths')
    names = list(map(str, paths)) if isinstance(paths, list) else []
    files = _without_doubles(files, {Path(name).name for name in names})
    named = [file for name in names if (file := _named(name, files))]
    named = list(dict.fromkeys(named))  # one that is named twice has its messages once
    missing = list(dict.fromkeys(name for name in names if not _named(name, files)))
    lost: list[str] = []
    if missing:
        others = [file for file in files if file not in named]
        (notes if len(others) >= len(missing) else lost).append(
            f'{METADATA} of {folder} names {_list(missing)}, which is not there'
            + (f'; {_list(file.name for file in others)} is read in its place' if others else '')
        )
        named = files
    elif not named:
        if len({match[1] if (match := _PART.fullmatch(_stem(file))) else _stem(file) for file in files}) > 1:
            raise ValueError(
                f'{folder} has several recordings and no {METADATA}: give one of {_list(file.name for file in files)}'
            )
        named = files
    about = told.get('custom_data')
    count = told.get('message_count')
    return Bag(
        folder,
        named,
        notes,
        {str(name): str(value) for name, value in about.items()} if isinstance(about, dict) else {},
        count if isinstance(count, int) else 0,
        lost,
    )


def _metadata(path: Path) -> tuple[dict[str, Any], list[str]]:
    """What metadata.yaml says, and what is wrong with it."""
    if not path.exists():
        return {}, [f'{path.parent} has no {METADATA}, so whether files are missing is not known']
    try:
        content = read_yaml(path)
    except (ValueError, OSError) as error:
        return {}, [f'{in_words(error)}; the recording is read without it']
    told = content.get(INFORMATION) if isinstance(content, dict) else None
    return (
        (told, []) if isinstance(told, dict) else ({}, [f'{path} is none of rosbag2; the recording is read without it'])
    )


def _without_doubles(files: list[Path], names: Collection[str]) -> list[Path]:
    """Each file once, though it be there compressed and not: the one that the metadata name, else the compressed one.

    The other is what rosbag2's player decompressed, or a part of it; or what its recorder, killed, was compressing.
    """
    chosen: dict[Path, Path] = {}
    for file in sorted(files, key=lambda file: (file.name in names, file.suffix in COMPRESSIONS, file.name)):
        chosen[_plain(file)] = file
    return [file for file in files if file in chosen.values()]


def _named(name: str, files: list[Path]) -> Path | None:
    """The file of this name, compressed or not; rosbag2 once wrote the folder before it."""
    wanted = Path(name).name
    same = (wanted, *(wanted + end for end in COMPRESSIONS), *(wanted.removesuffix(end) for end in COMPRESSIONS))
    return next((file for name in same for file in files if file.name == name), None)


def _plain(file: Path) -> Path:
    """A file's name without that of its compression."""
    return file.with_suffix('') if file.suffix in COMPRESSIONS else file


def _stem(file: Path) -> str:
    return _plain(file).stem


def _number(file: Path) -> tuple[str, int]:
    match = _PART.fullmatch(_stem(file))
    return (match[1], int(match[2])) if match and len(match[2]) < 20 else (_stem(file), -1)


def _list(names: Iterable[str]) -> str:
    return ', '.join(names)

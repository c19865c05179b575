"""What a kept result depends on: the source that computes it."""

import hashlib
from importlib.util import find_spec
from pathlib import Path


def fingerprint(*packages: str) -> str:
    """A hash of every Python file of some packages, subpackages included, that changes with any of them."""
    content = hashlib.sha256()
    for package in packages:
        for folder in map(Path, _folders(package)):
            for path in sorted(folder.rglob('*.py')):
                content.update(f'{path.relative_to(folder)}\0'.encode())
                content.update(path.read_bytes())
    return content.hexdigest()[:16]


def _folders(package: str) -> list[str]:
    spec = find_spec(package)
    if spec is None or spec.submodule_search_locations is None:
        raise ValueError(f'{package} is not a package')
    return list(spec.submodule_search_locations)

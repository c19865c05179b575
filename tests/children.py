"""The nodes that a process has started, found by Linux's /proc."""

from pathlib import Path


def nodes(parent: int, name: str = '') -> list[int]:
    """The children of a process that run nodes, or the node of a name."""
    tasks = Path(f'/proc/{parent}/task').glob('*/children')
    children = [int(child) for task in tasks for child in task.read_text().split()]
    return [child for child in children if _node(child) and name in ('', _node(child))]


def runs(process: int) -> bool:
    """Whether a process still runs: one that waits to be collected does not."""
    try:
        return Path(f'/proc/{process}/stat').read_text().rpartition(')')[2].split()[0] != 'Z'
    except (FileNotFoundError, ProcessLookupError):
        return False


def _node(process: int) -> str:
    command = Path(f'/proc/{process}/cmdline').read_text().split('\0')
    return command[3] if command[1:3] == ['-m', 'dcdrw.entry'] else ''

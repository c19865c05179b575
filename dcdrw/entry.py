"""The entry point of every executable: signals are answered before anything that takes time is imported.

A function for each name of `EXECUTABLES`; `python -m dcdrw.entry NAME` calls it, too.
"""

import os
import signal
import sys
from collections.abc import Callable
from importlib import import_module

EXECUTABLES = {
    'dcdrw': 'dcdrw.cli',
    'simulator': 'dcdrw_sim.rig.simulator_node',
    'phase_estimator': 'dcdrw_tracker.gait.phase_estimator_node',
    'sync_monitor': 'dcdrw_tracker.gait.sync_monitor_node',
    'tag_tracker': 'dcdrw_tracker.node.tag_tracker_node',
    'leg_tracker': 'dcdrw_control.legs.leg_tracker_node',
    'virtual_camera': 'dcdrw_sim.camera.virtual_camera_node',
    'synchronizer': 'dcdrw_control.sync.synchronizer_node',
    'xrl_reference': 'dcdrw_control.reference.xrl_reference_node',
    'rig_markers': 'dcdrw.nodes.rig_markers_node',
    'recorder': 'dcdrw.nodes.recorder_node',
    'suite': 'dcdrw.nodes.suite',
}
"""The command and the nodes, each with the module whose `main` it runs."""


def run(name: str) -> int:
    """Run an executable; returns its exit status."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)
    keep_to_one_core()
    status: int
    if name != 'dcdrw' and {'-h', '--help'} & set(sys.argv[1:]):
        status = import_module('dcdrw.suite.node_help').show(name)
    else:
        status = import_module(EXECUTABLES[name]).main()
    if status > 128:  # ended by a signal: a compiler that was broken off can crash when the interpreter is taken down
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    return status


def keep_to_one_core() -> None:
    """Let numpy, which is imported later, do linear algebra in one thread, unless the environment says otherwise.

    The matrices are small: several threads wait for each other, on a busy machine for ten times as long as one takes.
    """
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')


def _end(number: int, _: object) -> None:
    """End at once: nothing was begun yet, or all is done, and an exception within an import would be told at length."""
    os._exit(128 + number)


def __getattr__(name: str) -> Callable[[], int]:
    if name not in EXECUTABLES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return lambda: run(name)


if __name__ == '__main__':
    sys.exit(run(sys.argv.pop(1)))

"""The command `dcdrw`."""

import argparse
import sys
from importlib.metadata import PackageNotFoundError, version

from dcdrw import map as return_map
from dcdrw import simulate, trial

_DESCRIPTION = 'Two rimless wheels on a slope, joined by a spring and a damper: simulate them, run and judge trials.'
_EPILOG = """\
examples:
  dcdrw trial                             the paper's trial, half a minute, with summary and picture
  dcdrw trial --rig my_rig.yaml --initial-phase 35 --seconds 20
  dcdrw map --rig my_rig.yaml             how fast the pair falls into step: multipliers of the return map
  dcdrw simulate case.json --strikes strikes.json --trajectory motion.csv --rate 200

nodes (each also by `ros2 run dcdrw NAME`): simulator, phase_estimator, sync_monitor
"""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status: 0 well, 1 the work failed, 2 the input was wrong."""
    parser = argparse.ArgumentParser('dcdrw', description=_DESCRIPTION, epilog=_EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--version', action='version', version=f'dcdrw {_version()}')
    commands = parser.add_subparsers(title='commands', metavar='COMMAND', required=True)
    for module in (trial, simulate, return_map):
        module.add_command(commands)
    options = parser.parse_args(arguments)
    try:
        return int(options.run(options))
    except KeyboardInterrupt:
        print(f'{options.prog}: interrupted', file=sys.stderr)
        return 130
    except (ValueError, OSError) as error:
        print(f'{options.prog}: {error}', file=sys.stderr)
        return 2


def _version() -> str:
    try:
        return version('dcdrw')
    except PackageNotFoundError:
        return '(not installed)'


if __name__ == '__main__':
    sys.exit(main())

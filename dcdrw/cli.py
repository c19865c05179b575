"""The command `dcdrw`."""

import argparse
import sys
from importlib.metadata import PackageNotFoundError, version

from dcdrw.commands import (
    analyze,
    calibrate,
    design,
    figures,
    film,
    live,
    models,
    record,
    regimes,
    replay,
    report,
    return_map,
    simulate,
    sweep,
    tag_sheet,
    track,
    trial,
    urdf,
)
from dcdrw.suite.executables import EXECUTABLES

_DESCRIPTION = 'Two rimless wheels on a slope, joined by a spring and a damper: simulate them, run and judge trials.'
_EPILOG = """\
examples:
  dcdrw trial                             the paper's trial, half a minute, with summary and picture
  dcdrw trial --rig my_rig.yaml --initial-phase 35 --seconds 20
  dcdrw live --trial                      watch a simulated trial in the browser
  dcdrw record --note 'new springs'       record the nodes that run on this machine or network
  dcdrw analyze trials/first trials/second
  dcdrw report trials/* --out today.html  a day of trials on one page
  dcdrw design --slope-deg 2.5            which spring and dashpot to buy
  dcdrw map --rig my_rig.yaml             how fast the pair falls into step: multipliers of the return map
  dcdrw sweep --out paper.nc              which couplers synchronize, and how fast: the paper's 50 × 50
  dcdrw regimes --rig my_rig.yaml         whether it walks in step at all, and how far it is from stalling
  dcdrw figures --out figures             the paper's simulated figures, and what explains them
  dcdrw urdf --rig my_rig.yaml            the rig as a URDF, for robot_state_publisher and RViz
  dcdrw models --out models               the single wheel and the rigid pair, to compare with
  dcdrw tags --out tags.pdf               the tags of the wheels, to print
  dcdrw film --out trial.mp4 --pan-deg 30 a simulated trial as a camera sees it, with its ground truth
  dcdrw calibrate roll.mp4 --camera camera.yaml --rig my_rig.yaml --out calibrated.yaml
  dcdrw track trial.mp4 --camera camera.yaml --rig calibrated.yaml --out trials/first
  dcdrw simulate case.json --strikes strikes.json --trajectory motion.csv --rate 200

nodes, each run by `ros2 run dcdrw NAME`:
  """ + ', '.join(node.name for node in EXECUTABLES)
_COMMANDS = (
    trial,
    live,
    record,
    replay,
    analyze,
    report,
    film,
    tag_sheet,
    track,
    calibrate,
    design,
    sweep,
    figures,
    regimes,
    return_map,
    models,
    simulate,
    urdf,
)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status: 0 well, 1 the work failed, 2 the input was wrong."""
    parser = argparse.ArgumentParser(
        'dcdrw', description=_DESCRIPTION, epilog=_EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--version', action='version', version=f'dcdrw {_version()}')
    commands = parser.add_subparsers(title='commands', metavar='COMMAND', required=True)
    for module in _COMMANDS:
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

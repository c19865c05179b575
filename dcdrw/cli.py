"""The command `dcdrw`: which commands there are. The module of one is imported when it is chosen."""

import sys

from dcdrw.commands import Command
from dcdrw.entry import EXECUTABLES

COMMANDS = {
    'trial': Command('trial', 'run a trial in simulation, live, and judge it'),
    'live': Command('live', 'watch a running suite in the browser'),
    'record': Command('record', 'record a running suite'),
    'replay': Command('replay', 'publish recorded joint states again'),
    'mend': Command('mend', 'a damaged recording into a new one'),
    'analyze': Command('analyze', 'judge recorded trials'),
    'legs': Command('legs', "follow people's legs by their sensors"),
    'report': Command('report', 'recorded trials on one page'),
    'film': Command('film', 'film a simulated trial, with its ground truth'),
    'tags': Command('tag_sheet', 'print the tags of the wheels, true to scale'),
    'track': Command('track', 'track the wheels in a video, and judge the trial'),
    'calibrate': Command('calibrate', 'learn downhill, lengths and zeros from a video of one roll'),
    'identify': Command('identify', 'what recorded trials tell of the rig, with errors'),
    'design': Command('design', 'choose spring and dashpot for a rig'),
    'sweep': Command('sweep', 'which couplers synchronize, and how fast'),
    'figures': Command('figures', "the paper's simulated figures, and what explains them"),
    'regimes': Command('regimes', 'whether a pair walks in step, and how far it is from stalling'),
    'map': Command('return_map', 'multipliers and regressions of the return map'),
    'control': Command('control', 'gains of the active synchronizer, and where its loop is unstable'),
    'models': Command('models', 'the single wheel and the rigidly coupled pair, to compare with'),
    'simulate': Command('simulate', 'integrate cases from a JSON file'),
    'urdf': Command('urdf', 'the rig as a URDF, for RViz and Foxglove'),
}

_DESCRIPTION = 'Two rimless wheels on a slope, joined by a spring and a damper: simulate them, run and judge trials.'
_EPILOG = (
    """\
examples:
  dcdrw trial                             the paper's trial, half a minute, with summary and picture
  dcdrw trial --rig my_rig.yaml --initial-phase 35 --seconds 20
  dcdrw live --trial                      watch a simulated trial in the browser
  dcdrw record --note 'new springs'       record the nodes that run on this machine or network
  dcdrw analyze trials/first trials/second
  dcdrw mend trials/killed --out mended   what can be read of a damaged recording, for other tools
  dcdrw legs walk.csv --rate 204.8        people's heel strikes and phase, from sensors on their legs
  dcdrw report trials/* --out today.html  a day of trials on one page
  dcdrw identify trials/* --rig my_rig.yaml --out identified   the rig's parameters, with errors
  dcdrw design --slope-deg 2.5            which spring and dashpot to buy
  dcdrw map --rig my_rig.yaml             how fast the pair falls into step: multipliers of the return map
  dcdrw control --rig my_rig.yaml --out gains.yaml   gains of the active synchronizer
  dcdrw sweep --out paper.nc              which couplers synchronize, and how fast: the paper's 50 × 50
  dcdrw regimes --rig my_rig.yaml         whether it walks in step at all, and how far it is from stalling
  dcdrw figures --out figures             the paper's simulated figures, and what explains them
  dcdrw urdf --rig my_rig.yaml            the rig as a URDF, for robot_state_publisher and RViz
  dcdrw models --out models               the single wheel and the rigid pair, to compare with
  dcdrw tags --out tags.pdf               the tags of the wheels, to print
  dcdrw film --out trial.mp4 --pan-deg 30  a simulated trial as a camera sees it, with its ground truth
  dcdrw calibrate roll.mp4 --camera camera.yaml --rig my_rig.yaml --out calibrated.yaml
  dcdrw track trial.mp4 --camera camera.yaml --rig calibrated.yaml --out trials/first
  dcdrw simulate case.json --strikes strikes.json --trajectory motion.csv --rate 200

completion, with argcomplete installed:
  eval "$(register-python-argcomplete dcdrw)"                bash; in zsh after autoload -U compinit && compinit
  register-python-argcomplete --shell fish dcdrw | source    fish

nodes, each run by `ros2 run dcdrw NAME`:
"""
    + f'  {", ".join(name for name in EXECUTABLES if name != "dcdrw")}\n'
)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status: 0 well, 1 the work failed, 2 the input was wrong."""
    from dcdrw.command_line import CommandLine  # imported here: signals are answered by now

    return CommandLine(COMMANDS, _DESCRIPTION, _EPILOG).run(sys.argv[1:] if arguments is None else arguments)


if __name__ == '__main__':
    from dcdrw.entry import run

    sys.exit(run('dcdrw'))

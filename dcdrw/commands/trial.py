"""`dcdrw trial`: simulator, phase estimator, monitor and recorder as processes, watched live, judged by the record.

With `--camera`, virtual camera and tag tracker stand between the simulator and the others, which do not know.
"""

import argparse
import math
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from dcdrw.console import (
    STDOUT,
    LiveLine,
    add_json,
    check_json,
    domain,
    in_words,
    interrupted_status,
    need,
    phase_percent,
    positive,
    tell,
    tell_where,
)
from dcdrw.drawings.figure_files import add_formats
from dcdrw.files import free_folder
from dcdrw.recordings.recorder import require_libraries
from dcdrw.suite.hub_gains import hub_gains
from dcdrw.suite.parameter_file import TrialParams, add_rig_options, chosen_params
from dcdrw.suite.processes import free_domain
from dcdrw.trials.expectation import add_expect, expectation_status
from dcdrw.trials.filmed_rig import filmed_rig
from dcdrw.trials.results import describe, result, write_results
from dcdrw.trials.simulated import Course, SimulatedTrial
from dcdrw.trials.summary import summarize
from dcdrw_control.sync.synchronizer import SynchronizerParams
from dcdrw_msgs_py.diagnosis import PairState
from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.quantity import check
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_sim.rig.simulator import SimulatedRig
from dcdrw_tracker.gait.diagnostics import phase_text
from dcdrw_tracker.gait.phase import PhaseParams

if TYPE_CHECKING:
    from dcdrw.nodes.observer import Observer

PERSON_LAWS = ('rear', 'off')

_EPILOG = """\
The nodes run on a free ROS domain that only this machine sees, unless --domain names one. DIR gets the
recording (for ros2 bag, dcdrw replay and dcdrw analyze), summary.json, trial.png, samples.csv, footfalls.csv and what
each node printed. Exit status: 0 the trial ran to its end (whether or not the pair fell into step: see the summary),
1 a node died, no data came, or the verdict rests on less than was recorded, 2 wrong input,
3 it did not end as --expect says, 130 interrupted.

With --camera, joint_states come from pictures, as from a real rig: simulator, virtual_camera and tag_tracker run in a
row. Where the camera stands and what its pictures are like are parameters of virtual_camera, in the file of --rig.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command, and declare what it takes."""
    parser.description = 'Run simulator, phase estimator and synchronization monitor as processes over DDS.'
    parser.epilog = _EPILOG
    add_rig_options(parser)
    parser.add_argument(
        '--initial-phase',
        type=phase_percent,
        metavar='PERCENT',
        help='phase at the start, percent of a step (default: 21.6)',
    )
    parser.add_argument('--seconds', type=positive, default=30.0, help='length of the trial (default: %(default)g)')
    parser.add_argument(
        '--person',
        nargs='?',
        const='rear',
        choices=PERSON_LAWS,
        metavar='LAW',
        help='a person walks in front (parameters person.* of the simulator, in the file of --rig), and the '
        'synchronizer drives the rear hub by its law rear (the default), or off: nobody drives it',
    )
    parser.add_argument(
        '--camera',
        action='store_true',
        help='have the wheels tracked in the pictures of a virtual camera, and tell how well',
    )
    parser.add_argument(
        '--out',
        type=Path,
        metavar='DIR',
        help='where to write; must not exist, or be empty (default: trials/DATE-TIME)',
    )
    parser.add_argument('--domain', type=domain, metavar='N', help='ROS domain to use instead of a free one')
    parser.add_argument('--note', default='', metavar='TEXT', help='what to keep with the recording')
    parser.add_argument('--quiet', action='store_true', help='no live progress')
    add_formats(parser)
    add_json(parser)
    add_expect(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    need('a trial', 'rclpy')
    check_json(options)
    require_libraries()
    if options.camera:
        opencv()
    params = chosen_params(options)
    if options.initial_phase is not None:
        params = params._replace(
            simulator=check(params.simulator._replace(initial_phase_percent=options.initial_phase), '--initial-phase')
        )
    if params.simulator.publish_clock:
        raise ValueError('a trial runs in real time: publish_clock must be false')
    if options.person:
        simulator = params.simulator
        params = params._replace(simulator=simulator._replace(person=simulator.person._replace(walks=True)))
        SimulatedRig(params.rig, params.simulator)  # an impossible walk is told before anything runs
    start, _ = params.simulator.start(params.rig)  # an impossible start is told before anything runs
    phase = simulated_joints(params.phase)._replace(S0=start.S0 - start.front.step_length)
    params = params._replace(phase=phase)
    filmed = filmed_rig(options, params) if options.camera else None
    folder = free_folder(options.out)
    folder.mkdir(parents=True, exist_ok=True)
    with (
        _Screen(options.quiet or options.json == STDOUT) as screen,
        nullcontext(options.domain) if options.domain is not None else free_domain() as chosen,
    ):
        environment = {'ROS_DOMAIN_ID': str(chosen)}
        if options.domain is None:
            environment |= {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
        course = SimulatedTrial(
            params,
            filmed,
            folder,
            environment,
            options.seconds,
            options.note,
            screen.say,
            screen.watch,
            _synchronizer(params, options.person),
        ).run()
    return _finish(course, folder, options)


def simulated_joints(phase: PhaseParams) -> PhaseParams:
    """The same for the simulator's joints, whatever names, unit, signs and zeros the rig's own encoders have."""
    joints = PhaseParams()
    return phase._replace(
        **{
            name: getattr(joints, name)
            for name in PhaseParams._fields
            if name in ('unit', 'rollover') or name.endswith(('_joint', '_sign', '_zero'))
        }
    )


def _synchronizer(params: TrialParams, law: str | None) -> SynchronizerParams | None:
    """What acts on a pair whose front half is a person; None where nobody walks in front."""
    if law is None:
        return None
    return SynchronizerParams(
        law, hub=hub_gains(params.rig), front=params.phase.front, rear=params.phase.rear, S0=params.phase.S0
    )


_STYLES = {
    PairState.SYNCHRONIZED: 'green',
    PairState.STALLED: 'red',
    PairState.SLIPPED: 'red',
    PairState.LOST: 'red',
}


class _Screen(LiveLine):
    """The live line of a trial, what matters most first; where there is no terminal, a line each second."""

    def __init__(self, quiet: bool) -> None:
        super().__init__(quiet)
        self._print = not (quiet or self.on)
        self._printed = -math.inf

    def say(self, text: str, style: str = '') -> None:
        """Show a line."""
        self.show(text, style)
        if self._print and time.monotonic() - self._printed >= 1.0:
            self._printed = time.monotonic()
            print(text, flush=True)

    def watch(self, observer: 'Observer') -> None:
        """Show what the pair does."""
        status, strikes = observer.monitor.status(), observer.strikes
        state = observer.state or PairState.NO_DATA
        self.say(
            f'{observer.seconds:5.1f} s  {state.word:<12}  error {status.error_percent:+5.1f} %  '
            f'phase {phase_text(status.phase)}  strikes {strikes[FRONT]} + {strikes[REAR]}  '
            f'n {status.step_difference:+d}',
            _STYLES.get(state, ''),
        )


def _finish(course: Course, folder: Path, options: argparse.Namespace) -> int:
    """Say and write what the trial came to; returns the exit status."""
    failure, trial, truth = course.failure, course.analysis, course.truth
    summary = summarize(trial)
    more = {
        'end': course.end,
        'agreement': describe(course.agreements),
        'diagnostics': course.diagnoses,
        **({'truth': truth._asdict()} if truth else {}),
        **({'person_force': course.person_force._asdict()} if course.person_force else {}),
    }
    try:
        tell(
            options, [summary.sentence, *(str(one) for one in (truth, course.person_force) if one)], result(trial, more)
        )
        write_results(trial, folder, more, formats=options.formats)
        tell_where(options, f'Written: {folder}/')
    except ValueError as error:
        print(f'dcdrw trial: no picture: {error}', file=sys.stderr)
    except OSError as error:
        failure = failure or in_words(error)
    if failure:
        print(f'dcdrw trial: {failure}', file=sys.stderr)
    elif course.interrupted:
        print('dcdrw trial: interrupted; what came before is kept', file=sys.stderr)
    if course.interrupted:
        return interrupted_status(course.interrupted)
    return expectation_status(options.expect, [trial.state]) if summary.complete and not failure else 1

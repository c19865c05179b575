"""`dcdrw trial`: simulator, phase estimator, monitor and recorder as processes, watched live, judged by the record.

With `--camera`, virtual camera and tag tracker stand between the simulator and the others, which do not know.
"""

import argparse
import math
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, nullcontext
from datetime import datetime
from pathlib import Path
from typing import Any

from dcdrw.arguments import domain, number, positive
from dcdrw.commands.analyze import describe, read_trial, write_results
from dcdrw.recordings.recorder import RecorderParams, require_libraries
from dcdrw.recordings.recording import RECORDING, Recording
from dcdrw.suite.executables import RECORDER, SIMULATOR, TAG_TRACKER, TRIAL, VIRTUAL_CAMERA, Executable
from dcdrw.suite.parameter_file import TrialParams, add_rig_options, chosen_params, write_parameter_file
from dcdrw.suite.processes import NodeProcess, free_domain
from dcdrw.trials.analysis import analyze
from dcdrw.trials.filmed_rig import FilmedRig, TruthError, filmed_rig, truth_error
from dcdrw.trials.summary import sentence
from dcdrw_msgs_py.diagnosis import Level
from dcdrw_msgs_py.opencv import opencv
from dcdrw_msgs_py.quantity import check
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.topics import FOOTFALLS, JOINT_STATES, PHASE_STATE, SYNC_ERROR
from dcdrw_tracker.gait.diagnostics import phase_text
from dcdrw_tracker.gait.phase import PhaseParams

START_SECONDS = 30.0
"""Limit for the nodes to start, find each other and let data through."""
ASK_AGAIN_SECONDS = 2.0
"""A request that has brought nothing for so long is sent again [s]."""
SILENCE_SECONDS = 3.0
"""Without data for this long, a trial has failed."""
TRUTH = 'true_joint_states'
"""What the simulator publishes in the place of joint_states where a camera films the rig."""

_EPILOG = """\
The nodes run on a free ROS domain that only this machine sees, unless --domain names one. DIR gets the
recording (for ros2 bag, dcdrw replay and dcdrw analyze), summary.json, trial.png, samples.csv, footfalls.csv and what
each node printed. Exit status: 0 the trial ran to its end (whether
or not the pair fell into step: see the summary), 1 a node died or no data came, 2 wrong input, 130 interrupted.

With --camera, joint_states come from pictures, as from a real rig: simulator, virtual_camera and tag_tracker run in a
row. Where the camera stands and what its pictures are like are parameters of virtual_camera, in the file of --rig.
"""


INTERRUPTED = 'interrupted before the start'


class TrialError(Exception):
    """The trial cannot go on."""


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        'trial',
        help='run a trial in simulation, live, and judge it',
        epilog=_EPILOG,
        description='Run simulator, phase estimator and synchronization monitor as processes over DDS.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_rig_options(parser)
    parser.add_argument(
        '--initial-phase', type=number, metavar='PERCENT', help='phase at the start, percent of a step (default: 21.6)'
    )
    parser.add_argument('--seconds', type=positive, default=30.0, help='length of the trial (default: %(default)g)')
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
    parser.set_defaults(run=trial, prog='dcdrw trial')


def trial(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    try:
        import rclpy  # noqa: F401
    except ImportError:
        raise ValueError(
            "a trial needs rclpy: source a ROS 2, or pip install 'ros-jazzy-rclpy[fastrtps]' "
            'ros-jazzy-common-interfaces'
        ) from None
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
    start, _ = params.simulator.start(params.rig)  # an impossible start is told before anything runs
    # The joints are the simulator's, whatever the rig's own are called.
    joints = PhaseParams()
    params = params._replace(
        phase=params.phase._replace(
            S0=start.S0 - start.front.step_length,
            front_joint=joints.front_joint,
            rear_joint=joints.rear_joint,
            coupler_joint=joints.coupler_joint,
        )
    )
    filmed = filmed_rig(options, params) if options.camera else None
    folder = free_folder(options.out)
    folder.mkdir(parents=True, exist_ok=True)
    with nullcontext(options.domain) if options.domain is not None else free_domain() as chosen:
        return _Trial(params, filmed, options, folder, chosen).run()


def free_folder(chosen: Path | None) -> Path:
    """The folder for what a trial brings, by default one for this second; nothing is made yet.

    Raises:
        ValueError: it holds something already.

    """
    folder = chosen or Path('trials') / datetime.now().strftime('%Y%m%d-%H%M%S')
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ValueError(f'{folder} exists already, not overwriting; choose another --out')
    return folder


class _Trial:
    """One trial from start to summary."""

    def __init__(
        self, params: TrialParams, filmed: FilmedRig | None, options: argparse.Namespace, folder: Path, domain: int
    ) -> None:
        self.params, self.filmed, self.options, self.folder, self.domain = params, filmed, options, folder, domain
        self.executables: tuple[Executable, ...] = (*TRIAL, VIRTUAL_CAMERA, TAG_TRACKER) if filmed else TRIAL
        self.nodes: list[NodeProcess] = []
        self.interrupted = False

    def run(self) -> int:
        environment = {'ROS_DOMAIN_ID': str(self.domain)}
        if self.options.domain is None:
            environment |= {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
        os.environ.update(environment)
        import rclpy
        from rclpy.signals import SignalHandlerOptions

        from dcdrw.nodes.observer import Observer
        from dcdrw_msgs_py.node import make_executor

        def interrupt(*_: object) -> None:
            self.interrupted = True

        with ExitStack() as stack:
            for number_ in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                stack.callback(signal.signal, number_, signal.signal(number_, interrupt))
            rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
            stack.callback(rclpy.try_shutdown)
            self.observer = Observer(self.params.sync)
            self.executor = make_executor()
            self.executor.add_node(self.observer)
            stack.callback(self._stop_nodes)
            failure = ''
            try:
                self._start_nodes(environment)
                self._let_go()
                self._watch()
            except TrialError as error:
                failure = str(error)
            self._stop_nodes()
            return self._finish(failure)

    def _start_nodes(self, environment: dict[str, str]) -> None:
        file = self.folder / 'parameters.yaml'
        held = self.params.simulator._replace(paused=True)
        topics = f'{TRUTH}:{JOINT_STATES.type}' if self.filmed else ''
        recorder = RecorderParams(str(self.folder / RECORDING), self.options.note, topics, record=True)
        write_parameter_file((*self.params._replace(simulator=held), *(self.filmed or ()), recorder), file)
        for node in (RECORDER, *reversed(self.executables)):  # who listens, first
            arguments = ['--ros-args', '--params-file', str(file)]
            if self.filmed and node in (SIMULATOR, VIRTUAL_CAMERA):
                arguments += ['-r', f'{JOINT_STATES.name}:={TRUTH}']
            self.nodes.append(
                NodeProcess(node.name, node.module, arguments, environment, self.folder / f'{node.name}.log')
            )
        self._say('starting the nodes ...')
        self._spin_until(self._all_at_work, START_SECONDS, 'no data came through the nodes')

    def _all_at_work(self) -> bool:
        """Whether data come through the whole chain, and the recorder has them, and every parameter."""
        needed, recorder = (PHASE_STATE, SYNC_ERROR), self.observer.diagnoses.get(RECORDER.name)
        if recorder is None or not {topic.name for topic in needed} <= self.observer.heard:
            return False
        told = recorder.values
        return (
            all(int(told.get(f'messages of /{topic.name}', 0)) > 0 for topic in (JOINT_STATES, *needed))
            and f'messages of /{FOOTFALLS.name}' in told
            and all(node.name in told.get('parameters of', '') for node in self.executables)
        )

    def _let_go(self) -> None:
        """Release the wheels, which were held until the whole chain was seen to work."""
        from std_srvs.srv import SetBool

        client = self.observer.create_client(SetBool, '/simulator/pause')
        self._spin_until(client.service_is_ready, START_SECONDS, 'the service /simulator/pause was not found')
        self.observer.age.renew()
        asked = -math.inf

        def moving() -> bool:
            nonlocal asked
            if time.monotonic() - asked > ASK_AGAIN_SECONDS:
                asked = time.monotonic()
                client.call_async(SetBool.Request(data=False))
            return self.observer.moving

        self._spin_until(moving, START_SECONDS, 'the simulator did not let the wheels go')

    def _watch(self) -> None:
        shown = 0.0
        while not self.interrupted and self.observer.seconds < self.options.seconds:
            self._spin_once()
            if time.monotonic() - shown >= (0.1 if sys.stdout.isatty() else 1.0):
                self._show()
                shown = time.monotonic()
            if self.observer.age.seconds > SILENCE_SECONDS:
                raise TrialError(f'no data for {SILENCE_SECONDS:g} s')

    def _show(self) -> None:
        status, strikes = self.observer.monitor.status(), self.observer.strikes
        state = 'SYNCHRONIZED' if self.observer.synchronized else 'STALLED' if status.stalled else 'CONVERGING'
        self._say(
            f'{self.observer.seconds:5.1f} s  phase {phase_text(status.phase)}  '
            f'error {status.error_percent:+5.1f} %  n {status.step_difference:+d}  '
            f'strikes {strikes[FRONT]} + {strikes[REAR]}  {state}'
        )

    def _say(self, text: str) -> None:
        if self.options.quiet:
            return
        if sys.stdout.isatty():
            print(f'\r\x1b[K{text}', end='', flush=True)
        else:
            print(text, flush=True)

    def _spin_until(self, condition: Callable[[], bool], limit: float, otherwise: str) -> None:
        end = time.monotonic() + limit
        while not condition():
            if self.interrupted:
                raise TrialError(INTERRUPTED)
            if time.monotonic() > end:
                said = '; '.join(f'{name}: {said.message}' for name, said in self.observer.diagnoses.items())
                raise TrialError(f'{otherwise} ({said or "the nodes say nothing"})')
            self._spin_once()

    def _spin_once(self) -> None:
        self.executor.spin_once(timeout_sec=0.05)
        for node in self.nodes:
            if node.failure and not self.interrupted:
                raise TrialError(node.failure)
        recorder = self.observer.diagnoses.get(RECORDER.name)
        if recorder and recorder.level is Level.ERROR:
            raise TrialError(recorder.message)

    def _stop_nodes(self) -> None:
        """The recorder first: what the others publish when they end is no part of the trial."""
        for group in (self.nodes[:1], self.nodes[1:]):
            for node in group:
                node.interrupt()
            for node in group:
                node.wait()

    def _finish(self, failure: str) -> int:
        """Judge and write what there is, whatever happened."""
        if not self.options.quiet and sys.stdout.isatty():
            print()
        end = failure or ('interrupted' if self.interrupted else 'complete')
        truth: TruthError | None = None
        try:
            trial, agreements = read_trial(self.folder / RECORDING, self.params)
            if self.filmed:
                with Recording(self.folder / RECORDING) as recording:
                    truth = truth_error(trial, recording.joints(recording.find(TRUTH)))
        except (ValueError, OSError) as error:
            trial, agreements = analyze([], self.params), {}
            failure = failure or str(error)
        print(sentence(trial))
        if truth:
            print(truth)
        try:
            write_results(
                trial,
                self.folder,
                end=end,
                agreement=describe(agreements),
                diagnostics={name: said.message for name, said in self.observer.diagnoses.items()},
                **({'truth': truth._asdict()} if truth else {}),
            )
            print(f'Written: {self.folder}/')
        except ValueError as error:
            print(f'dcdrw trial: no picture: {error}', file=sys.stderr)
        except OSError as error:
            failure = failure or f'{error.strerror}: {self.folder}'
        if failure:
            print(f'dcdrw trial: {failure}', file=sys.stderr)
        return 130 if self.interrupted else 1 if failure else 0

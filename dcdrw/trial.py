"""`dcdrw trial`: simulator, phase estimator and monitor as three processes, watched live and judged at the end."""

import argparse
import json
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
from dcdrw.executables import EXECUTABLES
from dcdrw.figure import draw_trial
from dcdrw.parameter_file import TrialParams, add_rig_options, chosen_params, write_parameter_file
from dcdrw.processes import NodeProcess, free_domain
from dcdrw.summary import SECOND, TrialData, judge, summarize
from dcdrw_msgs_py.quantity import check
from dcdrw_msgs_py.topics import FOOTFALLS, JOINT_STATES, PHASE_STATE, SYNC_ERROR
from dcdrw_tracker.diagnostics import phase_text
from dcdrw_tracker.phase import PhaseParams
from dcdrw_tracker.sync import SyncMonitor

START_SECONDS = 30.0
"""Limit for the nodes to start, find each other and let data through."""
ASK_AGAIN_SECONDS = 2.0
"""A request that has brought nothing for so long is sent again [s]."""
SILENCE_SECONDS = 3.0
"""Without data for this long, a trial has failed."""

_EPILOG = """\
The nodes run on a free ROS domain that only this machine sees, unless --domain names one. DIR gets summary.json,
trial.png, samples.csv, footfalls.csv and what each node printed. Exit status: 0 the trial ran to its end (whether
or not the pair fell into step: see the summary), 1 a node died or no data came, 2 wrong input, 130 interrupted.
"""


INTERRUPTED = 'interrupted before the start'


class TrialError(Exception):
    """The trial cannot go on."""


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        'trial', help='run a trial in simulation, live, and judge it', epilog=_EPILOG,
        description='Run simulator, phase estimator and synchronization monitor as processes over DDS.',
        formatter_class=argparse.RawDescriptionHelpFormatter)
    add_rig_options(parser)
    parser.add_argument('--initial-phase', type=number, metavar='PERCENT',
                        help='phase at the start, percent of a step (default: 21.6)')
    parser.add_argument('--seconds', type=positive, default=30.0, help='length of the trial (default: %(default)g)')
    parser.add_argument('--out', type=Path, metavar='DIR', help='where to write; must not exist, or be empty '
                        '(default: trials/DATE-TIME)')
    parser.add_argument('--domain', type=domain, metavar='N', help='ROS domain to use instead of a free one')
    parser.add_argument('--quiet', action='store_true', help='no live progress')
    parser.set_defaults(run=trial, prog='dcdrw trial')


def trial(options: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    try:
        import rclpy  # noqa: F401
    except ImportError:
        raise ValueError("a trial needs rclpy: source a ROS 2, or pip install 'ros-jazzy-rclpy[fastrtps]' "
                         'ros-jazzy-common-interfaces') from None
    params = chosen_params(options)
    if options.initial_phase is not None:
        params = params._replace(simulator=check(
            params.simulator._replace(initial_phase_percent=options.initial_phase), '--initial-phase'))
    if params.simulator.publish_clock:
        raise ValueError('a trial runs in real time: publish_clock must be false')
    start, _ = params.simulator.start(params.rig)  # an impossible start is told before anything runs
    # The joints are the simulator's, whatever the rig's own are called.
    joints = PhaseParams()
    params = params._replace(phase=params.phase._replace(
        S0=start.S0 - start.front.step_length, front_joint=joints.front_joint, rear_joint=joints.rear_joint,
        coupler_joint=joints.coupler_joint))
    folder = _folder(options.out)
    with nullcontext(options.domain) if options.domain is not None else free_domain() as chosen:
        return _Trial(params, options, folder, chosen).run()


def _folder(chosen: Path | None) -> Path:
    folder = chosen or Path('trials') / datetime.now().strftime('%Y%m%d-%H%M%S')
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ValueError(f'{folder} exists already, not overwriting; choose another --out')
    folder.mkdir(parents=True, exist_ok=True)
    return folder


class _Trial:
    """One trial from start to summary."""

    def __init__(self, params: TrialParams, options: argparse.Namespace, folder: Path, domain: int) -> None:
        self.params, self.options, self.folder, self.domain = params, options, folder, domain
        self.nodes: list[NodeProcess] = []
        self.interrupted = False

    def run(self) -> int:
        environment = {'ROS_DOMAIN_ID': str(self.domain)}
        if self.options.domain is None:
            environment |= {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
        os.environ.update(environment)
        import rclpy
        from rclpy.signals import SignalHandlerOptions

        from dcdrw.observer import Observer
        from dcdrw_msgs_py.node import make_executor

        def interrupt(*_: object) -> None:
            self.interrupted = True

        with ExitStack() as stack:
            for number_ in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                stack.callback(signal.signal, number_, signal.signal(number_, interrupt))
            rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
            stack.callback(rclpy.try_shutdown)
            self.observer = Observer(self.folder)
            stack.callback(self.observer.close)
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
        write_parameter_file(self.params._replace(simulator=held), file)
        for node in reversed(EXECUTABLES):  # who listens, first
            self.nodes.append(NodeProcess(node.name, node.module, ['--ros-args', '--params-file', str(file)],
                                          environment, self.folder / f'{node.name}.log'))
        self._say('starting the nodes ...')
        needed = {topic.name for topic in (JOINT_STATES, PHASE_STATE, SYNC_ERROR)}
        self._spin_until(lambda: needed <= self.observer.heard and self.observer.count_publishers(FOOTFALLS.name) > 0,
                         START_SECONDS, 'no data came through the nodes')

    def _let_go(self) -> None:
        """Release the wheels, which were held until the whole chain was seen to work."""
        from std_srvs.srv import SetBool
        client = self.observer.create_client(SetBool, '/simulator/pause')
        self._spin_until(client.service_is_ready, START_SECONDS, 'the service /simulator/pause was not found')
        self.observer.record()
        asked = -math.inf

        def moving() -> bool:
            nonlocal asked
            if time.monotonic() - asked > ASK_AGAIN_SECONDS:
                asked = time.monotonic()
                client.call_async(SetBool.Request(data=False))
            return self.observer.moving

        self._spin_until(moving, START_SECONDS, 'the simulator did not let the wheels go')

    def _watch(self) -> None:
        observer, monitor, fed = self.observer, SyncMonitor(self.params.sync), 0
        shown = 0.0
        while True:
            self._spin_once()
            while fed < len(observer.phases):
                monitor.update(observer.phases[fed])
                fed += 1
            now = time.monotonic()
            if now - shown >= (0.1 if sys.stdout.isatty() else 1.0):
                observer.flush()
                self._show(monitor)
                shown = now
            if self.interrupted or (fed and self._elapsed() >= self.options.seconds):
                return
            if observer.age.seconds > SILENCE_SECONDS:
                raise TrialError(f'no data for {SILENCE_SECONDS:g} s')

    def _elapsed(self) -> float:
        phases = self.observer.phases
        return (phases[-1].stamp_ns - phases[0].stamp_ns) / SECOND if phases else 0.0

    def _show(self, monitor: SyncMonitor) -> None:
        status, falls = monitor.status(), self.observer.footfalls
        state = 'SYNCHRONIZED' if self.observer.synchronized else 'STALLED' if status.stalled else 'CONVERGING'
        front = sum(fall.wheel == 'front' for fall in falls)
        self._say(f'{self._elapsed():5.1f} s  phase {phase_text(status.phase)}  error {status.error_percent:+5.1f} %  '
                  f'n {status.step_difference:+d}  strikes {front} + {len(falls) - front}  {state}')

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
                said = '; '.join(f'{name}: {message}' for name, message in self.observer.diagnoses.items())
                raise TrialError(f'{otherwise} ({said or "the nodes say nothing"})')
            self._spin_once()

    def _spin_once(self) -> None:
        self.executor.spin_once(timeout_sec=0.05)
        for node in self.nodes:
            if node.failure and not self.interrupted:
                raise TrialError(node.failure)
        if self.observer.failure:
            raise TrialError(self.observer.failure)

    def _stop_nodes(self) -> None:
        for node in self.nodes:
            node.interrupt()
        for node in self.nodes:
            node.wait()

    def _finish(self, failure: str) -> int:
        """Write what there is, whatever happened."""
        observer = self.observer
        if not self.options.quiet and sys.stdout.isatty():
            print()
        data = TrialData(self.params, observer.joints, observer.phases, observer.footfalls)
        status, errors = judge(data)
        summary = summarize(data, status, errors)
        end = failure or ('interrupted' if self.interrupted else 'complete')
        content = json.dumps({'end': end, **summary, 'diagnostics': observer.diagnoses}, indent=1, ensure_ascii=False)
        print(summary['sentence'])
        try:
            (self.folder / 'summary.json').write_text(content + '\n', encoding='utf-8')
            if data.phases:
                draw_trial(data, status, summary['sentence'], self.folder / 'trial.png')
            print(f'Written: {self.folder}/')
        except ValueError as error:
            print(f'dcdrw trial: no picture: {error}', file=sys.stderr)
        except OSError as error:
            failure = failure or f'{error.strerror}: {self.folder}'
        if failure:
            print(f'dcdrw trial: {failure}', file=sys.stderr)
        return 130 if self.interrupted else 1 if failure else 0


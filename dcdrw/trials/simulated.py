"""A trial in simulation: the nodes as processes, watched live from the start to the record's judgement."""

import math
import os
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dcdrw.console import in_words, interruptible
from dcdrw.recordings.bag_folder import RECORDING
from dcdrw.recordings.recording import Recording
from dcdrw.suite.executables import (
    RECORDER,
    SIMULATOR,
    SYNCHRONIZER,
    TAG_TRACKER,
    TRIAL,
    VIRTUAL_CAMERA,
    Executable,
)
from dcdrw.suite.parameter_file import TrialParams, write_parameter_file
from dcdrw.suite.processes import NodeProcess
from dcdrw.suite.recorder_params import RecorderParams
from dcdrw.trials.agreement import Agreement
from dcdrw.trials.analysis import Analysis, analyze
from dcdrw.trials.filmed_rig import FilmedRig, TruthError, truth_error
from dcdrw.trials.motion import MotionTable, Sink, Whole
from dcdrw.trials.results import read_trial, sample_file
from dcdrw_control.sync.synchronizer import SynchronizerParams
from dcdrw_msgs_py.diagnosis import Diagnosis, RecorderState, messages_of, parameters_of
from dcdrw_msgs_py.rig import REAR
from dcdrw_msgs_py.topics import COUPLER, FOOTFALLS, JOINT_STATES, PHASE_STATE, SYNC_ERROR
from dcdrw_msgs_py.values import Floats

if TYPE_CHECKING:
    from dcdrw.nodes.observer import Observer

START_SECONDS = 30.0
"""Limit for the nodes to start, find each other and let data through."""
ASK_AGAIN_SECONDS = 2.0
"""A request that has brought nothing for so long is sent again [s]."""
SILENCE_SECONDS = 3.0
"""Without data for this long, a trial has failed."""
TRUTH = 'true_joint_states'
"""What the simulator publishes in the place of joint_states where a camera films the rig."""
INTERRUPTED = 'interrupted before the start'


class TrialError(Exception):
    """The trial cannot go on."""


class PersonForce(NamedTuple):
    """The coupler's force on the person, since the wheels were let go [N]."""

    peak: float
    rms: float

    def __str__(self) -> str:
        """The force in a sentence."""
        return f'On the person: {self.peak:.1f} N at most, {self.rms:.1f} N rms.'


class ForceMeter:
    """Takes the coupler's force from what was recorded: a `Sink`."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Forget what came before."""
        self._count, self._peak, self._squares = 0, 0.0, 0.0

    def take(self, motion: MotionTable) -> None:
        """Take the next rows."""
        self.add(motion.coupler_force)

    def add(self, forces: Floats) -> None:
        """Take the next forces [N]; NaN where one is unknown."""
        known = forces[np.isfinite(forces)]
        self._count += known.size
        self._peak = max(self._peak, float(np.abs(known).max(initial=0.0)))
        self._squares += float(known @ known)

    def told(self) -> PersonForce | None:
        """Peak and rms; None where no force is known."""
        return PersonForce(self._peak, math.sqrt(self._squares / self._count)) if self._count else None


class Course(NamedTuple):
    """How a trial went, and what its record says."""

    failure: str
    """Why it ended early or cannot be judged; empty where it ran to its end or was interrupted."""
    interrupted: list[int]
    """The signals that ended it early."""
    analysis: Analysis
    """Analysis of the recording."""
    agreements: dict[str, Agreement]
    truth: TruthError | None
    """Where a camera filmed the rig."""
    diagnoses: dict[str, Diagnosis]
    """What each node said of itself last."""
    person_force: PersonForce | None
    """Where a person walked in front."""

    @property
    def end(self) -> str:
        """Why it ended, in words."""
        return self.failure or ('interrupted' if self.interrupted else 'complete')


class SimulatedTrial:
    """One trial from start to record.

    Args:
        params: of all nodes.
        filmed: camera and tracker, where these stand between the simulator and the others.
        synchronizer: that acts on the pair, enabled from the start to the end; None: nobody does.
        folder: for the recording and what each node prints; exists.
        environment: the ROS domain of the nodes.
        seconds: how long the wheels roll, by the stamps [s].
        note: kept with the recording.
        say: told what the trial is at.
        show: told now and then what the observer sees.

    """

    def __init__(
        self,
        params: TrialParams,
        filmed: FilmedRig | None,
        folder: Path,
        environment: dict[str, str],
        seconds: float,
        note: str,
        say: Callable[[str], None],
        show: Callable[['Observer'], None],
        synchronizer: SynchronizerParams | None = None,
    ) -> None:
        self._params, self._filmed, self._folder, self._environment = params, filmed, folder, environment
        self._seconds, self._note, self._say, self._show = seconds, note, say, show
        self._synchronizer = synchronizer
        self._executables: tuple[Executable, ...] = (
            *TRIAL,
            *((VIRTUAL_CAMERA, TAG_TRACKER) if filmed else ()),
            *((SYNCHRONIZER,) if synchronizer else ()),
        )
        self._nodes: list[NodeProcess] = []
        self._interrupted: list[int] = []

    def run(self) -> Course:
        """Run it, until its end, a failure or a signal."""
        os.environ.update(self._environment)
        import rclpy
        from rclpy.signals import SignalHandlerOptions

        from dcdrw.nodes.observer import Observer
        from dcdrw_msgs_py.executor import StreamExecutor

        with ExitStack() as stack:
            self._interrupted = stack.enter_context(interruptible())
            rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
            stack.callback(rclpy.try_shutdown)
            self._observer = Observer(self._params.sync)
            if self._synchronizer:
                self._observer.enable_when_moving()
            self._executor = StreamExecutor()
            self._executor.add_node(self._observer)
            stack.callback(self._stop_nodes)
            failure = ''
            try:
                self._start_nodes()
                self._let_go()
                self._watch()
            except TrialError as error:
                failure = str(error)
            self._stop_nodes()
            return self._judge(failure)

    def _start_nodes(self) -> None:
        file = self._folder / 'parameters.yaml'
        held = self._params.simulator._replace(paused=True)
        topics = f'{TRUTH}:{JOINT_STATES.type}' if self._filmed else ''
        recorder = RecorderParams(str(self._folder / RECORDING), self._note, topics, record=True)
        acting = (self._synchronizer,) if self._synchronizer else ()
        write_parameter_file((*self._params._replace(simulator=held), *(self._filmed or ()), *acting, recorder), file)
        for node in (RECORDER, *reversed(self._executables)):  # who listens, first
            arguments = ['--ros-args', '--params-file', str(file)]
            if self._filmed and node in (SIMULATOR, VIRTUAL_CAMERA):
                arguments += ['-r', f'{JOINT_STATES.name}:={TRUTH}']
            self._nodes.append(
                NodeProcess(
                    node.name,
                    'dcdrw.entry',
                    [node.name, *arguments],
                    self._environment,
                    self._folder / f'{node.name}.log',
                )
            )
        self._say('starting the nodes ...')
        self._spin_until(self._all_at_work, START_SECONDS, 'no data came through the nodes')

    def _all_at_work(self) -> bool:
        """Whether data come through the whole chain, and the recorder has them, and every parameter."""
        needed, recorder = (PHASE_STATE, SYNC_ERROR), self._observer.diagnoses.get(RECORDER.name)
        if recorder is None or not {topic.name for topic in needed} <= self._observer.heard:
            return False
        return (
            all(recorder.number(messages_of(f'/{topic.name}')) > 0 for topic in (JOINT_STATES, *needed))
            and messages_of(f'/{FOOTFALLS[REAR].name}') in recorder.values
            and all(recorder.flag(parameters_of(node.name)) for node in self._executables)
        )

    def _let_go(self) -> None:
        """Release the wheels, which were held until the whole chain was seen to work."""
        from std_srvs.srv import SetBool

        client = self._observer.create_client(SetBool, '/simulator/pause')
        self._spin_until(client.service_is_ready, START_SECONDS, 'the service /simulator/pause was not found')
        self._observer.age.renew()
        asked = -math.inf

        def moving() -> bool:
            nonlocal asked
            if time.monotonic() - asked > ASK_AGAIN_SECONDS:
                asked = time.monotonic()
                client.call_async(SetBool.Request(data=False))
            return self._observer.moving

        self._spin_until(moving, START_SECONDS, 'the simulator did not let the wheels go')

    def _watch(self) -> None:
        while not self._interrupted and self._observer.seconds < self._seconds:
            self._spin_once()
            self._show(self._observer)
            if self._observer.age.seconds > SILENCE_SECONDS:
                raise TrialError(f'no data for {SILENCE_SECONDS:g} s')

    def _spin_until(self, condition: Callable[[], bool], limit: float, otherwise: str) -> None:
        end = time.monotonic() + limit
        while not condition():
            if self._interrupted:
                raise TrialError(INTERRUPTED)
            if time.monotonic() > end:
                said = '; '.join(f'{name}: {said.message}' for name, said in self._observer.diagnoses.items())
                raise TrialError(f'{otherwise} ({said or "the nodes say nothing"})')
            self._spin_once()

    def _spin_once(self) -> None:
        self._executor.spin_once(timeout_sec=0.05)
        for node in self._nodes:
            if node.failure and not self._interrupted:
                raise TrialError(node.failure)
        recorder = self._observer.diagnoses.get(RECORDER.name)
        if recorder and recorder.state(RecorderState) is RecorderState.FAILED:
            raise TrialError(recorder.message)

    def _stop_nodes(self) -> None:
        """The recorder first: what the others publish when they end is not part of the trial."""
        for group in (self._nodes[:1], self._nodes[1:]):
            for node in group:
                node.interrupt()
            for node in group:
                node.wait()

    def _judge(self, failure: str) -> Course:
        """Judge what there is, whatever happened."""
        truth: TruthError | None = None
        agreements: dict[str, Agreement] = {}
        analysis, whole, force = analyze([], self._params), Whole(), ForceMeter()
        sinks: tuple[Sink, ...] = (whole,) if self._filmed else (force,)
        try:
            with sample_file(self._folder) as table:
                analysis, agreements = read_trial(self._folder / RECORDING, self._params, sinks=(table, *sinks))
                if self._filmed:
                    with Recording(self._folder / RECORDING) as recording:
                        true = recording.find(TRUTH)
                        truth = truth_error(whole.motion, self._params, recording.joints(true))
                        for batch in recording.joints(true):
                            force.add(batch.effort[batch.stamp_ns >= analysis.start_ns, batch.names.index(COUPLER)])
        except (ValueError, OSError) as error:
            failure = failure or in_words(error)
        on_person = force.told() if self._params.simulator.person.walks else None
        return Course(failure, self._interrupted, analysis, agreements, truth, self._observer.diagnoses, on_person)

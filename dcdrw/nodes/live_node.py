"""The live page's ear and hand in ROS: hears the suite's topics, asks its nodes for parameters, does what is asked."""

import time
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from dcdrw.page.live_state import FRAME_RATE, Command, LiveState
from dcdrw.suite.executables import PHASE_ESTIMATOR, RECORDER, SIMULATOR, SYNC_MONITOR, SYNCHRONIZER
from dcdrw.suite.parameter_file import TrialParams
from dcdrw_msgs_py.messages import JointSampleReader, PhaseSampleReader, diagnoses, footfall
from dcdrw_msgs_py.node import advertise, listen, steady_clock
from dcdrw_msgs_py.quantity import build, fields
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams
from dcdrw_msgs_py.topics import (
    DIAGNOSTICS,
    ENABLE,
    FOOTFALLS,
    JOINT_STATES,
    PERSON_FORCE,
    PHASE_STATE,
    SYNCHRONIZER_STATE,
)
from dcdrw_tracker.gait.phase import PhaseParams
from dcdrw_tracker.gait.sync import SyncParams

Params = TypeVar('Params', bound=tuple[Any, ...])

ANSWER_SECONDS = 2.0
"""A request without an answer for this long is given up."""
ASK_SECONDS = 1.0
"""How often other nodes are asked for their parameters."""


class Service:
    """A service of another node: one request at a time; `then` gets the answer, or None where none came in time."""

    def __init__(self, node: Node, kind: Any, name: str) -> None:
        self._client = node.create_client(kind, name)
        self._future: Any = None
        self._asked_at = 0.0
        self._then: Callable[[Any], None] = lambda answer: None

    @property
    def ready(self) -> bool:
        """Whether somebody serves it."""
        return bool(self._client.service_is_ready())

    @property
    def busy(self) -> bool:
        """Whether a request is under way."""
        return self._future is not None

    def call(self, request: Any, then: Callable[[Any], None]) -> None:
        """Ask, unless a request is under way."""
        if not self.busy:
            self._then, self._asked_at = then, time.monotonic()
            self._future = self._client.call_async(request)

    def poll(self) -> None:
        """Look whether the answer has come, or time is up."""
        future = self._future
        if future is None:
            return
        late = time.monotonic() - self._asked_at > ANSWER_SECONDS
        if future.done() or late:
            self._future = None
            if not future.done():
                self._client.remove_pending_request(future)
            self._then(future.result() if future.done() else None)


class RemoteParameters(Generic[Params]):
    """The parameter set of another node; `on_change` is told it, and None when the node does not answer."""

    def __init__(self, node: Node, name: str, params: type[Params], on_change: Callable[[Params | None], None]) -> None:
        self._params, self._on_change = params, on_change
        self._names = [field.name for field in fields(params)]
        self._getter = Service(node, GetParameters, f'{name}/get_parameters')
        self._setter = Service(node, SetParameters, f'{name}/set_parameters')
        self._wanted: dict[str, Any] = {}
        self._told: Callable[[str], None] = lambda reason: None

    def ask(self) -> None:
        """Ask for the values."""
        if self._getter.ready:
            self._getter.call(GetParameters.Request(names=self._names), self._got)
        else:
            self._on_change(None)

    def set(self, name: str, value: Any, told: Callable[[str], None]) -> None:
        """Set a value as soon as the last request has been answered; `told` gets why not, empty where it was set."""
        self._wanted[name] = value
        self._told = told

    def poll(self) -> None:
        """Take what has come, and send what waits."""
        self._getter.poll()
        self._setter.poll()
        if self._wanted and not self._setter.busy:
            request = SetParameters.Request(
                parameters=[
                    ParameterMessage(name=name, value=Parameter(name, value=value).get_parameter_value())
                    for name, value in self._wanted.items()
                ]
            )
            self._wanted.clear()
            self._setter.call(request, self._set)

    def _got(self, answer: Any) -> None:
        values = answer.values if answer else []
        params = None
        if len(values) == len(self._names):
            with suppress(ValueError):
                params = build(
                    self._params,
                    {name: parameter_value_to_python(value) for name, value in zip(self._names, values, strict=True)},
                )
        self._on_change(params)

    def _set(self, answer: Any) -> None:
        refused = [result.reason for result in answer.results if not result.successful] if answer else ['no answer']
        self._told('; '.join(refused))
        self.ask()


class LiveNode(Node):
    """Feeds a `LiveState`, shows its frames, and carries out commands. Relative names: a namespace picks the rig.

    A simulator that starts `held` is let go once the whole chain is seen to work, so that none misses the start.
    """

    def __init__(
        self,
        params: TrialParams,
        show: Callable[[dict[str, Any]], None],
        commands: SimpleQueue[Command],
        held: bool = False,
        may_enable: bool = False,
        **kwargs: Any,
    ) -> None:
        super().__init__('live', **kwargs)
        self._state = LiveState(params, may_enable)
        self._enable = advertise(self, ENABLE) if may_enable else None
        self._show, self._commands, self._held = show, commands, held
        self._prefix = self.get_namespace().strip('/') + '/' if self.get_namespace() != '/' else ''
        self._phase_reader = PhaseSampleReader()
        self._take_phase_params(params.phase)
        for topic, take in (
            (JOINT_STATES, self._on_joints),
            (PHASE_STATE, self._on_phase),
            (FOOTFALLS[FRONT], lambda message: self._state.take_footfall(footfall(message, FRONT))),
            (FOOTFALLS[REAR], lambda message: self._state.take_footfall(footfall(message, REAR))),
            (PERSON_FORCE, self._on_person_force),
            (SYNCHRONIZER_STATE, lambda message: self._state.take_synchronizer_state(message.data)),
            (DIAGNOSTICS, self._on_diagnostics),
        ):
            listen(self, topic, _bearing(take))
        self._simulator = RemoteParameters(self, SIMULATOR.name, RigParams, self._state.take_controls)
        self._others = (
            RemoteParameters(self, PHASE_ESTIMATOR.name, PhaseParams, self._take_phase_params),
            RemoteParameters(self, SYNC_MONITOR.name, SyncParams, self._take_sync_params),
        )
        self._reset = Service(self, Trigger, f'{SIMULATOR.name}/reset')
        self._pause = Service(self, SetBool, f'{SIMULATOR.name}/pause')
        self._record = Service(self, SetBool, f'{RECORDER.name}/record')
        self._stop = Service(self, Trigger, f'{SYNCHRONIZER.name}/stop')
        self.create_timer(1.0 / FRAME_RATE, self._tick, clock=steady_clock())
        self.create_timer(ASK_SECONDS, self._ask, clock=steady_clock())

    def _take_phase_params(self, params: PhaseParams | None) -> None:
        if params:
            self._state.configure(phase=params)
            self._joints_reader = JointSampleReader(params.front_joint, params.rear_joint, params.coupler_joint)

    def _take_sync_params(self, params: SyncParams | None) -> None:
        if params:
            self._state.configure(sync=params)

    def _on_joints(self, message: Any) -> None:
        self._state.take_joints(self._joints_reader.read(message), time.monotonic())

    def _on_phase(self, message: Any) -> None:
        self._state.take_phase(self._phase_reader.read(message), time.monotonic())

    def _on_person_force(self, message: Any) -> None:
        self._state.take_person_force(message.wrench.force.x, time.monotonic())

    def _on_diagnostics(self, message: Any) -> None:
        for name, said in diagnoses(message).items():
            if name.startswith(self._prefix):
                self._state.take_health(name.removeprefix(self._prefix), said, time.monotonic())

    def _ask(self) -> None:
        for parameters in (self._simulator, *self._others):
            parameters.ask()
        if self._held and self._state.complete and self._pause.ready:
            self._do(Command('pause', value=False))

    def _tick(self) -> None:
        with suppress(Empty):
            while True:
                self._do(self._commands.get_nowait())
        for waiting in (self._simulator, *self._others, self._reset, self._pause, self._record, self._stop):
            waiting.poll()
        self._show(self._state.frame(time.monotonic()))

    def _do(self, command: Command) -> None:
        if command.do == 'set':
            self._simulator.set(command.name, command.value, self._told)
        elif command.do == 'reset':
            self._reset.call(Trigger.Request(), self._answered)
        elif command.do == 'pause':
            self._pause.call(SetBool.Request(data=command.value), self._let_go)
        elif command.do in ('enable', 'stop'):
            self._act(command)
        else:
            self._record.call(SetBool.Request(data=command.value), self._answered)

    def _act(self, command: Command) -> None:
        """Pass on a heartbeat of the page, or its stop: only where the command line allowed it."""
        if self._enable is None:
            self._state.notice('start dcdrw live with --allow-enable to enable and stop from here', ok=False)
            return
        self._enable.publish(Bool(data=bool(command.value)))
        if command.do == 'stop':
            self._stop.call(Trigger.Request(), self._answered)

    def _told(self, reason: str) -> None:
        if reason:
            self._state.notice(f'not set: {reason}', ok=False)

    def _let_go(self, answer: Any) -> None:
        if answer and answer.success:
            self._held = False
        self._answered(answer)

    def _answered(self, answer: Any) -> None:
        text = answer.message if answer else 'no answer; try again'
        self._state.notice(text, ok=bool(answer and answer.success))


def _bearing(take: Callable[[Any], None]) -> Callable[[Any], None]:
    """A callback that passes over what it cannot read: others may publish, too."""

    def bear(message: Any) -> None:
        with suppress(ValueError):
            take(message)

    return bear

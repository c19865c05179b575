"""The node `recorder`: every topic of the suite, as it comes off the wire, into a recording."""

import sys
import time
from array import array
from collections import OrderedDict
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool

from dcdrw.recordings.bag_file import Stream
from dcdrw.recordings.recorder import (
    FLUSH_SECONDS,
    PARAMETERS,
    Recorder,
    new_folder,
    offered_qos,
    write_whole,
)
from dcdrw.suite.executables import EXECUTABLES, RECORDED, RECORDER
from dcdrw.suite.recorder_params import RecorderParams
from dcdrw_msgs_py.diagnosis import STATE, Diagnosis, Level, RecorderState, messages_of, parameters_of
from dcdrw_msgs_py.node import Parameters, message_type, publish_diagnosis, run, steady_clock
from dcdrw_msgs_py.quantity import fields
from dcdrw_msgs_py.topics import SAMPLE_DEPTH, Topic
from dcdrw_msgs_py.words import counted
from dcdrw_msgs_py.yaml_file import yaml_text

LOOK_SECONDS = 0.5
"""How often the recorder looks who publishes, and who has not told its parameters yet."""
ASK_AGAIN_SECONDS = 2.0
REMEMBERED = 2 * SAMPLE_DEPTH
"""So many messages of a topic are known again when they come by a second subscription, too."""


class RecorderNode(Node):
    """Subscribes raw, keeps the parameters of the suite's nodes, starts and stops a `Recorder`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(RECORDER.name, **kwargs)
        self._settings = Parameters(self, RecorderParams, self._configure)
        self.recorder: Recorder | None = None
        self.failure = ''
        """Why the last recording ended before it was told to."""
        self._heard: dict[str, _Heard] = {}
        self._told: dict[str, dict[str, Any]] = {}
        """The parameters that the nodes told."""
        self._asked: dict[str, float] = {}
        self._questions = {
            node.name: (
                self.create_client(GetParameters, f'{node.name}/get_parameters'),
                [field.name for params in node.parameters for field in fields(params)],
            )
            for node in EXECUTABLES
            if node.name != RECORDER.name
        }
        self._wanted = {self.resolve_topic_name(topic.name): topic for topic in RECORDED}
        for word in self._settings.value.topics.split():
            name, _, kind = word.partition(':')
            self._wanted[self.resolve_topic_name(name)] = Topic(name, kind, '')
        self.create_service(SetBool, '~/record', self._on_record)
        self._report = publish_diagnosis(self, self._diagnose)
        self.create_timer(LOOK_SECONDS, self._look, clock=steady_clock())
        self.create_timer(FLUSH_SECONDS, self._flush, clock=steady_clock())
        if self._settings.value.record:
            self.begin()

    def begin(self) -> None:
        """Begin a recording.

        Raises:
            ValueError: its folder exists, or a library is missing.
            OSError: the folder cannot be made.

        """
        params = self._settings.value
        self.recorder = Recorder(Path(params.folder) if params.folder else new_folder(), {'note': params.note})
        self.failure = ''
        self._told.clear()
        self._asked.clear()
        self._look()
        self.get_logger().info(f'recording to {self.recorder.folder}')

    def end(self) -> None:
        """End the recording, if there is one, and write its index."""
        for heard in self._heard.values():
            self._close(heard.ears)
        self._heard.clear()
        recorder, self.recorder = self.recorder, None
        if recorder is None:
            return
        try:
            recorder.close()
        except OSError as error:
            self.failure = _reason(error, recorder)
        self.get_logger().info(f'{counted(sum(recorder.counts.values()), "message")} in {recorder.folder}')

    def destroy_node(self) -> None:
        """End the recording, then the node."""
        self.end()
        super().destroy_node()

    def _on_record(self, request: Any, response: Any) -> Any:
        try:
            if request.data and self.recorder is None:
                self.begin()
            elif not request.data:
                folder = self.recorder.folder if self.recorder else None
                self.end()
                response.message = f'recorded: {folder}' if folder else 'not recording'
            response.success = not self.failure
            response.message = self.failure or response.message
        except (ValueError, OSError) as error:
            response.success, response.message = False, str(error)
        if self.recorder:
            response.message = str(self.recorder.folder)
        self._report()
        return response

    def _configure(self, params: RecorderParams) -> None:
        if self.recorder:
            self.recorder.about['note'] = params.note

    def _look(self) -> None:
        """Listen to each topic as its publishers offer it; ask for parameters."""
        if self.recorder is None:
            return
        types = dict(self.get_topic_names_and_types())
        for name, topic in self._wanted.items():
            kind = topic.type or next(iter(types.get(name, ())), '')
            if kind and name not in self._heard:
                self._heard[name] = _Heard(name, topic._replace(type=kind))
        for heard in list(self._heard.values()):
            offers = self._offers(heard)
            if heard.ears and (heard.ears[-1].hears or not offers):
                self._close(heard.ears[:-1])
                del heard.ears[:-1]
            self._listen(heard, offers)
        for node, (client, names) in self._questions.items():
            late = time.monotonic() - self._asked.get(node, 0.0) > ASK_AGAIN_SECONDS
            if node not in self._told and late and client.service_is_ready():
                self._asked[node] = time.monotonic()
                client.call_async(GetParameters.Request(names=names)).add_done_callback(
                    partial(self._on_parameters, node, names)
                )

    def _offers(self, heard: '_Heard') -> set['_Offer']:
        """What the publishers of a topic offer now."""
        return {
            _Offer(
                end.qos_profile.reliability == ReliabilityPolicy.RELIABLE,
                end.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
            )
            for end in self.get_publishers_info_by_topic(heard.stream.name)
        }

    def _listen(self, heard: '_Heard', offers: set['_Offer']) -> None:
        """Listen so that all publishers match: reliably where all are, and to what was said before where all keep it.

        While there is none, best effort hears whoever comes; only what is declared latched is awaited as that. A new
        subscription takes over once it hears: until then both listen, and nothing is lost between them.
        """
        latched = heard.topic.latched
        if not (heard.ears and offers <= heard.offered):
            heard.offered |= offers
            qos = [offered_qos(*offer, heard.topic.depth) for offer in sorted(heard.offered) or [_Offer(True, latched)]]
            try:
                if self.recorder:
                    self.recorder.add_topic(heard.stream.name, heard.stream.type, qos)
            except ValueError as error:
                self.get_logger().warning(str(error))
                del self._wanted[heard.stream.name], self._heard[heard.stream.name]
                return
        asked = _Offer(*map(all, zip(*offers, strict=True))) if offers else _Offer(latched, latched)
        if heard.ears and heard.ears[-1].asked == asked:
            return
        ear = _Ear(asked)
        ear.subscription = self.create_subscription(
            message_type(heard.topic),
            heard.stream.name,
            lambda data, info: self._on_message(heard, ear, data, info),
            QoSProfile(
                depth=max(heard.topic.depth, SAMPLE_DEPTH),
                reliability=ReliabilityPolicy.RELIABLE if asked.reliable else ReliabilityPolicy.BEST_EFFORT,
                durability=DurabilityPolicy.TRANSIENT_LOCAL if asked.latched else DurabilityPolicy.VOLATILE,
            ),
            raw=True,
        )
        heard.ears.append(ear)

    def _close(self, ears: list['_Ear']) -> None:
        for ear in ears:
            self.destroy_subscription(ear.subscription)

    def _on_message(self, heard: '_Heard', ear: '_Ear', data: bytes, info: Any) -> None:
        ear.hears = True
        if self.recorder is None or not heard.is_new(info):
            return
        if not self.recorder.counts[heard.stream]:  # the file names with the first message what is offered
            self._listen(heard, self._offers(heard))
        self.recorder.write(heard.stream, data)

    def _on_parameters(self, node: str, names: list[str], answer: Any) -> None:
        """Keep a node's parameters, as a file that the suite reads and beside the recording's other metadata."""
        response = answer.result()
        if self.recorder is None or response is None or len(response.values) != len(names):
            return
        values = zip(names, map(parameter_value_to_python, response.values), strict=True)
        self._told[node] = {
            'ros__parameters': {
                name: list(value) if isinstance(value, (array, tuple)) else value
                for name, value in values
                if value == value
            }
        }  # NaN: derived from others
        space = self.get_namespace().rstrip('/')  # nodes take parameters only under their whole name
        text = yaml_text({f'{space}/{name}' if space else name: values for name, values in self._told.items()})
        self.recorder.about['parameters'] = text
        try:
            write_whole(self.recorder.folder / PARAMETERS, text)
        except OSError as error:
            self._fail(error)

    def _flush(self) -> None:
        if self.recorder:
            try:
                self.recorder.flush()
            except OSError as error:
                self._fail(error)

    def _fail(self, error: OSError) -> None:
        """End a recording that cannot go on, and keep what it has."""
        recorder, self.recorder = self.recorder, None
        if recorder:
            self.failure = _reason(error, recorder)
            recorder.abort()
            self.end()
            self._report()
            self.get_logger().error(self.failure)

    def _diagnose(self) -> Diagnosis:
        recorder = self.recorder
        if self.failure:
            return Diagnosis(Level.ERROR, self.failure, {STATE: RecorderState.FAILED})
        if recorder is None:
            return Diagnosis(Level.OK, 'not recording', {STATE: RecorderState.IDLE})
        return Diagnosis(
            Level.OK,
            f'recording to {recorder.folder}',
            {
                STATE: RecorderState.RECORDING,
                'folder': str(recorder.folder),
                'size [MB]': recorder.size / 1e6,
                **{parameters_of(node): True for node in self._told},
                **{messages_of(topic.name): count for topic, count in recorder.counts.items()},
            },
        )


class _Offer(NamedTuple):
    """How a topic is published, or listened to."""

    reliable: bool
    latched: bool


class _Ear:
    """A subscription: what it asks for, and whether a message has come by it."""

    def __init__(self, asked: _Offer) -> None:
        self.asked = asked
        self.hears = False
        self.subscription: Any = None


class _Heard:
    """A topic that is listened to."""

    def __init__(self, name: str, topic: Topic) -> None:
        self.topic, self.stream = topic, Stream(name, topic.type)
        self.offered: set[_Offer] = set()
        """All that its publishers have offered so far."""
        self.ears: list[_Ear] = []
        """The last one stays."""
        self._known: OrderedDict[tuple[int, int], None] = OrderedDict()

    def is_new(self, info: dict[str, int]) -> bool:
        """Whether the message, of which rclpy's MessageInfo tells, has not come by another subscription before."""
        key = info['source_timestamp'], info['publication_sequence_number']
        if key in self._known:
            return False
        self._known[key] = None
        if len(self._known) > REMEMBERED:
            self._known.popitem(last=False)
        return True


def _reason(error: OSError, recorder: Recorder) -> str:
    return f'the recording ended: {error.strerror}: {recorder.folder}; what came before is kept'


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run(RECORDER.name, RecorderNode, args)


if __name__ == '__main__':
    sys.exit(main())

"""The node `recorder` beside publishers that come, go and offer what they like: all are heard, nothing comes twice."""

from pathlib import Path

import pytest
import yaml
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from dcdrw.recordings.bag_file import Stream
from dcdrw.recordings.recording import Recording
from dcdrw_msgs_py.diagnosis import messages_of
from dcdrw_msgs_py.messages import to_stamp
from dcdrw_msgs_py.topics import CLOCK, DIAGNOSTICS, JOINT_STATES
from tests.bags import JOINTS, TYPES
from tests.dcdrw.recordings.test_recorder import said

pytestmark = pytest.mark.processes

RELIABLE = QoSProfile(depth=1000)
FEW = 100
"""What nobody confirms may be lost: so many messages wait in any socket, also where the recorder is not let run."""
NOTES = Stream('/notes', 'std_msgs/msg/String')


class Source:
    """Sends joint states with growing stamps, and is told of every subscription that its offer does not match."""

    def __init__(self, bench, qos: QoSProfile, first: int) -> None:
        self.bench, self.next, self.mismatches = bench, first, []
        events = PublisherEventCallbacks(incompatible_qos=self.mismatches.append)
        self.publisher = bench.node.create_publisher(JointState, JOINT_STATES.name, qos, event_callbacks=events)
        self.sent: list[int] = []

    def send(self) -> None:
        message = JointState(name=['front_wheel', 'rear_wheel'], position=[1.0, 2.0], velocity=[0.5, 0.5])
        message.header.stamp = to_stamp(self.next)
        self.publisher.publish(message)
        self.sent.append(self.next)
        self.next += 1
        self.bench.executor.spin_once(timeout_sec=0.001)

    def send_until(self, condition, what: str) -> None:
        def holds() -> bool:
            self.send()
            return condition()

        self.bench.wait(holds, what)

    def leave(self) -> None:
        self.bench.node.destroy_publisher(self.publisher)


def asked(bench, topic: str = JOINT_STATES.name) -> list[tuple[str, str]]:
    """What the recorder's subscriptions to a topic ask for."""
    ends = bench.node.get_subscriptions_info_by_topic(f'/{topic.lstrip("/")}')
    profiles = [end.qos_profile for end in ends if end.node_name == 'recorder']
    return [(profile.reliability.name, profile.durability.name) for profile in profiles]


def listens(bench, reliability: str, durability: str = 'VOLATILE', topic: str = JOINT_STATES.name):
    """A condition: the recorder has one subscription to a topic, of this kind."""
    return lambda: asked(bench, topic) == [(reliability, durability)]


def kept(diagnostics) -> int:
    """How many joint states the recorder says that it has."""
    return int(said(diagnostics).get(messages_of('/joint_states'), 0))


def offered(path: Path) -> dict[str, list[str]]:
    """What the topics of a recording offer, by its metadata."""
    metadata = yaml.safe_load((path / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    return {
        topic['topic_metadata']['name']: [
            profile['reliability'] for profile in topic['topic_metadata']['offered_qos_profiles']
        ]
        for topic in metadata['topics_with_message_count']
    }


def recorded(path: Path) -> list[int]:
    with Recording(path) as recording:
        return [stamp for batch in recording.joints(JOINTS) for stamp in batch.stamp_ns.tolist()]


def test_best_effort_publisher_that_comes_later_matches_at_once(bench, tmp_path):
    recorder = bench.start('recorder', '-p', f'folder:={tmp_path}/bag', record=True)
    bench.wait(lambda: asked(bench) and asked(bench, CLOCK.name), 'the recorder')
    clock = bench.node.create_publisher(
        Clock, CLOCK.name, QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    )
    source, diagnostics = Source(bench, qos_profile_sensor_data, 1), bench.hear(DIAGNOSTICS)

    def is_heard() -> bool:
        clock.publish(Clock(clock=to_stamp(source.next)))
        return kept(diagnostics) > 0

    source.send_until(is_heard, 'a recorded message')
    for _ in range(FEW):
        source.send()
    assert listens(bench, 'BEST_EFFORT')()
    bench.spin(0.5)
    assert bench.end(recorder) == 0
    stamps = recorded(tmp_path / 'bag')
    assert stamps == source.sent[-len(stamps) :]
    assert len(stamps) > FEW
    assert not source.mismatches
    assert 'incompatible' not in bench.output('recorder')
    told = offered(tmp_path / 'bag')
    assert (told['/clock'], told['/joint_states']) == (['best_effort'], ['best_effort'])


def test_reliable_publisher_is_heard_whole_and_once_while_the_recorder_adapts(bench, tmp_path):
    recorder = bench.start('recorder', '-p', f'folder:={tmp_path}/bag', record=True)
    bench.wait(listens(bench, 'BEST_EFFORT'), 'the recorder')
    source = Source(bench, RELIABLE, 1)
    bench.wait(source.publisher.get_subscription_count, 'a listener')
    source.send_until(listens(bench, 'RELIABLE'), 'a reliable subscription alone')
    for _ in range(3000):
        source.send()
    bench.spin(0.5)
    assert bench.end(recorder) == 0
    stamps = recorded(tmp_path / 'bag')
    assert len(stamps) >= 3000
    assert stamps == source.sent[-len(stamps) :]
    assert offered(tmp_path / 'bag')['/joint_states'] == ['reliable']


def test_one_source_after_the_other_is_heard_whatever_each_offers(bench, tmp_path):
    recorder = bench.start('recorder', '-p', f'folder:={tmp_path}/bag', record=True)
    sent, mismatches, diagnostics = [], [], bench.hear(DIAGNOSTICS)
    for number, (qos, reliability) in enumerate(
        [(RELIABLE, 'RELIABLE'), (qos_profile_sensor_data, 'BEST_EFFORT'), (RELIABLE, 'RELIABLE')]
    ):
        bench.wait(listens(bench, 'BEST_EFFORT'), 'a subscription that any source matches')
        source, before = Source(bench, qos, 10**6 * (number + 1)), kept(diagnostics)
        source.send_until(lambda before=before: kept(diagnostics) > before, 'a recorded message')
        source.send_until(listens(bench, reliability), f'a {reliability} subscription alone')
        source.sent.clear()
        for _ in range(FEW):
            source.send()
        bench.spin(0.5)
        sent += source.sent
        mismatches += source.mismatches
        source.leave()
    assert bench.end(recorder) == 0
    stamps = recorded(tmp_path / 'bag')
    assert set(sent) <= set(stamps)
    assert len(set(stamps)) == len(stamps)
    assert not mismatches
    assert offered(tmp_path / 'bag')['/joint_states'] == ['best_effort', 'reliable']


def test_what_a_latched_topic_keeps_is_recorded_whole_and_once(bench, tmp_path):
    latched = QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    early = bench.node.create_publisher(String, 'notes', latched)
    for word in ('one', 'two', 'three'):
        early.publish(String(data=word))
    recorder = bench.start('recorder', '-p', f'folder:={tmp_path}/bag', record=True, topics='notes:std_msgs/msg/String')
    hears_whole = listens(bench, 'RELIABLE', 'TRANSIENT_LOCAL', 'notes')
    bench.wait(hears_whole, 'a subscription that hears what was said before')
    volatile = bench.node.create_publisher(String, 'notes', QoSProfile(depth=5))
    bench.wait(volatile.get_subscription_count, 'a subscription that hears both')
    volatile.publish(String(data='four'))
    bench.wait(lambda: volatile.wait_for_all_acked(Duration(seconds=0.1)), 'a confirmation')
    bench.node.destroy_publisher(volatile)
    early.publish(String(data='five'))
    bench.wait(hears_whole, 'a subscription that hears once more what was said before')
    bench.spin(0.5)
    assert bench.end(recorder) == 0
    with Recording(tmp_path / 'bag') as recording:
        words = [TYPES.deserialize_cdr(message.data, NOTES.type).data for message in recording.messages([NOTES])]
    assert sorted(words) == ['five', 'four', 'one', 'three', 'two']

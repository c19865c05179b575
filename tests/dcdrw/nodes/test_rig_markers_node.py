"""The node `rig_markers` over DDS. The drawing's truths are in tests/cli/test_rig_markers.py."""

import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker

from dcdrw_msgs_py.messages import JointSampleWriter, stamp_ns
from dcdrw_msgs_py.samples import CouplerSample, JointSample, Turn
from dcdrw_msgs_py.topics import DIAGNOSTICS, JOINT_STATES, LEG_PHASES, PERSON_FORCE, RIG_MARKERS
from tests.bench import Bench

pytestmark = pytest.mark.processes

MILLISECOND = 1_000_000
SPEED = 1.0


class Source:
    """Both wheels turn at SPEED: one sample per call, 10 ms of the rig on."""

    def __init__(self, bench: Bench) -> None:
        self.bench, self.writer = bench, JointSampleWriter()
        self.publisher = bench.publisher(JOINT_STATES)
        self.start_ns, self.count = 1_000 * MILLISECOND, 0

    def restart(self) -> None:
        """Begin anew at an earlier time: samples that come again as they were would be taken for the same."""
        self.count, self.start_ns = 0, self.start_ns - 500 * MILLISECOND

    def send(self) -> int:
        angle = SPEED * 0.01 * self.count
        stamp = self.start_ns + self.count * 10 * MILLISECOND
        self.count += 1
        self.publisher.publish(
            self.writer.write(
                JointSample(stamp, Turn(angle, SPEED), Turn(angle - 0.2, SPEED), CouplerSample(1.2, 0.0, 3.0))
            )
        )
        self.bench.spin(0.005)
        return stamp

    def until(self, condition, what: str):
        def done():
            self.send()
            return condition()

        return self.bench.wait(done, what)


def label(message) -> str:
    return next(marker.text for marker in message.markers if marker.ns == 'label')


def starts_afresh(message) -> bool:
    return message.markers[0].action == Marker.DELETEALL


def test_a_sample_becomes_markers_that_take_each_others_place(bench):
    bench.start('rig_markers', frame='lab', front__length=0.5, rear__length=0.4)
    drawings, source = bench.hear(RIG_MARKERS), Source(bench)
    source.until(lambda: len(drawings) >= 20 and len(drawings[-1].markers) >= 9, 'drawings with footfalls')
    first_stamp, step = source.start_ns, 10 * MILLISECOND
    for message in drawings:
        (stamp,) = {stamp_ns(marker.header.stamp) for marker in message.markers}  # the sample's own
        assert (stamp - first_stamp) % step == 0
        assert {marker.header.frame_id for marker in message.markers} == {'lab'}
        added = [marker for marker in message.markers if marker.action == Marker.ADD]
        assert len({(marker.ns, marker.id) for marker in added}) == len(added)
        assert all(marker.lifetime.sec > 0 for marker in added)
    assert {marker.ns for marker in drawings[-1].markers} == {
        'slope',
        'coupler',
        'label',
        *(f'{wheel}_{part}' for wheel in ('front', 'rear') for part in ('wheel', 'stance_leg', 'footfalls')),
    }
    assert [starts_afresh(message) for message in drawings[1:]].count(True) == 0  # only the first, which may be missed
    leg = next(marker for marker in drawings[-1].markers if marker.ns == 'rear_stance_leg')
    assert leg.type == Marker.LINE_LIST
    assert [(point.x, point.z) for point in leg.points] == [(0.0, 0.0), (0.0, -0.4)]


def test_it_draws_no_more_often_than_asked(bench):
    bench.start('rig_markers', redraw_rate=10)
    drawings, source = bench.hear(RIG_MARKERS), Source(bench)
    source.until(lambda: drawings, 'a drawing')
    began, before = time.monotonic(), len(drawings)
    source.until(lambda: len(drawings) >= before + 15, 'drawings')
    assert time.monotonic() - began > 1.0  # 15 at 10 Hz; one that was late and the next lie closer


def test_it_says_what_the_monitor_says_and_that_data_have_ended(bench):
    bench.start('rig_markers')
    drawings, source = bench.hear(RIG_MARKERS), Source(bench)
    diagnostics = bench.publisher(DIAGNOSTICS)
    status = [
        DiagnosticStatus(name='other', level=b'\x02', message='boo'),
        DiagnosticStatus(name='sync_monitor', level=b'\x01', message='slipped a step: n = 2'),
    ]

    def said():
        diagnostics.publish(DiagnosticArray(status=status))
        return drawings and label(drawings[-1]).endswith('\nslipped a step: n = 2')

    source.until(said, 'what the monitor says')
    bench.wait(lambda: 'no data for' in label(drawings[-1]), 'the word that nothing comes')
    assert 'boo' not in label(drawings[-1])


def test_its_health_is_told_in_the_group_of_the_suite(bench):
    bench.start('rig_markers')
    told = bench.hear(DIAGNOSTICS)
    bench.wait(lambda: told, 'diagnostics')
    (status,) = told[0].status
    assert (status.name, status.hardware_id, status.level, status.message) == (
        'rig_markers',
        'dcdrw',
        DiagnosticStatus.STALE,
        'no data yet',
    )
    source = Source(bench)
    source.until(lambda: told[-1].status[0].level == DiagnosticStatus.OK, 'the word that it draws')


def test_a_source_that_starts_anew_clears_what_was_drawn(bench):
    bench.start('rig_markers')
    drawings, source = bench.hear(RIG_MARKERS), Source(bench)
    source.until(lambda: len(drawings) > 10, 'drawings')
    source.restart()
    count = len(drawings)
    source.until(lambda: any(starts_afresh(message) for message in drawings[count:]), 'a clear start')


def test_the_frame_can_be_made_to_stay(bench):
    bench.start('rig_markers')
    drawings, source = bench.hear(RIG_MARKERS), Source(bench)
    source.until(lambda: drawings, 'a drawing')
    stay = Parameter(name='follow', value=ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=False))
    assert (
        bench.call(SetParameters, '/rig_markers/set_parameters', SetParameters.Request(parameters=[stay]))
        .results[0]
        .successful
    )

    def far():
        leg = next(marker for marker in drawings[-1].markers if marker.ns == 'rear_stance_leg')
        return leg.pose.position.x > 1.0

    source.until(far, 'the rig away from its frame')


def test_a_force_on_the_person_that_is_told_no_more_goes_though_the_legs_go_on(bench):
    bench.start('rig_markers')
    drawings, source = bench.hear(RIG_MARKERS), Source(bench)
    forces, legs = bench.publisher(PERSON_FORCE), bench.publisher(LEG_PHASES)
    wrench = WrenchStamped()
    wrench.wrench.force.x = 12.0

    def shown(told: bool) -> bool:
        legs.publish(JointState())
        if told:
            forces.publish(wrench)
        last = drawings[-1].markers if drawings else []
        return any(marker.ns == 'person_force' and marker.action == Marker.ADD for marker in last) and (
            'on the person +12.0 N' in label(drawings[-1])
        )

    source.until(lambda: shown(True), 'the force')
    count = len(drawings)
    source.until(lambda: not shown(False), 'its end')
    assert 'on the person' not in label(drawings[-1])
    actions = [
        marker.action for message in drawings[count:] for marker in message.markers if marker.ns == 'person_force'
    ]
    assert actions[-1] == Marker.DELETE

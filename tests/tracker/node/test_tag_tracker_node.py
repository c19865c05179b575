"""The node `tag_tracker` over DDS. The core's truths are in tests/tracker."""

import math
import re
from array import array
from itertools import pairwise

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import CompressedImage

from dcdrw_msgs_py.camera import pinhole, write_camera
from dcdrw_msgs_py.frame import Frame
from dcdrw_msgs_py.image_messages import camera_message, frame, image_message
from dcdrw_msgs_py.messages import JointSampleReader, stamp_ns, to_stamp
from dcdrw_msgs_py.opencv import opencv, tag_cells
from dcdrw_msgs_py.topics import (
    CAMERA_INFO,
    DEBUG_IMAGE,
    DIAGNOSTICS,
    FRONT_POSE,
    IMAGE_COMPRESSED,
    IMAGE_RAW,
    JOINT_STATES,
    REAR_POSE,
    RUNS,
    TAG_DETECTIONS,
)
from tests.bench import Bench
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

CAMERA = pinhole(640, 360, 60.0)
PERIOD_NS = 33_333_333
SPEED = 0.5


def picture(turned=0.0, tags=(0, 1)) -> np.ndarray:
    """Both wheels' tags face-on, 64 px, turned counter-clockwise: a wheel that rolls downhill by as much."""
    cv2 = opencv()
    image = np.full((360, 640), 110, np.uint8)
    for tag, x in zip(tags, (160, 480, 320), strict=False):
        cells = np.pad(tag_cells('36h11', tag), 1, constant_values=True)
        texture = np.kron(np.where(cells, 230, 25), np.ones((8, 8))).astype(np.uint8)
        affine = cv2.getRotationMatrix2D((39.5, 39.5), math.degrees(turned), 1.0)
        affine[:, 2] += x - 39.5, 180 - 39.5
        cv2.warpAffine(texture, affine, (640, 360), image, cv2.INTER_LINEAR, cv2.BORDER_TRANSPARENT)
    return image


def said(diagnostics) -> tuple[int, str]:
    own = [m.status[0] for m in diagnostics if m.status[0].name == 'tag_tracker']
    return (own[-1].level[0], own[-1].message) if own else (-1, '')


class Filming:
    """A camera that films turning wheels."""

    def __init__(self, bench: Bench, info=True) -> None:
        self.bench = bench
        self.images = bench.publisher(IMAGE_RAW)
        self.infos = bench.publisher(CAMERA_INFO)
        self.camera = CAMERA if info else None
        self.start_ns = bench.node.get_clock().now().nanoseconds
        self.count = 0

    def turned(self, stamp: int) -> float:
        return SPEED * (stamp - self.start_ns) * 1e-9

    def shoot(self, tags=(0, 1), turned=None, spoil=lambda message: message) -> int:
        stamp = self.start_ns + self.count * PERIOD_NS
        self.count += 1
        if self.camera:
            self.infos.publish(camera_message(self.camera, stamp))
        image = picture(self.turned(stamp) if turned is None else turned, tags)
        self.images.publish(spoil(image_message(Frame(stamp, image), 'lens')))
        self.bench.spin(0.02)
        return stamp

    def until(self, condition, what, **shot):
        def shot_and_met():
            self.shoot(**shot)
            return condition()

        self.bench.wait(shot_and_met, what)


def test_pictures_become_joint_states_detections_and_a_debug_image(bench):
    bench.start('tag_tracker', slope=0.0)
    runs, joints, detections = bench.hear(RUNS), bench.hear(JOINT_STATES), bench.hear(TAG_DETECTIONS)
    filming = Filming(bench)
    filming.until(lambda: len(joints) >= 30 and runs, 'thirty joint states')
    read = JointSampleReader()
    for header in runs:
        read.runs.announce(stamp_ns(header.stamp), header.frame_id)
    samples = [read.read(message) for message in joints]
    for before, after in pairwise(samples):  # unless a busy machine lost the pictures of more than a quarter turn
        assert before.run == after.run or SPEED * (after.stamp_ns - before.stamp_ns) * 1e-9 > math.pi / 2
    assert samples[0].run > 0
    for sample in samples:
        for turn in (sample.front, sample.rear):
            assert math.remainder(turn.angle - filming.turned(sample.stamp_ns), math.tau) == pytest.approx(0, abs=0.01)
    assert samples[-1].front.rate == pytest.approx(SPEED, abs=0.2)
    bench.wait(lambda: len(detections) >= 60, 'detections')
    assert {(mark.ns, mark.id) for mark in detections} == {('front', 0), ('rear', 1)}
    assert detections[0].header.frame_id == 'lens'
    centre = np.mean([(point.x, point.y) for point in detections[0].points], axis=0)
    assert centre == pytest.approx((160, 180) if detections[0].id == 0 else (480, 180), abs=0.5)

    debug = bench.hear(DEBUG_IMAGE)
    filming.until(lambda: debug, 'a debug image')
    drawn = frame(debug[-1])
    assert drawn.image.shape == (360, 640, 3)
    assert (drawn.image != picture(filming.turned(drawn.stamp_ns))[..., None]).any()


def test_each_trouble_has_one_message_and_tracking_goes_on_after_it(bench):
    bench.start('tag_tracker', slope=0.0, camera_follows=True)  # the wheels turn in their places
    joints, diagnostics = bench.hear(JOINT_STATES), bench.hear(DIAGNOSTICS)
    bench.wait(lambda: said(diagnostics) == (3, 'nobody publishes /image_raw'), 'a word on the missing camera')
    filming = Filming(bench, info=False)

    def expect(level, message, **shot):
        filming.until(lambda: said(diagnostics)[0] == level and message in said(diagnostics)[1], message, **shot)

    def encoded(message):
        message.encoding = 'sepia'
        return message

    expect(2, 'no camera_info has come')
    filming.camera = CAMERA._replace(matrix=np.zeros((3, 3)))
    expect(2, 'calibrate the camera first')
    filming.camera = pinhole(1280, 720, 60.0)
    expect(2, 'the picture is 640x360, but the camera is calibrated for 1280x720')
    filming.camera = CAMERA
    expect(2, "the encoding 'sepia' is not read", spoil=encoded)
    assert not joints
    expect(1, 'no tag is seen; looking for tags 0, 1', tags=())
    expect(1, 'the rear wheel has never been seen; looking for tag 1', tags=(0,))
    expect(1, 'tag 1 is in the picture twice', tags=(0, 1, 1))
    expect(0, 'tracking both wheels')
    filming.until(lambda: joints, 'joint states')
    before = JointSampleReader().read(joints[-1])
    expect(2, "the encoding 'sepia' is not read", spoil=encoded)
    count = len(joints)
    expect(0, 'tracking both wheels')
    filming.until(lambda: len(joints) > count + 3, 'joint states after the trouble')
    after = JointSampleReader().read(joints[-1])
    assert after.front.angle - before.front.angle == pytest.approx(
        SPEED * (after.stamp_ns - before.stamp_ns) * 1e-9, abs=0.02
    )
    lines = bench.output('tag_tracker').splitlines()
    for message in ('no camera_info has come', 'calibrated for', 'no tag is seen', 'rear wheel has never been seen'):
        assert any(message in line for line in lines)
    told = [line.rpartition('[tag_tracker]: ')[2] for line in lines]
    assert all(one != other for one, other in pairwise(told))  # not one per frame
    assert 'Traceback' not in bench.output('tag_tracker')


def test_compressed_pictures_follow_the_remapped_name(bench):
    cv2 = opencv()
    bench.start('tag_tracker', '-r', 'image_raw:=/lab/left/image', slope=0.0, image_transport='compressed')
    joints = bench.hear(JOINT_STATES)
    images = bench.publisher(IMAGE_COMPRESSED._replace(name='/lab/left/image/compressed'))
    infos = bench.publisher(CAMERA_INFO)
    start = bench.node.get_clock().now().nanoseconds
    count = 0

    def shot():
        nonlocal count
        stamp, image = start + count * PERIOD_NS, picture(SPEED * count * PERIOD_NS * 1e-9)
        count += 1
        infos.publish(camera_message(CAMERA, stamp))
        message = CompressedImage(format='jpeg')
        message.header.stamp = to_stamp(stamp)
        message.data = array('B', cv2.imencode('.jpg', image)[1].tobytes())
        images.publish(message)
        bench.spin(0.02)
        return len(joints) >= 5

    bench.wait(shot, 'joint states')


def test_a_parameter_takes_effect_or_is_refused_while_it_runs(bench):
    bench.start('tag_tracker', slope=0.0)
    joints = bench.hear(JOINT_STATES)
    filming = Filming(bench)
    filming.until(lambda: joints, 'a joint state', turned=0.3)

    def setting(name, value):
        return Parameter(name=name, value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value))

    def set_(name, value):
        request = SetParameters.Request(parameters=[setting(name, value)])
        return bench.call(SetParameters, '/tag_tracker/set_parameters', request).results[0]

    assert set_('slope', 0.02).successful
    filming.until(lambda: abs(joints[-1].position[0] - 0.28) < 0.002, 'the rotation from another normal', turned=0.3)
    refused = set_('max_jump_deg', 90.0)
    assert not refused.successful
    assert 'max_jump_deg out of range' in refused.reason


def write_film(bench: Bench, count: int) -> str:
    """A video of turning wheels, and the file of its camera beside it; returns its path."""
    cv2, path = opencv(), bench.folder / 'film.avi'
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*'MJPG'), 60.0, (640, 360))
    for index in range(count):
        writer.write(cv2.cvtColor(picture(SPEED * index / 60.0), cv2.COLOR_GRAY2BGR))
    writer.release()
    write_camera(bench.folder / 'camera.yaml', CAMERA)
    return str(path)


@pytest.mark.parametrize('truncated', [False, True])
def test_a_video_file_is_tracked_whole_and_its_end_is_told(bench, truncated):
    film = write_film(bench, 90)
    if truncated:
        data = (bench.folder / 'film.avi').read_bytes()
        (bench.folder / 'film.avi').write_bytes(data[: len(data) * 6 // 10])
    joints, diagnostics = bench.hear(JOINT_STATES), bench.hear(DIAGNOSTICS)
    settings = bench.folder / 'film.yaml'  # paths have capitals, which the bench's own parameters lose
    settings.write_text(f'/**: {{ros__parameters: {{source: {film}, camera: {bench.folder / "camera.yaml"}}}}}')
    process = bench.start('tag_tracker', '--params-file', str(settings))
    if truncated:
        bench.wait(lambda: re.search(r'ends after \d+ of 90 frames: it is truncated', said(diagnostics)[1]), 'the end')
        assert said(diagnostics)[0] == 2
        assert len(joints) > 20
    else:
        bench.wait(lambda: said(diagnostics) == (3, 'the video has ended after 90 frames'), 'the end')
        own = [m.status[0] for m in diagnostics if m.status[0].name == 'tag_tracker'][-1]
        values = {pair.key: pair.value for pair in own.values}
        assert values['frames'] == '90'
        assert values['frames with both wheels'] == '88'
        stamps = [stamp_ns(message.header.stamp) for message in joints]
        assert len(stamps) > 60  # it waits for the first subscriber
        assert np.diff(stamps) == pytest.approx(1e9 / 60, abs=1e6)
    assert process.poll() is None
    assert bench.end(process) == 0


def test_a_camera_that_is_not_there_is_looked_for(bench):
    write_camera(bench.folder / 'camera.yaml', CAMERA)
    settings = bench.folder / 'device.yaml'
    settings.write_text(f'/**: {{ros__parameters: {{source: /dev/video99, camera: {bench.folder / "camera.yaml"}}}}}')
    diagnostics = bench.hear(DIAGNOSTICS)
    process = bench.start('tag_tracker', '--params-file', str(settings))
    bench.wait(
        lambda: said(diagnostics) == (2, 'there is no camera at /dev/video99; it is looked for every 1 s'),
        'a word on it',
    )
    assert bench.end(process) == 0


@pytest.mark.parametrize(
    ('settings', 'message'),
    [
        ({'source': 'trial.mp4'}, 'the source trial.mp4 needs the parameter camera: the camera_info file'),
        ({'camera': '/nowhere.yaml'}, "camera: [Errno 2] No such file or directory: '/nowhere.yaml'"),
        ({'detector': 'eyes'}, "detector must be aruco or apriltag, got 'eyes'"),
        ({'rear__ids': '[0]'}, 'rear.ids: tag 0 is mounted twice'),
    ],
)
def test_what_cannot_work_ends_it_with_one_line(bench, settings, message):
    process = bench.start('tag_tracker', **settings)
    assert process.wait(PATIENCE) == 2
    (line,) = bench.output('tag_tracker').splitlines()
    assert line.startswith(f'tag_tracker: {message}')


def test_motion_capture_takes_the_cameras_place(bench):
    bench.start('tag_tracker', source='poses', slope=0.0)
    joints = bench.hear(JOINT_STATES)
    publishers = [(bench.publisher(topic), x) for topic, x in ((FRONT_POSE, 2.0), (REAR_POSE, 1.0))]
    start = bench.node.get_clock().now().nanoseconds
    count = 0

    def sent():
        nonlocal count
        stamp = start + count * 10_000_000
        count += 1
        half = 0.5 * SPEED * (stamp - start) * 1e-9
        for publisher, x in publishers:
            message = PoseStamped()
            message.header.stamp = to_stamp(stamp)
            message.pose.position.x = x
            message.pose.orientation.y, message.pose.orientation.w = math.sin(half), math.cos(half)
            publisher.publish(message)
        bench.spin(0.005)
        return len(joints) >= 50

    bench.wait(sent, 'fifty joint states')
    for message in joints:
        turned = SPEED * (stamp_ns(message.header.stamp) - start) * 1e-9
        assert list(message.position[:2]) == pytest.approx([turned, turned], abs=1e-6)

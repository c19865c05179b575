"""The node `virtual_camera`: joint states in, pictures out."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

from dcdrw_msgs_py.image_messages import camera, frame
from dcdrw_msgs_py.messages import JointSampleWriter
from dcdrw_msgs_py.samples import JointSample, Turn
from dcdrw_msgs_py.tagging import TagParams
from dcdrw_msgs_py.topics import CAMERA_INFO, DIAGNOSTICS, IMAGE_RAW, JOINT_STATES
from dcdrw_sim.camera.render import LookParams, Renderer
from dcdrw_sim.camera.scene import Footing, SceneParams, ViewParams
from tests import ROOT
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

pytest.importorskip('cv2')
SMALL = {'image_width': 320, 'image_height': 180}
SECOND = 1_000_000_000
START_NS = 100 * SECOND


def joints(t: float) -> JointSample:
    return JointSample(START_NS + round(t * SECOND), Turn(t, 1.0), Turn(0.2 + 0.9 * t, 0.9))


class Film:
    """Turns the wheels for a camera, a sample each millisecond, and takes what it films."""

    def __init__(self, bench, **parameters):
        self.bench = bench
        self.process = bench.start('virtual_camera', **parameters)
        self.images, self.infos = bench.hear(IMAGE_RAW), bench.hear(CAMERA_INFO)
        self._joints = bench.publisher(JOINT_STATES)
        bench.wait(lambda: bench.node.count_publishers(IMAGE_RAW.name), 'the camera')
        self._writer, self._k = JointSampleWriter(), 0

    def roll(self, samples: int = 20) -> None:
        for _ in range(samples):
            self._joints.publish(self._writer.write(joints(self._k / 1000)))
            self._k += 1
        self.bench.spin(0.02)

    @property
    def rolled(self) -> int:
        return self._k

    @property
    def last_ns(self) -> int:
        return joints((self._k - 1) / 1000).stamp_ns

    def roll_until(self, condition, what):
        def rolled():
            self.roll()
            return condition()

        return self.bench.wait(rolled, what)


@pytest.mark.parametrize('encoding', ['mono8', 'bgr8'])
def test_each_picture_shows_the_joints_at_its_stamp(bench, encoding):
    film = Film(bench, encoding=encoding, noise=0.0, frame_rate=50.0, k1=-0.2, frame_id='tripod', **SMALL)
    film.roll_until(lambda: len(film.images) >= 4 and len(film.infos) >= 4, 'pictures')
    view = ViewParams(k1=-0.2, **SMALL)
    renderer = Renderer(SceneParams(), view, LookParams(noise=0.0), TagParams(), view.make_camera(), encoding == 'bgr8')
    # The node may have missed the first samples, but counts the same steps: none is struck here.
    footing = Footing(SceneParams(), joints(0.0))
    begin = film.images[0].header.stamp
    for message in film.images[:4]:
        assert (message.encoding, message.width, message.height) == (encoding, 320, 180)
        assert message.header.frame_id == 'tripod'
        got = frame(message)
        apart = (got.stamp_ns - begin.sec * SECOND - begin.nanosec) / 1e6
        assert apart == pytest.approx(20.0 * round(apart / 20.0), abs=1e-3), 'frames come at their rate'
        expected = renderer.draw(footing, joints((got.stamp_ns - START_NS) / SECOND))
        assert int(np.abs(got.image.astype(int) - expected).max()) <= 2


def test_camera_info_agrees_with_the_pictures(bench):
    film = Film(bench, k1=-0.2, k2=0.05, field_of_view_deg=75.0, **SMALL)
    film.roll_until(lambda: len(film.images) >= 3 and len(film.infos) >= 3, 'pictures')
    stamps = [(m.header.stamp.sec, m.header.stamp.nanosec) for m in film.images]
    told = camera(film.infos[0])
    assert (film.infos[0].header.stamp.sec, film.infos[0].header.stamp.nanosec) in stamps
    assert film.infos[0].header.frame_id == film.images[0].header.frame_id == 'camera'
    assert (told.width, told.height) == (320, 180)
    assert told.distortion == pytest.approx((-0.2, 0.05, 0.0, 0.0, 0.0))
    assert told.matrix[0, 0] == pytest.approx(160.0 / math.tan(math.radians(37.5)))


def test_what_is_not_drawn_in_time_is_dropped_and_counted_and_nothing_queues(bench):
    film = Film(bench, frame_rate=1000.0, exposure=0.1, **SMALL)
    diagnostics = bench.hear(DIAGNOSTICS)
    film.roll_until(lambda: any('frames dropped' in m.status[0].message for m in diagnostics), 'a warning')
    values = {v.key: v.value for v in diagnostics[-1].status[0].values}
    assert int(values['frames dropped']) > 0
    assert int(values['frames drawn']) > 0

    def newest():
        film.roll(100)
        bench.spin(0.3)
        return frame(film.images[-1]).stamp_ns == film.last_ns

    bench.wait(newest, 'a picture of the last sample')
    assert len(film.images) < 0.5 * film.rolled


def test_view_and_light_change_while_it_runs_and_impossible_ones_are_refused(bench):
    film = Film(bench, noise=0.0, **SMALL)
    film.roll_until(lambda: film.images, 'pictures')

    def change(name, value):
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        return bench.call(SetParameters, '/virtual_camera/set_parameters', request).results[0]

    before = frame(film.images[-1]).image.mean()
    assert change('brightness', 0.5).successful
    film.roll_until(lambda: abs(frame(film.images[-1]).image.mean() / before - 0.5) < 0.02, 'darker pictures')
    assert change('pan_deg', 30.0).successful
    refused = change('occlude', 'everybody')
    assert not refused.successful
    assert 'occlude must be front, rear, both or empty' in refused.reason
    assert not change('image_width', 640).successful
    assert film.process.poll() is None


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        ({'encoding': 'rgb8'}, 'encoding must be mono8 or bgr8'),
        ({'camera': '/no/such/camera.yaml'}, '/no/such/camera.yaml'),
        ({'family': '99h9'}, 'family must be one of'),
        ({'occlude': 'left'}, 'occlude must be'),
    ],
)
def test_impossible_parameters_end_it_with_one_line(bench, parameters, message):
    process = bench.start('virtual_camera', **parameters)
    assert process.wait(PATIENCE) == 2
    lines = bench.output('virtual_camera').strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith('virtual_camera: ')
    assert message in lines[0]


def test_without_opencv_it_says_what_to_install(bench, tmp_path):
    (tmp_path / 'cv2.py').write_text("raise ImportError('hidden')\n")
    done = subprocess.run(
        [sys.executable, '-m', 'dcdrw_sim.camera.virtual_camera_node'],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
        timeout=PATIENCE,
        env={
            **os.environ,
            'PYTHONPATH': f'{tmp_path}:{os.environ.get("PYTHONPATH", "")}',
            'ROS_DOMAIN_ID': str(bench.domain),
        },
    )
    assert done.returncode == 2
    assert 'pictures need OpenCV' in done.stderr

"""The node `virtual_camera`: joint states in, pictures of the rig out, as a camera on its left would take them."""

import sys
from typing import Any

from rclpy.node import Node

from dcdrw_msgs_py.diagnosis import Diagnosis, Level
from dcdrw_msgs_py.frame import Frame
from dcdrw_msgs_py.image_messages import camera_message, image_message
from dcdrw_msgs_py.messages import JointSampleReader
from dcdrw_msgs_py.node import Age, Parameters, advertise, follow_runs, listen, publish_diagnosis, run, steady_clock
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.tagging import TagParams
from dcdrw_msgs_py.topics import CAMERA_INFO, IMAGE_RAW, JOINT_STATES
from dcdrw_msgs_py.words import counted
from dcdrw_sim.camera.render import LookParams, Renderer
from dcdrw_sim.camera.scene import Footing, SceneParams, ViewParams
from dcdrw_sim.camera.shutter import Shutter, ShutterParams

CHECKS_PER_FRAME = 4
"""How often to look for a frame that is due, so that it is drawn soon after."""
STALE_AFTER = 1.0
"""Without joint states for this long there is nothing to draw [s]."""
MANY_DROPPED = 0.05
"""More dropped frames than this fraction of the drawn ones are worth a warning."""
LARGEST_ROTATION = 1e9
"""Beyond this, and where it is not a number, a rotation is not a measurement [rad]."""


class VirtualCameraNode(Node):
    """Draws what the joints are when a frame is due; joint states themselves are only taken note of."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('virtual_camera', **kwargs)
        self._scene = Parameters(self, SceneParams, lambda _: self._outdate())
        self._view = Parameters(self, ViewParams, lambda _: self._outdate())
        self._look = Parameters(self, LookParams, lambda _: self._outdate(), LookParams.check_occluder)
        self._tags = Parameters(self, TagParams)
        params = Parameters(self, ShutterParams, validate=ShutterParams.check_encoding).value
        self._colour, self._frame_id = params.encoding == 'bgr8', params.frame_id
        try:
            self._camera = self._view.value.make_camera()
        except OSError as error:
            raise ValueError(f'camera: {error}') from None
        self._shutter = Shutter(params.frame_rate)
        self._renderer: Renderer | None = self._make_renderer()
        self._footing: Footing | None = None
        self._start_ns = 0
        self._age = Age()
        self._told = (0, 0)
        self._reader = JointSampleReader()
        self._images = advertise(self, IMAGE_RAW)
        self._infos = advertise(self, CAMERA_INFO)
        publish_diagnosis(self, self._diagnose)
        follow_runs(self, self._reader.runs)
        listen(self, JOINT_STATES, self._on_joints)
        self.create_timer(1.0 / (CHECKS_PER_FRAME * params.frame_rate), self._take_frame, clock=steady_clock())
        self.get_logger().info(
            f'waiting for joint_states, to draw {self._camera.width}x{self._camera.height} '
            f'{params.encoding} at {params.frame_rate:g} Hz'
        )

    def _make_renderer(self) -> Renderer:
        return Renderer(
            self._scene.value, self._view.value, self._look.value, self._tags.value, self._camera, self._colour
        )

    def _outdate(self) -> None:
        """Let the next frame be drawn by the changed parameters: several may change at once."""
        self._renderer = None

    def _on_joints(self, message: Any) -> None:
        try:
            joints = self._reader.read(message)
        except ValueError as error:
            self.get_logger().warning(f'joint_states: {error}', throttle_duration_sec=1.0)
            return
        if not abs(joints.front.angle) + abs(joints.rear.angle) <= LARGEST_ROTATION:
            return
        self._age.renew()
        if self._shutter.take(joints):
            self._footing, self._start_ns = Footing(self._scene.value, joints), joints.stamp_ns

    def _take_frame(self) -> None:
        joints = self._shutter.release()
        if joints is None or self._footing is None:
            return
        if self._renderer is None:
            self._renderer = self._make_renderer()
        image = self._renderer.draw(self._footing, joints, (joints.stamp_ns - self._start_ns) / SECOND)
        self._images.publish(image_message(Frame(joints.stamp_ns, image), self._frame_id))
        self._infos.publish(camera_message(self._camera, joints.stamp_ns, self._frame_id))

    def _diagnose(self) -> Diagnosis:
        shutter = self._shutter
        drawn, dropped = shutter.taken - self._told[0], shutter.dropped - self._told[1]
        self._told = shutter.taken, shutter.dropped
        values = {
            'frames drawn': shutter.taken,
            'frames dropped': shutter.dropped,
            'frames drawn since the last report': drawn,
        }
        if self._age.seconds > STALE_AFTER:
            return Diagnosis(Level.STALE, 'no joint_states', values)
        if dropped > MANY_DROPPED * drawn:
            return Diagnosis(
                Level.WARN,
                f'{counted(dropped, "frame")} dropped since the last report: drawing is slower than '
                'frame_rate, or joint_states come more rarely',
                values,
            )
        return Diagnosis(Level.OK, 'filming', values)


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run('virtual_camera', VirtualCameraNode, args)


if __name__ == '__main__':
    sys.exit(main())

"""The node `tag_tracker`: pictures or poses of the wheels in; joint states, detections and a debug image out."""

import math
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from threading import Thread
from typing import Any

from rclpy.node import Node

from dcdrw_msgs_py.camera import Camera, read_camera
from dcdrw_msgs_py.diagnosis import Diagnosis, Level, contested
from dcdrw_msgs_py.frame import Frame
from dcdrw_msgs_py.image_messages import camera, compressed_frame, frame, image_message, pose, tag_message
from dcdrw_msgs_py.messages import JointSampleWriter, run_message
from dcdrw_msgs_py.node import (
    Age,
    Parameters,
    advertise,
    clock_ns,
    listen,
    publish_diagnosis,
    publishers,
    run,
    steady_clock,
)
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import SECOND, JointSample
from dcdrw_msgs_py.tagging import TagParams, mounts
from dcdrw_msgs_py.topics import (
    CAMERA_INFO,
    DEBUG_IMAGE,
    FRONT_POSE,
    IMAGE_COMPRESSED,
    IMAGE_RAW,
    JOINT_STATES,
    REAR_POSE,
    RUNS,
    TAG_DETECTIONS,
    Topic,
)
from dcdrw_tracker.node.debug_image import draw
from dcdrw_tracker.node.frame_thread import FrameThread, Slot
from dcdrw_tracker.node.tag_tracker import TagTracker, Tracked
from dcdrw_tracker.node.tracker_diagnosis import SourceStatus, diagnose_poses, diagnose_tags
from dcdrw_tracker.node.tracker_source import COMPRESSED, POSES, SourceParams
from dcdrw_tracker.node.video import CameraDevice, VideoFile, is_device
from dcdrw_tracker.tags.wheel_view import PairViewParams
from dcdrw_tracker.wheels.poses import PosePairs, PoseParams
from dcdrw_tracker.wheels.wheel_angles import WheelAngles
from dcdrw_tracker.wheels.wheel_track import TrackParams

NEWEST = 2
"""Pictures that may wait in the middleware: an old one is worth nothing."""
WAIT_SECONDS = 0.1
"""How often to look whether somebody subscribes."""
MEMORY = 30
"""Frames over which the processing time is averaged."""


class TagTrackerNode(Node):
    """Feeds a `TagTracker`, or the `PosePairs` in its place, and publishes what comes out.

    Callbacks only leave a picture in a slot, where a newer one replaces it; a thread of its own takes it from there,
    tracks the wheels and publishes.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('tag_tracker', **kwargs)
        self._tags = Parameters(self, TagParams, validate=mounts).value
        self._view = Parameters(self, PairViewParams, self._configure)
        self._track = Parameters(self, TrackParams, self._configure)
        self._bodies = Parameters(self, PoseParams, validate=PoseParams.check_axis).value
        self._source = Parameters(self, SourceParams, validate=SourceParams.check_source).value
        # Not 1: a tracker that was started anew must not seem to go on with the run of the one before.
        self._run = first_run = time.time_ns() // SECOND
        self._announced = 0
        self._runs = advertise(self, RUNS, from_threads=True)
        self._joint_states = advertise(self, JOINT_STATES, from_threads=True)
        self._detections = advertise(self, TAG_DETECTIONS, from_threads=True)
        self._debug_image = advertise(self, DEBUG_IMAGE)
        self._writer = JointSampleWriter()
        self._age = Age()
        self._problem, self._unusable, self._seconds = '', 0, math.nan
        self._said: tuple[Level, str] | None = None
        self._topics: tuple[Topic, ...] = ()
        """What only one node should publish."""
        self._counted = 0, 0
        self._slot: Slot[Any] = Slot()
        self._reader: FrameThread | None = None
        self._worker: Thread | None = None
        if self._source.source == POSES:
            self._angles = WheelAngles(self._track.value, first_run)
            self._pairs = PosePairs(self._bodies, self._track.value)
            self._topics = (FRONT_POSE, REAR_POSE)
            listen(self, FRONT_POSE, partial(self._on_pose, FRONT))
            listen(self, REAR_POSE, partial(self._on_pose, REAR))
        else:
            self._tracker = TagTracker(
                self._tags, self._view.value, self._track.value, self._source.detector, first_run
            )
            self._start_on_pictures()
        publish_diagnosis(self, self._diagnose, warns_of_losses=False)

    def destroy_node(self) -> None:
        """End the threads first: they publish."""
        if self._reader:
            self._reader.close()
        self._slot.close()
        if self._worker:
            self._worker.join()
        super().destroy_node()

    # --- pictures --------------------------------------------------------------------------------------------------

    def _start_on_pictures(self) -> None:
        source = self._source
        self._camera: Camera | None = None
        self._through: Camera | None = None
        self._info: tuple[Any, ...] = ()
        self._no_camera = 'no camera_info has come; or name a file of it by the parameter camera'
        self._read: Callable[[Any], Frame] = frame
        try:
            if source.camera:
                self._camera = read_camera(Path(source.camera))
        except OSError as error:
            raise ValueError(f'camera: {error}') from None
        if source.opens_itself:
            self._read_source()
        else:
            topic = IMAGE_RAW
            if source.image_transport == COMPRESSED:
                self._read = compressed_frame
                topic = IMAGE_COMPRESSED._replace(name=f'{self.resolve_topic_name(IMAGE_RAW.name)}/compressed')
            self._topics = (topic,)
            self._subscription = listen(self, topic, self._slot.put, NEWEST)
            if not source.camera:
                listen(self, CAMERA_INFO, self._on_camera, NEWEST)
        self._worker = Thread(target=self._work, name='tracker', daemon=True)
        self._worker.start()

    def _read_source(self) -> None:
        """Let a thread read the file or the camera."""
        source, name = self._source, self._source.source
        self._read = lambda item: item
        self._reader = FrameThread(self._slot)
        if is_device(name):
            self._reader.film(lambda: CameraDevice(name, self._camera, source.frame_rate, source.pixel_format), name)
            return
        try:
            video = VideoFile(Path(name), source.frame_rate)
        except OSError as error:
            raise ValueError(f'source: {error}') from None
        self._reader.state = f'waiting for somebody who subscribes to {self._joint_states.topic_name}'

        def play() -> None:  # so that nobody misses the beginning
            if self._joint_states.get_subscription_count():
                timer.cancel()
                reader.play(video, clock_ns(self))

        reader, timer = self._reader, self.create_timer(WAIT_SECONDS, play, clock=steady_clock())

    def _on_camera(self, message: Any) -> None:
        info = (message.width, message.height, message.distortion_model, list(message.d), list(message.k))
        if info == self._info:
            return
        self._info = info
        try:
            self._camera = camera(message)
        except ValueError as error:
            self._camera, self._no_camera = None, str(error)

    def _work(self) -> None:
        while (item := self._slot.take()) is not None:
            begin = time.perf_counter()
            try:
                self._track_wheels(item)
            except Exception as error:  # a picture that nothing can be made of must not end the tracking
                self._problem = ' '.join(str(error).split()) or type(error).__name__
                self._unusable += 1
                continue
            self._problem = ''
            self._age.renew()
            seconds = time.perf_counter() - begin
            self._seconds = (
                seconds if math.isnan(self._seconds) else (self._seconds + (seconds - self._seconds) / MEMORY)
            )

    def _track_wheels(self, item: Any) -> None:
        if self._camera is None:
            raise ValueError(self._no_camera)
        if self._through is not self._camera:
            self._through = self._camera
            self._tracker.look_through(self._through)
        picture = self._read(item)
        tracked = self._tracker.process(picture)
        frame_id = item.header.frame_id if item is not picture else 'camera'
        if tracked.sample:
            self._publish(tracked.sample)
        for one in tracked.detections:
            wheel = self._tracker.mounts[one.id].wheel
            self._detections.publish(tag_message(wheel, one.id, one.corners, picture.stamp_ns, frame_id))
        if self._debug_image.is_heard:
            self._debug_image.publish(image_message(self._drawn(picture, tracked, self._through), frame_id))

    def _drawn(self, picture: Frame, tracked: Tracked, through: Camera) -> Frame:
        track = self._track.value
        return picture._replace(
            image=draw(picture.image, tracked, self._tracker.mounts, through, (track.front, track.rear))
        )

    # --- poses -----------------------------------------------------------------------------------------------------

    def _on_pose(self, wheel: str, message: Any) -> None:
        try:
            views = self._pairs.take(wheel, pose(message))
        except ValueError as error:
            self._problem = f'{wheel}_pose: {error}'
            self._unusable += 1
            return
        self._problem = ''
        for view in views:
            self._age.renew()
            if sample := self._angles.update(view):
                self._publish(sample)

    # --- both ------------------------------------------------------------------------------------------------------

    def _publish(self, sample: JointSample) -> None:
        if sample.run != self._announced:
            self._announced = sample.run
            self._runs.publish(run_message(sample.stamp_ns, sample.run))
        if sample.run != self._run:
            self._run = sample.run
            self.get_logger().warning(
                'the number of turns was lost, or the stamps went back: the steps are counted afresh'
            )
        self._joint_states.publish(self._writer.write(sample))

    def _configure(self, _: object) -> None:
        track = self._track.value
        if self._source.source == POSES:
            self._angles.configure(track)
            self._pairs = PosePairs(self._bodies, track)
        else:
            self._tracker.configure(self._view.value, track)

    def _diagnose(self) -> Diagnosis:
        diagnosis = (
            diagnose_poses(self._angles.status(), self._source_status())
            if self._source.source == POSES
            else diagnose_tags(self._tracker.status(), self._source_status())
        )
        for topic in self._topics:
            if len(nodes := publishers(self, topic)) > 1:
                diagnosis = contested(diagnosis, topic.name, nodes)
        if diagnosis[:2] != self._said:  # one line whenever it changes, not one per frame
            self._said = diagnosis[:2]
            if diagnosis.level == Level.OK:  # rclpy allows one level per line of code
                self.get_logger().info(diagnosis.message)
            else:
                self.get_logger().warning(diagnosis.message)
        return diagnosis

    def _source_status(self) -> SourceStatus:
        taken, dropped, reader = self._slot.taken, self._slot.dropped, self._reader
        taken_late, dropped_late = taken - self._counted[0], dropped - self._counted[1]
        self._counted = taken, dropped
        problem = self._problem or (reader.state if reader and not reader.good else '')
        return SourceStatus(
            self._age.seconds,
            problem,
            self._waiting_for(),
            dropped,
            dropped_late / max(taken_late + dropped_late, 1),
            self._unusable,
            self._seconds,
        )

    def _waiting_for(self) -> str:
        """What to say while nothing comes."""
        if self._reader:
            return self._reader.state
        if self._source.source == POSES:
            if self._pairs.waits:
                return self._pairs.waits
            names = ' and '.join(self.resolve_topic_name(topic.name) for topic in (FRONT_POSE, REAR_POSE))
            return f'no poses of both wheels come on {names}'
        name = self._subscription.topic_name
        if self.count_publishers(name):
            return f'no pictures come on {name}'
        base = self.resolve_topic_name(IMAGE_RAW.name)
        other, transport = (base, 'raw') if name != base else (f'{base}/compressed', COMPRESSED)
        hint = f'; {other} is there: set image_transport to {transport}' if self.count_publishers(other) else ''
        return f'nobody publishes {name}{hint}'


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run('tag_tracker', TagTrackerNode, args)


if __name__ == '__main__':
    sys.exit(main())

"""The listener of a trial: what the nodes published, kept in memory and, as it comes, in files."""

import csv
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from rclpy.node import Node

from dcdrw_msgs_py.messages import JointSampleReader, PhaseSampleReader, footfall
from dcdrw_msgs_py.node import Age, listen
from dcdrw_msgs_py.samples import Footfall, JointSample, PhaseSample
from dcdrw_msgs_py.topics import DIAGNOSTICS, FOOTFALLS, JOINT_STATES, PHASE_STATE, SYNC_ERROR, SYNCHRONIZED

SAMPLES_HEADER = ('stamp_ns', 'theta1', 'omega1', 'theta2', 'omega2', 'phi', 'phi_rate', 'step_difference',
                  'restarts')
FOOTFALLS_HEADER = ('wheel', 'stamp_ns', 'x', 'steps')


class Observer(Node):
    """Hears every topic of a trial."""

    def __init__(self, folder: Path, **kwargs: Any) -> None:
        super().__init__('trial', **kwargs)
        self._folder = folder
        self.joints: list[JointSample] = []
        self.phases: list[PhaseSample] = []
        self.footfalls: list[Footfall] = []
        self.heard: set[str] = set()
        """Topics of which a message has come."""
        self.synchronized = False
        """The monitor's verdict."""
        self.failure = ''
        self._recording = False
        self.moving = False
        """The wheels have been let go: what comes is recorded."""
        self.diagnoses: dict[str, str] = {}
        """What each node said of itself last."""
        self.age = Age()
        self._joints_reader, self._phase_reader = JointSampleReader(), PhaseSampleReader()
        self._files = [(folder / name).open('w', encoding='utf-8', newline='')
                       for name in ('samples.csv', 'footfalls.csv')]
        self._samples, self._falls = (csv.writer(file) for file in self._files)
        self._samples.writerow(SAMPLES_HEADER)
        self._falls.writerow(FOOTFALLS_HEADER)
        for topic, callback in ((JOINT_STATES, self._on_joints), (PHASE_STATE, self._on_phase),
                                (SYNC_ERROR, self._on_error), (SYNCHRONIZED, self._on_synchronized),
                                (FOOTFALLS, self._on_footfall), (DIAGNOSTICS, self._on_diagnostics)):
            listen(self, topic, self._bearing(topic.name, callback))

    def record(self) -> None:
        """Begin with the last sample before the wheels move, which are now let go."""
        self._recording = True
        self.age.renew()

    def flush(self) -> None:
        """Bring to the disk what has come so far."""
        for file in self._files:
            self._to_disk(file.flush)

    def close(self) -> None:
        """Close the files."""
        for file in self._files:
            self._to_disk(file.close)

    def _bearing(self, name: str, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """A callback that passes over what it cannot read: on a shared domain others may publish, too."""
        def bear(message: Any) -> None:
            with suppress(ValueError):
                callback(message)
                self.heard.add(name)
        return bear

    def _to_disk(self, write: Callable[[], object]) -> None:
        try:
            write()
        except OSError as error:  # a full disk ends the record, not what is there
            self._recording = False
            self.failure = f'{error.strerror}: {self._folder}'

    def _on_joints(self, message: Any) -> None:
        joints = self._joints_reader.read(message)
        if self.moving:
            self.joints.append(joints)

    def _on_phase(self, message: Any) -> None:
        phase = self._phase_reader.read(message)
        self.age.renew()
        if not self._recording:
            return
        if not self.moving:
            self.phases = [phase]
            self.moving = bool(phase.front.rate or phase.rear.rate)
            return
        self.phases.append(phase)
        stamp_ns, front, rear, phi, difference, restarts = phase
        self._to_disk(lambda: self._samples.writerow((stamp_ns, *front, *rear, *phi, difference, restarts)))

    def _on_error(self, message: Any) -> None:
        """That it comes is all."""

    def _on_synchronized(self, message: Any) -> None:
        self.synchronized = message.data

    def _on_footfall(self, message: Any) -> None:
        fall = footfall(message)
        if self.moving:
            self.footfalls.append(fall)
            self._to_disk(lambda: self._falls.writerow(fall))

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            self.diagnoses[status.name] = status.message


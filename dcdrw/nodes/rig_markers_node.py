"""The node `rig_markers`: joint states in, the rig as markers for RViz and Foxglove out."""

import math
import sys
from typing import Any

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from rclpy.node import Node
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from dcdrw.drawings.rig_markers import MarkerParams, RigView, Shape, about_y
from dcdrw_msgs_py.diagnosis import STATE, Diagnosis, Level
from dcdrw_msgs_py.messages import JointSampleReader, diagnoses
from dcdrw_msgs_py.node import Age, Parameters, advertise, follow_runs, listen, publish_diagnosis, run, steady_clock
from dcdrw_msgs_py.topics import DIAGNOSTICS, JOINT_STATES, LEG_PHASES, PERSON_FORCE, RIG_MARKERS

STALE_AFTER = 1.0
"""Age of the last sample from which there are no data [s]; the drawing is then repeated so often, and says so."""
LIFETIME = 4
"""A drawing that is not renewed for so long goes: the node has ended [s]."""
MONITOR, SYNCHRONIZER = 'sync_monitor', 'synchronizer'


class RigMarkersNode(Node):
    """Draws the last sample, no more often than eyes need, and what the monitor says of it."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('rig_markers', **kwargs)
        self._settings = Parameters(self, MarkerParams, self._configure)
        params = self._settings.value
        self._view = RigView(params)
        self._reader = JointSampleReader(params.front_joint, params.rear_joint, params.coupler_joint)
        self._monitor, self._synchronizer = (
            f'{self.get_namespace().strip("/")}/{name}'.lstrip('/') for name in (MONITOR, SYNCHRONIZER)
        )
        self._markers = advertise(self, RIG_MARKERS)
        self._message: Any = None
        self._header = Header(frame_id=params.frame)
        self._says: Diagnosis | None = None
        self._acts = ''
        self._person_force = math.nan
        self._drawn_run = 0
        self._drawings = 0
        self._sample_age, self._drawn_age, self._says_age, self._acts_age = Age(), Age(), Age(), Age()
        self._legs_age, self._force_age = Age(), Age()
        self._drawn: set[str] = set()
        publish_diagnosis(self, self._diagnose)
        self.create_timer(1.0 / params.redraw_rate, self._tick, clock=steady_clock())
        listen(self, DIAGNOSTICS, self._on_diagnostics)
        listen(self, PERSON_FORCE, self._on_person_force)
        listen(self, LEG_PHASES, lambda message: self._legs_age.renew())
        follow_runs(self, self._reader.runs)
        listen(self, JOINT_STATES, self._on_joints)

    def _on_joints(self, message: Any) -> None:
        self._message = message

    def _on_person_force(self, message: Any) -> None:
        self._person_force = message.wrench.force.x
        self._force_age.renew()

    def _on_diagnostics(self, message: Any) -> None:
        said = diagnoses(message)
        if monitor := said.get(self._monitor):
            self._says = monitor
            self._says_age.renew()
        if synchronizer := said.get(self._synchronizer):
            self._acts = str(synchronizer.values.get(STATE, ''))
            self._acts_age.renew()

    def _configure(self, params: MarkerParams) -> None:
        self._view.params = params

    def _tick(self) -> None:
        if self._take() or self._drawn_age.seconds > STALE_AFTER:
            self._draw()

    def _take(self) -> bool:
        """Take the last sample that came since the last tick; whether there was one to draw."""
        message, self._message = self._message, None
        if message is None:
            return False
        try:
            taken = self._view.update(self._reader.read(message))
        except ValueError as error:
            self.get_logger().warning(f'joint_states: {error}', throttle_duration_sec=1.0)
            return False
        if taken:
            self._header.stamp = message.header.stamp
            self._sample_age.renew()
        return taken

    def _draw(self) -> None:
        acts = self._acts if self._acts_age.seconds <= LIFETIME else ''
        walks = min(self._legs_age.seconds, self._force_age.seconds) <= LIFETIME
        force = self._person_force if self._force_age.seconds <= STALE_AFTER else math.nan
        person_force = force if walks else None
        shapes = self._view.shapes(self._caption(), acts, person_force)
        if not shapes:
            return
        markers = [to_marker(shape, self._header) for shape in shapes]
        names = {shape.name for shape in shapes}
        markers += [Marker(header=self._header, ns=name, action=Marker.DELETE) for name in self._drawn - names]
        self._drawn = names
        if self._drawn_run != self._view.runs:  # what an earlier run, or node, has left behind
            self._drawn_run = self._view.runs
            markers.insert(0, Marker(header=self._header, action=Marker.DELETEALL))
        self._markers.publish(MarkerArray(markers=markers))
        self._drawings += 1
        self._drawn_age.renew()

    def _caption(self) -> Diagnosis | None:
        if self._sample_age.seconds > STALE_AFTER:
            return Diagnosis(Level.STALE, f'no data for {self._sample_age.seconds:.0f} s', {})
        return self._says if self._says_age.seconds <= LIFETIME else None

    def _diagnose(self) -> Diagnosis:
        age = self._sample_age.seconds
        level, message = Level.OK, 'drawing'
        if age > STALE_AFTER:
            level, message = Level.STALE, f'stale: no sample for {age:.1f} s' if self._drawings else 'no data yet'
        return Diagnosis(level, message, {'drawings': self._drawings, 'runs of the source': self._view.runs})


def to_marker(shape: Shape, header: Any) -> Any:
    """A shape as a marker: its name is the namespace, so that it takes the place of the one before."""
    x, y, z, w = about_y(shape.turn)
    kind = Marker.TEXT_VIEW_FACING if shape.text else Marker.LINE_LIST
    return Marker(
        header=header,
        ns=shape.name,
        id=0,
        type=kind,
        action=Marker.ADD,
        pose=Pose(position=_point(shape.position), orientation=Quaternion(x=x, y=y, z=z, w=w)),
        scale=Vector3(z=shape.size) if shape.text else Vector3(x=shape.size),
        color=ColorRGBA(**dict(zip('rgba', shape.colour, strict=True))),
        lifetime=Duration(sec=LIFETIME),
        points=[_point(point) for point in shape.points],
        text=shape.text,
    )


def _point(point: tuple[float, float, float]) -> Any:
    x, y, z = point
    return Point(x=x, y=y, z=z)


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run('rig_markers', RigMarkersNode, args)


if __name__ == '__main__':
    sys.exit(main())

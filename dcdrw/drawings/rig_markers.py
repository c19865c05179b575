"""The rig as a drawing: what the node `rig_markers` publishes, without ROS.

Everything lies in one frame, x horizontal and downhill, y left, z up, that goes along with the rig: its origin is the
place on the slope below the midpoint of the hubs. All turns are about y, which rolls downhill: of the slope γ, of a
wheel γ + θ. Sizes go with the wheels, so that a rig of any scale, and one without dimensions, looks alike.

Where a person walks in front, footfalls are those of left and right feet in turn, beside the middle, and an arrow from
the front hub shows the force on the person.
"""

import math
from collections import deque
from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, NamedTuple

from dcdrw_msgs_py.diagnosis import Diagnosis, Level
from dcdrw_msgs_py.quantity import Quantity
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams, Slope, StanceDistance, WheelShape
from dcdrw_msgs_py.rolling import phi_pitch, rear_side, regular_stance_distance, stance_distance_by_hubs
from dcdrw_msgs_py.samples import JointSample
from dcdrw_msgs_py.topics import SIDES
from dcdrw_tracker.gait.diagnostics import phase_text
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams, PhaseUpdate

Point = tuple[float, float, float]
Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, 0 to 1."""
Quaternion = tuple[float, float, float, float]
"""x, y, z, w."""
FOOTFALLS = 6
"""Footfalls of each wheel that are shown."""
COILS = 8
FOOT_TRACK = 0.15
"""A person's feet are drawn so far beside the middle, in lengths of a leg."""


class MarkerParams(NamedTuple):
    """What is drawn, and how."""

    front: WheelShape = WheelShape()
    rear: WheelShape = WheelShape()
    S0: StanceDistance = math.nan
    slope: Slope = RigParams().slope
    front_joint: Annotated[str, Quantity('name of the front wheel in joint_states')] = PhaseParams().front_joint
    rear_joint: Annotated[str, Quantity('name of the rear wheel in joint_states')] = PhaseParams().rear_joint
    coupler_joint: Annotated[str, Quantity('name of the coupler in joint_states')] = PhaseParams().coupler_joint
    frame: Annotated[str, Quantity('frame of the markers')] = 'rig'
    follow: Annotated[
        bool,
        Quantity(
            'the frame goes along with the rig; false: it stays at the first foothold of the rear wheel', live=True
        ),
    ] = True
    redraw_rate: Annotated[float, Quantity('drawings per second at most', 'Hz', above=0.0, high=60.0)] = 30.0
    full_force: Annotated[float, Quantity('coupler force of the fullest colour', 'N', above=0.0, live=True)] = 20.0


class Shape(NamedTuple):
    """One marker; its name is its own, so that a later one of that name takes its place. Lengths in m."""

    name: str
    colour: Colour
    size: float
    """Width of the lines, or height of a capital letter."""
    position: Point = (0.0, 0.0, 0.0)
    turn: float = 0.0
    """About y, positive downhill [rad]."""
    points: tuple[Point, ...] = ()
    """Ends of lines, two by two, in the shape's own frame."""
    text: str = ''
    """In place of lines; ASCII, as RViz has no other letters."""


class RigView:
    """Follows the rig; one sample in, the drawing out."""

    def __init__(self, params: MarkerParams) -> None:
        self.params = params
        self.runs = 0
        """How often the source has started, or started anew."""
        self._estimator = PhaseEstimator(PhaseParams(params.front, params.rear, params.S0))
        self._phase: PhaseUpdate | None = None
        self._force = math.nan
        self._stance = 0.0
        self._falls: dict[str, deque[int]] = {wheel: deque(maxlen=FOOTFALLS) for wheel in (FRONT, REAR)}
        self._rear_side = 0

    def update(self, joints: JointSample) -> bool:
        """Take a sample; whether it is of use."""
        update = self._estimator.update(joints)
        if update is None:
            return False
        if self._phase is None or self._phase.phase.restarts != update.phase.restarts:
            self.runs += 1
            self._begin(joints, update)
        self._phase, self._force = update, joints.coupler.force
        for fall in update.footfalls:
            self._falls[fall.wheel].append(fall.steps)
            if fall.wheel == REAR and self._falls[FRONT]:
                self._rear_side = rear_side(self._falls[FRONT][-1], fall.steps)
        return True

    def _begin(self, joints: JointSample, update: PhaseUpdate) -> None:
        """Place the feet at the start of a run: as the coupler's length tells; without it, as a regular gait has them.

        A regular gait has the feet S0 apart, and σ1 further from a strike of the front wheel to the next of the rear.
        """
        front, rear = self.params.front, self.params.rear
        theta1, theta2 = update.phase.front.angle, update.phase.rear.angle
        regular = regular_stance_distance(front, rear, self.params.S0, theta1, theta2)
        S = stance_distance_by_hubs(front, rear, theta1, theta2, joints.coupler.length, regular)
        status = self._estimator.status()
        self._stance = S - status.front_steps * front.step_length + status.rear_steps * rear.step_length
        for falls in self._falls.values():
            falls.clear()

    def foot(self, wheel: str, steps: int) -> float:
        """Place of a wheel's foot down the slope after so many steps [m]; 0 is the rear wheel's first foothold."""
        if wheel == FRONT:
            return self._stance + steps * self.params.front.step_length
        return steps * self.params.rear.step_length

    def shapes(
        self, says: Diagnosis | None = None, synchronizer: str = '', person_force: float | None = None
    ) -> tuple[Shape, ...]:
        """The drawing; nothing before the first sample.

        Args:
            says: what is known of the pair, the monitor's diagnosis say, to be written above the rig.
            synchronizer: what the synchronizer does; empty where there is none.
            person_force: on the person in front, positive forward [N]; NaN: unknown; None where nobody walks.

        """
        return tuple(self._draw(says, synchronizer, person_force)) if self._phase else ()

    def _draw(self, says: Diagnosis | None, synchronizer: str, person_force: float | None) -> Iterator[Shape]:
        assert self._phase
        params, phase, status = self.params, self._phase.phase, self._estimator.status()
        theta = {FRONT: phase.front.angle, REAR: phase.rear.angle}
        steps = {FRONT: status.front_steps, REAR: status.rear_steps}
        wheels = {FRONT: params.front, REAR: params.rear}
        hub = {
            wheel: (
                self.foot(wheel, steps[wheel]) + wheels[wheel].length * math.sin(theta[wheel]),
                wheels[wheel].length * math.cos(theta[wheel]),
            )
            for wheel in wheels
        }
        middle = 0.5 * (hub[FRONT][0] + hub[REAR][0])
        origin = middle if params.follow else 0.0
        size = max(params.front.length, params.rear.length)
        side = {FRONT: 0.1 * size, REAR: -0.1 * size}  # in one plane the spokes would pass through each other

        def place(along: float, y: float, above: float) -> Point:
            return rotated((along - origin, y, above), params.slope)

        yield Shape(
            'slope',
            _GROUND,
            0.015 * size,
            place(0.0, 0.0, 0.0),
            params.slope,
            tuple(self._ground(middle - 3.0 * size, middle + 3.0 * size, 0.3 * size)),
        )
        for wheel, shape in wheels.items():
            y, colour = side[wheel], _COLOURS[wheel]
            centre, turn = place(hub[wheel][0], y, hub[wheel][1]), params.slope + theta[wheel]
            legs = [leg(shape.length, 2.0 * shape.alpha * j) for j in range(int(shape.spokes))]
            axle = ((0.0, 0.0, 0.0), (0.0, -y, 0.0))
            yield Shape(
                f'{wheel}_wheel',
                faded(colour),
                0.02 * size,
                centre,
                turn,
                tuple(point for tip in legs[1:] for point in ((0.0, 0.0, 0.0), tip)) + axle,
            )
            yield Shape(f'{wheel}_stance_leg', colour, 0.045 * size, centre, turn, ((0.0, 0.0, 0.0), legs[0]))
            feet = {f'{wheel}_footfalls': (y, list(self._falls[wheel]))}
            if person_force is not None:
                offset = self._rear_side if wheel == REAR else 0
                feet = {
                    f'{wheel}_{side_}_feet': (
                        sign * FOOT_TRACK * size,
                        [n for n in self._falls[wheel] if (n + offset) % 2 == odd],
                    )
                    for odd, (side_, sign) in enumerate(zip(SIDES, (1.0, -1.0), strict=True))
                }
            for name, (beside, falls) in feet.items():
                if falls:
                    ends = (-0.05 * size, 0.05 * size)
                    points = tuple((self.foot(wheel, n), end, 0.0) for n in falls for end in ends)
                    yield Shape(name, colour, 0.06 * size, place(0.0, beside, 0.0), params.slope, points)
        (x1, z1), (x2, z2) = hub[FRONT], hub[REAR]
        yield Shape(
            'coupler',
            force_colour(self._force / params.full_force),
            0.018 * size,
            place(x2, 0.0, z2),
            params.slope + math.atan2(z2 - z1, x1 - x2),
            tuple(coupler_lines(math.hypot(x1 - x2, z1 - z2), 0.1 * size)),
        )
        if person_force is not None and math.isfinite(person_force):
            share = person_force / params.full_force
            yield Shape(
                'person_force',
                force_colour(-share),
                0.03 * size,
                place(x1, 0.0, z1 + 0.3 * size),
                params.slope,
                tuple(arrow(max(-1.0, min(1.0, share)) * size, 0.08 * size)),
            )
        lines = [phase_text(phase.phi.angle / phi_pitch(params.front, params.rear)), f'n = {phase.step_difference}']
        if math.isfinite(self._force):
            lines[1] += f', coupler {self._force:+.1f} N'
        if person_force is not None and math.isfinite(person_force):
            lines.append(f'on the person {person_force:+.1f} N')
        if synchronizer:
            lines.append(f'synchronizer {synchronizer}')
        if says:
            lines.append(says.message)
        yield Shape(
            'label',
            _LEVELS[says.level if says else Level.STALE],
            0.16 * size,
            place(middle, 0.0, 2.5 * size),
            text='\n'.join(lines),
        )

    def _ground(self, start: float, end: float, side: float) -> Iterator[Point]:
        """A strip of the slope with a mark at every foothold of the rear wheel, so that one sees it pass."""
        for y in (-side, side):
            yield from ((start, y, 0.0), (end, y, 0.0))
        step = self.params.rear.step_length
        for n in range(math.ceil(start / step), math.floor(end / step) + 1):
            yield from ((n * step, -side, 0.0), (n * step, side, 0.0))


def about_y(turn: float) -> Quaternion:
    """The unit quaternion of a turn about y: z goes towards x."""
    return 0.0, math.sin(0.5 * turn), 0.0, math.cos(0.5 * turn)


def rotated(point: Point, turn: float) -> Point:
    """A point turned about y, as `about_y` does."""
    x, y, z = point
    return x * math.cos(turn) + z * math.sin(turn), y, z * math.cos(turn) - x * math.sin(turn)


def leg(length: float, angle: float) -> Point:
    """The tip of a leg in the frame of its hub, whose leg 0 points down; the others follow in the sense of θ."""
    return rotated((0.0, 0.0, -length), angle)


def coupler_lines(length: float, width: float) -> Iterator[Point]:
    """Spring and damper along x from hub to hub, the one above the other: points two by two."""

    def line(*points: tuple[float, float]) -> Iterator[Point]:
        for (x, z), (x_next, z_next) in pairwise(points):
            yield x * length, 0.0, z * width
            yield x_next * length, 0.0, z_next * width

    zigzag = [(0.2 + 0.6 * (i + 0.5) / (2 * COILS), 1.6 if i % 2 else 0.4) for i in range(2 * COILS)]
    yield from line(
        (0.0, 0.0), (0.12, 0.0), (0.12, 1.0), (0.2, 1.0), *zigzag, (0.8, 1.0), (0.88, 1.0), (0.88, 0.0), (1.0, 0.0)
    )
    yield from line((0.12, 0.0), (0.12, -1.0), (0.4, -1.0))
    yield from line((0.6, -0.5), (0.4, -0.5), (0.4, -1.5), (0.6, -1.5))  # the cylinder, open to the rod
    yield from line((0.52, -0.6), (0.52, -1.4))
    yield from line((0.52, -1.0), (0.88, -1.0), (0.88, 0.0))


def arrow(length: float, head: float) -> Iterator[Point]:
    """An arrow along x, of either sign, as lines: points two by two."""
    tip = (length, 0.0, 0.0)
    back = length - math.copysign(min(head, abs(length)), length)
    yield from ((0.0, 0.0, 0.0), tip)
    for z in (-head, head):
        yield from ((back, 0.0, z), tip)


def force_colour(share: float) -> Colour:
    """From sky blue (pushes the hubs apart) by grey (none) to purple (draws them together); `share` −1 to 1."""
    if math.isnan(share):
        return _UNKNOWN
    end = _TENSION if share > 0.0 else _THRUST
    weight = min(abs(share), 1.0)
    red, green, blue = (n + weight * (e - n) for n, e in zip(_NO_FORCE[:3], end[:3], strict=True))
    return red, green, blue, 1.0


def faded(colour: Colour) -> Colour:
    """The same colour, half transparent."""
    return (*colour[:3], 0.5)


def _colour(hexadecimal: str) -> Colour:
    red, green, blue = bytes.fromhex(hexadecimal)
    return red / 255, green / 255, blue / 255, 1.0


# Okabe and Ito's palette, as in the figures; seen on dark and on light backgrounds.
_COLOURS = {FRONT: _colour('0072B2'), REAR: _colour('D55E00')}
_TENSION, _NO_FORCE, _THRUST, _UNKNOWN = _colour('CC79A7'), _colour('999999'), _colour('56B4E9'), _colour('666666')
_GROUND = _colour('777777')
_LEVELS = {
    Level.OK: _colour('009E73'),
    Level.WARN: _colour('E69F00'),
    Level.ERROR: _colour('D55E00'),
    Level.STALE: _colour('888888'),
}

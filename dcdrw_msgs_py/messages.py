"""Between messages and samples. Joints are found by name, never by their place in the message."""

import math
from array import array
from collections.abc import Mapping, Sequence
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from dcdrw_msgs_py.diagnosis import Diagnosis, Level, value_text
from dcdrw_msgs_py.rig import FRONT, REAR
from dcdrw_msgs_py.samples import (
    RUN,
    SECOND,
    CouplerSample,
    Footfall,
    JointSample,
    LoneWheel,
    PhaseSample,
    Runs,
    Turn,
)
from dcdrw_msgs_py.topics import (
    COUPLER,
    FRONT_STANCE,
    FRONT_STEPS,
    FRONT_WHEEL,
    PHI_JOINT,
    REAR_STANCE,
    REAR_STEPS,
    REAR_WHEEL,
    RESOLUTION_JOINT,
    RESTARTS,
    SLOPE_FRAME,
    SOURCES_JOINT,
    STEP_DIFFERENCE_JOINT,
)
from dcdrw_msgs_py.words import names_and_positions

SUITE = 'dcdrw'
"""The rig without a namespace, as diagnostics name their hardware; viewers group by it."""


def stamp_ns(stamp: Any) -> int:
    """Nanoseconds of a message's stamp."""
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def to_stamp(nanoseconds: int) -> Any:
    """Make a message's stamp."""
    sec, nanosec = divmod(nanoseconds, SECOND)
    return Time(sec=sec, nanosec=nanosec)


class Joints:
    """Reads chosen joints of JointState messages, whatever their order and company."""

    def __init__(self, required: Sequence[str], optional: Sequence[str] = ()) -> None:
        self._required, self._optional = tuple(required), tuple(optional)
        self._names: list[str] | None = None
        self._places: list[int] = []

    def read(self, message: Any) -> list[tuple[float, float, float]]:
        """Position, velocity and effort of each joint, required ones first; NaN where not given.

        Raises:
            ValueError: a required joint is missing, a name stands twice, or positions and names disagree.

        """
        if message.name != self._names:
            self._places = self._find(list(message.name))
            self._names = list(message.name)
        count = len(message.name)
        positions, velocities, efforts = message.position, message.velocity, message.effort
        if len(positions) != count:
            raise ValueError(names_and_positions(count, len(positions)))
        speeds = velocities if len(velocities) == count else None
        forces = efforts if len(efforts) == count else None
        return [
            (math.nan, math.nan, math.nan)
            if place < 0
            else (
                positions[place],
                speeds[place] if speeds is not None else math.nan,
                forces[place] if forces is not None else math.nan,
            )
            for place in self._places
        ]

    def _find(self, names: list[str]) -> list[int]:
        missing = [name for name in self._required if name not in names]
        if missing:
            raise ValueError(f'joint {missing[0]} is missing; the message names {", ".join(names) or "none"}')
        wanted = (*self._required, *self._optional)
        twice = [name for name in wanted if names.count(name) > 1]
        if twice:
            raise ValueError(f'joint {twice[0]} stands twice in the message')
        return [names.index(name) if name in names else -1 for name in wanted]


class JointSampleReader:
    """Reads `joint_states`; joints of other names are ignored."""

    def __init__(self, front: str = FRONT_WHEEL, rear: str = REAR_WHEEL, coupler: str = COUPLER) -> None:
        self.runs = Runs()
        """What the source has announced on `run`."""
        self._joints = Joints((front, rear), (coupler,))
        self._any = Joints((), (front, rear, coupler))
        self._wheels = {FRONT: front, REAR: rear}

    def read(self, message: Any) -> JointSample:
        """The sample in a message.

        Raises:
            ValueError: as `Joints.read`.

        """
        (psi1, rate1, _), (psi2, rate2, _), coupler = self._joints.read(message)
        stamp = stamp_ns(message.header.stamp)
        return JointSample(stamp, Turn(psi1, rate1), Turn(psi2, rate2), CouplerSample(*coupler), self.runs.of(stamp))

    def read_any(self, message: Any) -> JointSample | LoneWheel:
        """The sample in a message, or the one wheel that it has.

        Raises:
            ValueError: as `Joints.read`; neither wheel is there.

        """
        names = message.name
        has_front = self._wheels[FRONT] in names
        if has_front == (self._wheels[REAR] in names):
            return self.read(message)
        front, rear, coupler = self._any.read(message)
        return LoneWheel(
            stamp_ns(message.header.stamp),
            FRONT if has_front else REAR,
            Turn(*(front if has_front else rear)[:2]),
            CouplerSample(*coupler),
            self.runs.of(stamp_ns(message.header.stamp)),
        )


class PhaseSampleReader:
    """Reads `phase_state`."""

    def __init__(self) -> None:
        self._joints = Joints(
            (FRONT_STANCE, REAR_STANCE, PHI_JOINT, STEP_DIFFERENCE_JOINT),
            (FRONT_STEPS, REAR_STEPS, RESTARTS, SOURCES_JOINT, RESOLUTION_JOINT),
        )

    def read(self, message: Any) -> PhaseSample:
        """The sample in a message.

        Raises:
            ValueError: as `Joints.read`, or a step difference that is not a number.

        """
        front, rear, phi, (difference, *_), *counts, (resolution, *_) = self._joints.read(message)
        steps1, steps2, restarts, sources = (round(count) if math.isfinite(count) else 0 for count, *_ in counts)
        if not math.isfinite(difference):
            raise ValueError(f'{STEP_DIFFERENCE_JOINT} must be a number, got {difference}')
        return PhaseSample(
            stamp_ns(message.header.stamp),
            Turn(*front[:2]),
            Turn(*rear[:2]),
            Turn(*phi[:2]),
            round(difference),
            restarts,
            steps1,
            steps2,
            max(sources, 1),
            resolution if resolution > 0.0 else 0.0,
        )


class JointSampleWriter:
    """Writes `joint_states` into one message, which is used again and again."""

    def __init__(self) -> None:
        self._message = JointState(name=[FRONT_WHEEL, REAR_WHEEL, COUPLER])

    def write(self, sample: JointSample) -> Any:
        """The message of a sample; valid until the next call."""
        message, (length, rate, force) = self._message, sample.coupler
        message.header.stamp = to_stamp(sample.stamp_ns)
        message.position = array('d', (sample.front.angle, sample.rear.angle, length))
        message.velocity = array('d', (sample.front.rate, sample.rear.rate, rate))
        message.effort = array('d', (math.nan, math.nan, force))
        return message


def turns_message(stamp: int, turns: Mapping[str, Turn]) -> Any:
    """A JointState of angles and their rates, by the joints' names, at a time [ns]."""
    message = JointState(name=list(turns))
    message.header.stamp = to_stamp(stamp)
    message.position = array('d', [turn.angle for turn in turns.values()])
    message.velocity = array('d', [turn.rate for turn in turns.values()])
    return message


class PhaseSampleWriter:
    """Writes `phase_state` into one message, which is used again and again."""

    def __init__(self) -> None:
        names = [FRONT_STANCE, REAR_STANCE, PHI_JOINT, STEP_DIFFERENCE_JOINT, FRONT_STEPS, REAR_STEPS, RESTARTS]
        self._message, self._longer = JointState(name=names), JointState(name=[*names, SOURCES_JOINT, RESOLUTION_JOINT])

    def write(self, sample: PhaseSample) -> Any:
        """The message of a sample; valid until the next call."""
        message = self._message
        _, front, rear, phi, difference, restarts, steps1, steps2, sources, resolution = sample
        message.header.stamp = to_stamp(sample.stamp_ns)
        message.position = array('d', (front.angle, rear.angle, phi.angle, difference, steps1, steps2, restarts))
        message.velocity = array('d', (front.rate, rear.rate, phi.rate, 0.0, 0.0, 0.0, 0.0))
        if sources == 1 and not resolution:
            return message
        longer = self._longer
        longer.header.stamp = message.header.stamp
        longer.position = message.position + array('d', (sources, resolution))
        longer.velocity = message.velocity + array('d', (0.0, 0.0))
        return longer


def run_message(stamp: int, number: int) -> Any:
    """The announcement of a run: the stamp of its first sample [ns], and its number."""
    return Header(stamp=to_stamp(stamp), frame_id=f'{RUN}{number}')


def footfall_message(footfall: Footfall) -> Any:
    """One strike as `front_footfalls` and `rear_footfalls` carry it; both wheels roll in the plane y = 0."""
    message = PointStamped()
    message.header.stamp = to_stamp(footfall.stamp_ns)
    message.header.frame_id = SLOPE_FRAME
    message.point.x = footfall.x
    return message


def footfall(message: Any, wheel: str) -> Footfall:
    """The strike in a message of a wheel's footfalls.

    Raises:
        ValueError: its place is not a number.

    """
    if not math.isfinite(message.point.x):
        raise ValueError(f'the place of a footfall must be finite, got {message.point.x}')
    return Footfall(wheel, stamp_ns(message.header.stamp), message.point.x)


def diagnostics_message(node: str, diagnosis: Diagnosis, now_ns: int) -> Any:
    """One node's diagnosis as `/diagnostics` carries it; the hardware is the rig, which the namespace tells.

    Args:
        node: its full name, namespace first.
        diagnosis: what it says.
        now_ns: the stamp.

    """
    name = node.lstrip('/')
    namespace = name.rpartition('/')[0]
    message = DiagnosticArray(
        status=[
            DiagnosticStatus(
                level=bytes([diagnosis.level]),
                name=name,
                message=diagnosis.message,
                hardware_id=f'{SUITE}/{namespace}' if namespace else SUITE,
                values=[KeyValue(key=key, value=value_text(value)) for key, value in diagnosis.values.items()],
            )
        ]
    )
    message.header.stamp = to_stamp(now_ns)
    return message


def diagnoses(message: Any) -> dict[str, Diagnosis]:
    """What the nodes say of themselves in a message of `/diagnostics`, by their names, namespaces included."""
    return {
        status.name: Diagnosis(
            Level(min(status.level[0], Level.STALE)),
            status.message,
            {pair.key: pair.value for pair in status.values},
        )
        for status in message.status
    }

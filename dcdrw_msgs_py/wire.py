"""Messages as bytes, in the common data representation (CDR) of DDS: for streams, in which only numbers change.

To make Python objects of a message costs several times as much as all else that is done to take it, or to publish it.
What is not laid out as was learned is left to rclpy.
"""

import struct
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from dcdrw_msgs_py.samples import SECOND

LITTLE_ENDIAN = b'\0\1\0\0'
"""How a serialized message begins; its alignment counts from after this."""
STAMP_SIZE = 8
"""Its first field, a stamp, in bytes."""

MOST_LAYOUTS = 4
"""Of so many sources, or of one that sends its joints in so many messages, the layouts are kept."""


class Stamp(NamedTuple):
    """A `builtin_interfaces/Time`."""

    sec: int
    nanosec: int


class Header(NamedTuple):
    """A `std_msgs/Header`."""

    stamp: Stamp
    frame_id: str


class JointNumbers(NamedTuple):
    """What a `sensor_msgs/JointState` says, by the same names."""

    header: Header
    name: Sequence[str]
    position: Sequence[float]
    velocity: Sequence[float]
    effort: Sequence[float]


class JointStateReader:
    """Reads the serialized joint states of one topic, whose sources seldom change names and lengths."""

    def __init__(self) -> None:
        self._layouts: list[_Layout] = []

    def __call__(self, data: bytes) -> Any:
        """The message, or what it says.

        Raises:
            RuntimeError: of rclpy, where the bytes are no such message.

        """
        for layout in self._layouts:
            if said := layout.read(data):
                return said
        message = deserialize_message(data, JointState)
        self._layouts = [_Layout(message), *self._layouts[: MOST_LAYOUTS - 1]]
        return message


class _Layout:
    """Where the numbers of messages like this one are among their bytes; what pads them may be anything."""

    def __init__(self, message: Any) -> None:
        self._frame, self._name = message.header.frame_id, list(message.name)
        self._format, self._size, self._constants = '<4siI', STAMP_SIZE, list[int | bytes]()
        self._add_text(self._frame)
        self._add_count(len(self._name))
        for name in self._name:
            self._add_text(name)
        self._add_count(len(message.position))
        self._first = 3 + len(self._constants)
        self._add_numbers(len(message.position))
        self._second = self._first + len(message.position)
        self._add_count(len(message.velocity))
        self._add_numbers(len(message.velocity))
        self._third = self._second + 1 + len(message.velocity)
        self._add_count(len(message.effort))
        self._add_numbers(len(message.effort))
        self._struct = struct.Struct(self._format)
        *names, self._velocities, self._efforts = self._constants
        self._names = tuple(names)

    def _add_count(self, count: int) -> None:
        self._add(-self._size % 4, 'I', 4)
        self._constants.append(count)

    def _add_text(self, text: str) -> None:
        encoded = text.encode() + b'\0'
        self._add_count(len(encoded))
        self._add(0, f'{len(encoded)}s', len(encoded))
        self._constants.append(encoded)

    def _add_numbers(self, count: int) -> None:
        if count:
            self._add(-self._size % 8, f'{count}d', 8 * count)

    def _add(self, padding: int, kind: str, size: int) -> None:
        self._format += f'{padding}x{kind}'
        self._size += padding + size

    def read(self, data: bytes) -> JointNumbers | None:
        """What a message says; None where it is laid out otherwise."""
        if len(data) < self._struct.size:  # more may follow: Fast DDS reckons the size of empty sequences too large
            return None
        values = self._struct.unpack_from(data)
        first, second, third = self._first, self._second, self._third
        if (
            values[0] != LITTLE_ENDIAN
            or values[3:first] != self._names
            or values[second] != self._velocities
            or values[third] != self._efforts
        ):
            return None
        return JointNumbers(
            Header(Stamp(values[1], values[2]), self._frame),
            self._name,
            values[first:second],
            values[second + 1 : third],
            values[third + 1 :],
        )


def _bytes_of(format_: str) -> Callable[..., bytes]:
    pack = struct.Struct('<4s' + format_).pack
    return lambda *values: pack(LITTLE_ENDIAN, *values)


float_bytes = _bytes_of('d')
"""A number as a serialized `std_msgs/Float64`."""
integer_bytes = _bytes_of('i')
"""A whole number as a serialized `std_msgs/Int32`."""
_wrench = _bytes_of('iII4x6d')


def wrench_bytes(stamp: int, force: float, torque: float = 0.0) -> bytes:
    """A force along x [N] and a torque about y [N·m] at a time [ns], as a serialized WrenchStamped without a frame."""
    sec, nanosec = divmod(stamp, SECOND)
    return _wrench(sec, nanosec, 1, force, 0.0, 0.0, 0.0, torque, 0.0)

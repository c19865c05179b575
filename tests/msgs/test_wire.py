"""Messages as bytes say what rclpy's own say."""

import struct

import pytest
from geometry_msgs.msg import Vector3, WrenchStamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int32

from dcdrw_msgs_py.messages import stamp_ns
from dcdrw_msgs_py.wire import JointStateReader, float_bytes, integer_bytes, wrench_bytes

NUMBER = st.floats(width=64)
NUMBERS = st.lists(NUMBER, max_size=5)
TEXT = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=9)
WHOLE = st.integers(-(2**31), 2**31 - 1)
STAMP = st.integers(0, 2**31 * 10**9 - 1)


@st.composite
def joint_states(draw) -> JointState:
    message = JointState(
        name=draw(st.lists(TEXT, max_size=4)), position=draw(NUMBERS), velocity=draw(NUMBERS), effort=draw(NUMBERS)
    )
    message.header.stamp.sec, message.header.stamp.nanosec = draw(WHOLE), draw(st.integers(0, 2**32 - 1))
    message.header.frame_id = draw(TEXT)
    return message


def bits(*numbers: float) -> bytes:
    """Numbers so that NaN equals itself."""
    return struct.pack(f'{len(numbers)}d', *numbers)


def said(message) -> tuple:
    """All that a JointState says."""
    stamp = message.header.stamp
    numbers = [bits(*each) for each in (message.position, message.velocity, message.effort)]
    return stamp.sec, stamp.nanosec, message.header.frame_id, list(message.name), *numbers


@given(st.lists(joint_states(), min_size=1, max_size=4), WHOLE, NUMBER)
def test_joint_states_are_read_as_rclpy_reads_them_whatever_changes_on_the_way(messages, sec, number):
    read = JointStateReader()
    for message in messages:
        assert said(read(serialize_message(message))) == said(message)
        message.header.stamp.sec = sec
        message.position = [number] * len(message.position)
    for message in messages:  # in turn, as of a source that sends its joints one by one
        again = read(serialize_message(message))
        assert said(again) == said(message)
        assert not isinstance(again, JointState), 'it is laid out as before, and rclpy was asked all the same'


def test_bytes_that_end_too_early_are_left_to_rclpy():
    read = JointStateReader()
    data = serialize_message(JointState(name=['wheel'], position=[1.0], velocity=[2.0]))
    read(data)
    with pytest.raises(RuntimeError):
        read(data[:30])


@given(NUMBER, NUMBER, WHOLE, STAMP)
def test_numbers_are_written_as_rclpy_reads_them(force, torque, whole, stamp):
    assert bits(deserialize_message(float_bytes(force), Float64).data) == bits(force)
    assert deserialize_message(integer_bytes(whole), Int32).data == whole
    message = deserialize_message(wrench_bytes(stamp, force, torque), WrenchStamped)
    assert (stamp_ns(message.header.stamp), message.header.frame_id) == (stamp, '')
    pushed, turned = message.wrench.force, message.wrench.torque
    assert bits(pushed.x, turned.y) == bits(force, torque)
    assert (Vector3(y=pushed.y, z=pushed.z), Vector3(x=turned.x, z=turned.z)) == (Vector3(), Vector3())

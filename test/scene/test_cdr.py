# SPDX-License-Identifier: MIT
"""Messages packed by hand are byte for byte those that rclpy serializes."""

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rigid_proto_ros.scene import cdr

pytest.importorskip("rclpy")
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String

from rigid_proto_ros.ros.commands import read_command
from rigid_proto_ros.session.messages import read_state

texts = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=40)
stamps = st.integers(0, 2**31 * 10**9 - 1)
doubles = st.floats(allow_nan=False)


def stamped(message_type, stamp_ns, frame_id):
    message = message_type()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    message.header.frame_id = frame_id
    return message


def zero_padded(data: bytes, *frames: str) -> bytes:
    """rclpy's bytes with the gaps after the frames, which it leaves as they were in memory, zeroed as ours are."""
    data, at = bytearray(data), 4 + 8
    for number, frame in enumerate(frames, 1):
        end = at + 4 + len(frame.encode()) + 1
        at = 4 + -(-(end - 4) // (8 if number == len(frames) else 4)) * (8 if number == len(frames) else 4)
        data[end:at] = bytes(at - end)
    return bytes(data)


def fill(target, values):
    target.x, target.y, target.z = values[:3]
    if len(values) == 4:
        target.w = values[3]


@settings(deadline=None)
@given(stamps, texts, st.tuples(*[doubles] * 6))
@example(0, "", (0.0,) * 6)
@example(1, "a", (-0.0,) * 6)
def test_a_wrench_is_the_serialized_message_and_read_back(stamp_ns, frame_id, values):
    message = stamped(WrenchStamped, stamp_ns, frame_id)
    fill(message.wrench.force, values[:3])
    fill(message.wrench.torque, values[3:])
    packed = cdr.wrench_stamped(stamp_ns, frame_id, values[:3], values[3:])
    assert packed == zero_padded(serialize_message(message), frame_id)
    assert cdr.read_stamped_doubles(packed, 6) == (*divmod(stamp_ns, 10**9), frame_id, values)


@settings(deadline=None)
@given(texts)
def test_a_string_is_the_serialized_message(text):
    assert cdr.string(text) == serialize_message(String(data=text))


@pytest.mark.parametrize("length", range(9))
def test_states_are_the_serialized_messages_for_frames_of_any_length(length):
    frame, child, time_ns = "world_frame"[:length], "x" * (length + 2), 12_345_678_901_234_567
    values = [0.1 * (k + 1) for k in range(13)]
    pose = stamped(PoseStamped, time_ns, frame)
    fill(pose.pose.position, values[:3])
    fill(pose.pose.orientation, values[3:7])
    assert cdr.stamped_doubles(time_ns, frame, values[:7]) == zero_padded(serialize_message(pose), frame)
    twist = stamped(TwistStamped, time_ns, frame)
    fill(twist.twist.linear, values[7:10])
    fill(twist.twist.angular, values[10:])
    assert cdr.stamped_doubles(time_ns, frame, values[7:]) == zero_padded(serialize_message(twist), frame)
    odometry = stamped(Odometry, time_ns, frame)
    odometry.child_frame_id = child
    odometry.pose.pose, odometry.twist.twist = pose.pose, twist.twist
    packed = cdr.odometry(time_ns, (frame, child), values)
    assert packed == zero_padded(serialize_message(odometry), frame, child)
    assert read_state("odom", packed, "odom") == (time_ns, values)


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=120))
def test_any_bytes_are_read_or_refused_like_rclpy_does(body):
    data = b"\x00\x01\x00\x00" + body
    try:
        read = read_command("wrench", data, ("world", "body"))
    except Exception:  # refused; by us or by rclpy
        return
    assert isinstance(read.stamp_ns, int) and isinstance(read.frame_id, str)
    assert len(read.force) == len(read.torque) == 3
    try:
        theirs = deserialize_message(data, WrenchStamped)
    except Exception:
        return
    assert theirs.header.stamp.sec * 10**9 + theirs.header.stamp.nanosec == read.stamp_ns

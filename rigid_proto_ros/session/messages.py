# SPDX-License-Identifier: MIT
"""The messages of a session: topics, types, definitions, encoding and decoding. Independent of ROS and of files.

A body's states are published on ``pose``, ``twist`` and ``odom``, each a stamp and a row of doubles. ``PROJECTIONS``
computes a topic's row from a state row, exactly as the node does, so that a recording compares bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from xml.sax.saxutils import escape

import numpy as np

from ..base.errors import InputError
from ..base.rotation import cross, rotate, rotate_inverse
from ..base.vectors import Attitude, vector
from ..motion.body import Body
from ..motion.loads import Load
from ..scene import cdr
from ..simulation.observer import STATE_FIELDS

_TIME = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec"
_HEADER = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id"
_VECTOR = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z"
_POINT = "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z"
_QUATERNION = "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w"
_POSE = "MSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation"
_TWIST = "MSG: geometry_msgs/Twist\nVector3 linear\nVector3 angular"
_WRENCH = "MSG: geometry_msgs/Wrench\nVector3 force\nVector3 torque"
_INERTIA = (
    "MSG: geometry_msgs/Inertia\nfloat64 m\ngeometry_msgs/Vector3 com\n"
    "float64 ixx\nfloat64 ixy\nfloat64 ixz\nfloat64 iyy\nfloat64 iyz\nfloat64 izz"
)
_TRANSFORMED = "MSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\nTransform transform"
_TRANSFORM = "MSG: geometry_msgs/Transform\nVector3 translation\nQuaternion rotation"
_SEPARATOR = "\n" + "=" * 80 + "\n"


def _definition(*parts: str) -> str:
    """A definition followed by those of its nested types, as bags store them."""
    return _SEPARATOR.join(parts) + "\n"


DEFINITIONS = {
    "std_msgs/msg/String": _definition("string data"),
    "geometry_msgs/msg/PoseStamped": _definition(
        "std_msgs/Header header\nPose pose", _HEADER, _TIME, _POSE, _POINT, _QUATERNION
    ),
    "geometry_msgs/msg/TwistStamped": _definition(
        "std_msgs/Header header\nTwist twist", _HEADER, _TIME, _TWIST, _VECTOR
    ),
    "geometry_msgs/msg/WrenchStamped": _definition(
        "std_msgs/Header header\nWrench wrench", _HEADER, _TIME, _WRENCH, _VECTOR
    ),
    "geometry_msgs/msg/InertiaStamped": _definition(
        "std_msgs/Header header\nInertia inertia", _HEADER, _TIME, _INERTIA, _VECTOR
    ),
    "tf2_msgs/msg/TFMessage": _definition(
        "geometry_msgs/TransformStamped[] transforms", _TRANSFORMED, _HEADER, _TIME, _TRANSFORM, _VECTOR, _QUATERNION
    ),
}
"""Message definitions (ros2msg) of the recorded topics."""

TOPICS = {
    "scene": "std_msgs/msg/String",
    "events": "std_msgs/msg/String",
    "pose": "geometry_msgs/msg/PoseStamped",
    "twist": "geometry_msgs/msg/TwistStamped",
    "applied": "geometry_msgs/msg/WrenchStamped",
    "inertia": "geometry_msgs/msg/InertiaStamped",
    "robot_description": "std_msgs/msg/String",
    "/tf": "tf2_msgs/msg/TFMessage",
}
"""Recorded topics of a session and their types; topics without a leading / are in the node's private namespace. The
last two are for viewers of bags and are never read back.
"""

TRANSFORM_NS = 33_333_333
"""Shortest simulated time between two transforms of a recording [ns]."""

STATE_DEPTH, EVENT_DEPTH = 10, 1000
"""Queue depths of the node's publishers of states and of events."""

LATCHED = frozenset({"scene", "inertia", "robot_description"})
"""Topics whose last message is sent to later subscribers."""


def offered_qos(name: str) -> str:
    """Quality of service of a topic's publisher in the node, as rosbag2 writes it into a channel's metadata
    (``offered_qos_profiles``, format 9, of Jazzy), so that a replay of the bag latches the same topics.
    """
    depth = 1 if name in LATCHED else STATE_DEPTH if name in PROJECTIONS else EVENT_DEPTH
    durability = "transient_local" if name in LATCHED else "volatile"
    for_ever = "\n    sec: 9223372036\n    nsec: 854775807"
    policies = {
        "history": " keep_last",
        "depth": f" {depth}",
        "reliability": " reliable",
        "durability": f" {durability}",
        "deadline": for_ever,
        "lifespan": for_ever,
        "liveliness": " automatic",
        "liveliness_lease_duration": for_ever,
        "avoid_ros_namespace_conventions": " false",
    }
    return "- " + "\n  ".join(f"{name}:{value}" for name, value in policies.items())


READ = {name: TOPICS[name] for name in ("scene", "events", "pose", "twist")} | {"odom": "nav_msgs/msg/Odometry"}
"""Topics that a session is read from."""

MADE_WITH = "rigid_proto_ros"
"""Name of the metadata with the processor and the versions of the recording."""

FLOOR = "accuracy_floor of run {}"
"""Name of the metadata, by the run's number from 0, with the reason why the run is held to less than its accuracy."""


def pose_row(row: list[float]) -> list[float]:
    """(7,): position, then the attitude xyzw."""
    return row[:7]


def twist_row(row: list[float]) -> list[float]:
    """(6,): velocity of the COM, then angular velocity, both in world axes."""
    return [*row[7:10], *rotate(*row[3:7], *row[10:13])]


def odom_row(row: list[float]) -> list[float]:
    """(13,): the pose, then velocity and angular velocity in body axes."""
    q = row[3:7]
    return [*row[:7], *rotate(-q[0], -q[1], -q[2], q[3], *row[7:10]), *row[10:13]]


PROJECTIONS: dict[str, Callable[[list[float]], list[float]]] = {"pose": pose_row, "twist": twist_row, "odom": odom_row}
"""Functions from a state row (13 floats, in the order of ``STATE_FIELDS`` in simulation/observer.py) to the row of each
state topic.
"""

_TWIST_FIELDS = tuple(f"{part}.{axis}" for part in ("linear", "angular") for axis in "xyz")
FIELDS = {
    "": STATE_FIELDS,
    "pose": STATE_FIELDS[:7],
    "twist": _TWIST_FIELDS,
    "odom": (*STATE_FIELDS[:7], *_TWIST_FIELDS),
}
"""Names of the elements of each topic's row, and of the state row (topic "")."""

_DOUBLES = {"pose": 7, "twist": 6, "odom": cdr.ODOMETRY_DOUBLES}


def read_string(data: bytes, topic: str) -> str:
    """The text of a std_msgs/String; raises InputError."""
    try:
        return cdr.read_string(data)
    except ValueError:
        raise _undecodable(topic, "std_msgs/msg/String") from None


def read_stamp(data: bytes, topic: str) -> int:
    """Stamp [ns] of a message of a state topic; raises InputError."""
    try:
        seconds, nanoseconds = cdr.read_stamp(data)
    except ValueError:
        raise _undecodable(topic, READ[topic.rpartition("/")[2]]) from None
    return seconds * 1_000_000_000 + nanoseconds


def read_state(name: str, data: bytes, topic: str) -> tuple[int, list[float]]:
    """Stamp [ns] and row of a message of the state topic ``name``; raises InputError."""
    try:
        seconds, nanoseconds, _, values = cdr.read_stamped_doubles(data, _DOUBLES[name], name == "odom")
    except ValueError:
        raise _undecodable(topic, READ[name]) from None
    if name == "odom":
        values = values[:7] + values[cdr.ODOMETRY_TWIST]
    return seconds * 1_000_000_000 + nanoseconds, list(values)


def _undecodable(topic: str, message_type: str) -> InputError:
    return InputError(topic, f"a message can't be decoded as {message_type} in little-endian CDR")


def inertia_bytes(time_ns: int, body_frame: str, body: Body) -> bytes:
    """A geometry_msgs/InertiaStamped: COM in scaled mesh coordinates, tensor about the COM in mesh axes."""
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = body.inertia.tolist()
    numbers = (body.mass, *body.center_of_mass.tolist(), ixx, ixy, ixz, iyy, iyz, izz)
    return cdr.stamped_doubles(time_ns, f"{body_frame}/mesh", numbers)


def transform_bytes(time_ns: int, frames: tuple[str, str], pose: list[float]) -> bytes:
    """A tf2_msgs/TFMessage of one transform: pose (7,) of the second frame in the first."""
    layout = cdr.Layout()
    layout.pack("I", 1)
    layout.pack("iI", *divmod(time_ns, 1_000_000_000))
    for frame in frames:
        layout.string(frame)
    layout.pack("7d", *pose)
    return bytes(layout.data)


def description(body_frame: str, body: Body, mesh: str) -> str:
    """The body as URDF, for viewers: a link with its origin at the COM, drawn as the mesh with this URI, if any."""
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = body.inertia.tolist()
    name, place = escape(body_frame, {'"': "&quot;"}), " ".join(map(str, (-body.center_of_mass).tolist()))
    scale = " ".join(map(str, body.scale.tolist()))
    drawn = (
        f'<visual><origin xyz="{place}"/><geometry><mesh filename="{mesh}" scale="{scale}"/></geometry></visual>'
        if mesh
        else ""
    )
    inertia = f'ixx="{ixx}" ixy="{ixy}" ixz="{ixz}" iyy="{iyy}" iyz="{iyz}" izz="{izz}"'
    return (
        f'<robot name="{name}"><link name="{name}"><inertial><mass value="{body.mass}"/><inertia {inertia}/></inertial>'
        f"{drawn}</link></robot>"
    )


def applied_bytes(time_ns: int, body_frame: str, load: Load, body: Body, attitude: Attitude) -> bytes:
    """A geometry_msgs/WrenchStamped of a load that started to act at ``attitude`` (4,) xyzw, in the body frame: origin
    at the COM, axes of the mesh.
    """
    force, torque, arm = load.force, load.torque, load.arm(body)
    if load.axes == "world":
        x, y, z, w = attitude.tolist()
        force, torque = rotate_inverse(x, y, z, w, *force), rotate_inverse(x, y, z, w, *torque)
    else:
        force = vector(load.own_force(body))
    return cdr.wrench_stamped(time_ns, body_frame, force, vector(np.asarray(torque) + cross(arm, force)))

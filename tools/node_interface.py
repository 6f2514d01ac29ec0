# SPDX-License-Identifier: MIT
"""The node's topics and services, listed once for the docs. A test checks the list against the graph of the running
node.
"""

from __future__ import annotations

from dataclasses import dataclass

SUBSCRIBED, PUBLISHED, SERVED = "subscribed", "published", "served"


@dataclass(frozen=True)
class Interface:
    """name: as in ROS, with ``~/`` for the node's own name. direction: SUBSCRIBED, PUBLISHED or SERVED.
    type: ``package/msg/Type``. on_request: the parameter, or group of parameters, that switches it on; empty if it
    always exists.
    """

    name: str
    direction: str
    type: str
    meaning: str
    on_request: str = ""


def _topic(direction: str, name: str, type: str, meaning: str, on_request: str = "") -> Interface:
    package, message = type.split("/")
    return Interface(name, direction, f"{package}/msg/{message}", meaning, on_request)


def _service(name: str, type: str, meaning: str) -> Interface:
    return Interface(name, SERVED, f"std_srvs/srv/{type}", meaning)


INTERFACES = (
    _topic(
        SUBSCRIBED,
        "~/wrench",
        "geometry_msgs/WrenchStamped",
        "held wrench: each message replaces the previous wrench of the same `;slot=<name>`, or the previous one "
        "without a slot; it ends `wrench_timeout` after the last message, or after its own `;duration=<s>`",
    ),
    _topic(
        SUBSCRIBED,
        "~/thrusters",
        "std_msgs/Float64MultiArray",
        "forces [N] of the thrusters, in the alphabetical order of their names; they act until the next message, or "
        "until `wrench_timeout` after the last one",
        "thrusters",
    ),
    _topic(
        SUBSCRIBED,
        "~/poke",
        "geometry_msgs/WrenchStamped",
        "pulse: each message adds one; it lasts `poke_duration`, or the `;duration=<s>` of its frame",
    ),
    _topic(
        SUBSCRIBED,
        "~/string/target",
        "geometry_msgs/PointStamped",
        "position of the string's free end; the first message ties the string, which is released `string.timeout` "
        "after the last",
    ),
    _topic(
        SUBSCRIBED,
        "~/string/attach",
        "geometry_msgs/PointStamped",
        "point of the body where the string is tied, moved to the nearest point of the surface; frames `world`, `body` "
        "(m from the COM), `<body_frame>/mesh`",
    ),
    _topic(
        SUBSCRIBED,
        "~/inertia/set",
        "geometry_msgs/InertiaStamped",
        "mass, COM and tensor of the whole body; the inertia model becomes `explicit`, and the parameters are updated",
    ),
    _topic(
        SUBSCRIBED,
        "~/schedule",
        "std_msgs/String",
        "one entry of a poke script as YAML, or a list of entries, which is accepted or refused as a whole and may begin "
        "with a reset; `t` is absolute simulated time in seconds",
    ),
    _topic(PUBLISHED, "~/pose", "geometry_msgs/PoseStamped", "COM and attitude of the mesh's axes, in the world"),
    _topic(
        PUBLISHED,
        "~/twist",
        "geometry_msgs/TwistStamped",
        "velocity of the COM and angular velocity, both in world axes",
    ),
    _topic(PUBLISHED, "~/odom", "nav_msgs/Odometry", "pose and twist; its twist is in body axes"),
    _topic(
        PUBLISHED,
        "~/imu",
        "sensor_msgs/Imu",
        "attitude, angular velocity and specific force in body axes, at the contact `imu_contact` (then `frame_id` is "
        "`<body_frame>/<contact>`) or the COM",
    ),
    _topic(
        PUBLISHED,
        "~/marker",
        "visualization_msgs/Marker",
        "the mesh at its pose in the world, 30 times a second of the wall clock, for RViz and Foxglove; of more than "
        "5,000 triangles the address of its file, or the boxes of its parts",
    ),
    _topic(
        PUBLISHED,
        "~/inertia",
        "geometry_msgs/InertiaStamped",
        "latched: mass, COM (scaled mesh coordinates) and tensor about it (mesh axes)",
    ),
    _topic(
        PUBLISHED,
        "~/applied",
        "geometry_msgs/WrenchStamped",
        "each wrench and poke when it takes effect, about the COM, in the body's frame at that time; the line with the "
        "same time on `~/events` has point, axes, slot and duration",
    ),
    _topic(
        PUBLISHED,
        "~/events",
        "std_msgs/String",
        "one JSON line for each command, parameter change and service call when it is applied, with a running SHA-256",
    ),
    _topic(
        PUBLISHED,
        "~/scene",
        "std_msgs/String",
        "latched: all parameters and the mesh's hash, as a scene that starts the same simulation",
    ),
    _topic(
        PUBLISHED,
        "/diagnostics",
        "diagnostic_msgs/DiagnosticArray",
        "once a second: counters, energies, |L| and its drift, refused commands by reason",
    ),
    _topic(PUBLISHED, "/clock", "rosgraph_msgs/Clock", "simulated time", "publish_clock"),
    _topic(PUBLISHED, "/tf", "tf2_msgs/TFMessage", "world to body, if tf2_msgs is installed", "publish_tf"),
    _topic(
        PUBLISHED,
        "/tf_static",
        "tf2_msgs/TFMessage",
        "body to `<body_frame>/mesh` and `<body_frame>/<contact>`, again at every change",
        "publish_tf",
    ),
    _service(
        "~/reset",
        "Trigger",
        "time 0 and the initial state; wrench, pulses and schedule are dropped",
    ),
    _service(
        "~/pause",
        "SetBool",
        "true stops simulated time; false lets it run",
    ),
    _service(
        "~/step",
        "Trigger",
        "while paused: takes all commands that have arrived, advances one publication period and responds when "
        "its state is published",
    ),
    _service("~/clear_wrench", "Trigger", "ends the held wrench and the running pulses"),
    _service("~/string/release", "Trigger", "releases the string"),
)

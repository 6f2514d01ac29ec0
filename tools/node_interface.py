# SPDX-License-Identifier: MIT
"""The node's topics and services, listed once for the docs; a test proves that the running node's graph
is this list.
"""

from __future__ import annotations

from dataclasses import dataclass

SUBSCRIBED, PUBLISHED, SERVED = "subscribed", "published", "served"


@dataclass(frozen=True)
class Interface:
    """name: as ROS resolves it, ``~/`` standing for the node's own name. direction: SUBSCRIBED, PUBLISHED or SERVED.
    type: ``package/msg/Type``. on_request: the parameter, or their group, that switches it on; empty when it is
    always there.
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
        "held wrench: each message replaces the one before of the same `;slot=<name>`, or without one; it ends "
        "`wrench_timeout` after the last, or after its own `;duration=<s>`",
    ),
    _topic(
        SUBSCRIBED,
        "~/thrusters",
        "std_msgs/Float64MultiArray",
        "forces [N] of the thrusters, in the alphabetical order of their names; until the next message, or "
        "`wrench_timeout` after the last",
        "thrusters",
    ),
    _topic(
        SUBSCRIBED,
        "~/poke",
        "geometry_msgs/WrenchStamped",
        "pulse: each message adds one that lasts `poke_duration`, or what its frame says",
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
        "where on the body the string is tied, moved to the nearest point of the surface; frames `world`, `body` "
        "(m from the COM), `<body_frame>/mesh`",
    ),
    _topic(
        SUBSCRIBED,
        "~/inertia/set",
        "geometry_msgs/InertiaStamped",
        "mass, COM and tensor of the whole body; the model becomes `explicit` and the parameters follow",
    ),
    _topic(
        SUBSCRIBED,
        "~/schedule",
        "std_msgs/String",
        "one entry of a poke script as YAML, or a list of entries, taken or refused as a whole; `t` in absolute "
        "simulated seconds",
    ),
    _topic(PUBLISHED, "~/pose", "geometry_msgs/PoseStamped", "COM and attitude of the mesh's axes, in the world"),
    _topic(
        PUBLISHED,
        "~/twist",
        "geometry_msgs/TwistStamped",
        "velocity of the COM and angular velocity, both in world axes",
    ),
    _topic(PUBLISHED, "~/odom", "nav_msgs/Odometry", "both; its twist is in body axes"),
    _topic(
        PUBLISHED,
        "~/imu",
        "sensor_msgs/Imu",
        "attitude, angular velocity and specific force in body axes, at the contact `imu_contact` (then `frame_id` is "
        "`<body_frame>/<contact>`) or the COM",
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
        "each wrench and poke as it takes effect: about the COM, in the body's frame at that time; the line of the "
        "same time on `~/events` has point, axes, slot and duration",
    ),
    _topic(
        PUBLISHED,
        "~/events",
        "std_msgs/String",
        "one JSON line per command, change and service as applied, with a running SHA-256",
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
        "once a second: counters, energies, |L| and its drift, what was refused and why",
    ),
    _topic(PUBLISHED, "/clock", "rosgraph_msgs/Clock", "simulated time", "publish_clock"),
    _topic(PUBLISHED, "/tf", "tf2_msgs/TFMessage", "world to body, where tf2_msgs is installed", "publish_tf"),
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
        "while paused: takes all commands that have arrived, advances one publication period and answers when "
        "its state is published",
    ),
    _service("~/clear_wrench", "Trigger", "ends the held wrench and the running pulses"),
    _service("~/string/release", "Trigger", "releases the string"),
)

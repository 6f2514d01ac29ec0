# SPDX-License-Identifier: MIT
"""A real node with a client that watches and commands it, shared by tests; and the messages that they send."""

from __future__ import annotations

from pathlib import Path

from rcl_interfaces.srv import DescribeParameters
from ros_client import COMMANDS, RosClient
from ros_process import start_node


def stamped(stamp_ns: int, frame_id: str, **content) -> dict:
    """A message with a header, as a dict."""
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    return {"header": {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame_id}, **content}


def vector(values) -> dict:
    return dict(zip("xyz", (float(v) for v in values), strict=True))


def wrench_message(stamp_ns: int, frame_id: str, force=(0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0)) -> dict:
    """A WrenchStamped."""
    return stamped(stamp_ns, frame_id, wrench={"force": vector(force), "torque": vector(torque)})


def point_message(stamp_ns: int, frame_id: str, point) -> dict:
    """A PointStamped."""
    return stamped(stamp_ns, frame_id, point=vector(point))


def inertia_message(stamp_ns: int, frame_id: str, mass: float, com, tensor) -> dict:
    """An InertiaStamped; tensor ixx ixy ixz iyy iyz izz."""
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    content = {"m": float(mass), "com": vector(com), **{n: float(v) for n, v in zip(names, tensor, strict=True)}}
    return stamped(stamp_ns, frame_id, inertia=content)


SCENE = {
    "mesh": "t_handle",
    "density": 7850.0,
    "integrator": "rk4",
    "initial.angular_velocity": [0.05, 0.1, 12.0],
    "contacts.tip": [0.0, 0.0, 0.07],
    "contacts.left": [0.0, -0.05, 0.0],
    "thrusters.a": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
}
"""What the shared node flies."""


class Commanded(RosClient):
    """A node, and a client that listens to all it says and can publish all it takes. ``sent`` counts commands."""

    def __init__(self, environment: dict, folder: Path) -> None:
        self.scene = SCENE
        self.sent = 0
        self.node_process = start_node(environment, folder / "node", SCENE, name="often_reporting_node")
        try:
            super().__init__(environment)
            self.node_process.wait_for("is simulating")
            self.listen("pose", "twist", "odom", "inertia", "applied", "events", "scene", "/diagnostics")
            self.advertise(*COMMANDS)
            self.diagnostics()
            names = [n for n in self.names() if not n.startswith(("qos_overrides", "use_sim_time", "start_type"))]
            descriptors = self.call("describe_parameters", DescribeParameters, names=names).descriptors
            self.first_values = self.get(*(d.name for d in descriptors if not d.read_only))
        except BaseException:
            self.node_process.end()
            raise

    def publish(self, topic: str, *messages: dict | bytes, rate: float = 0.0) -> None:
        super().publish(topic, *messages, rate=rate)
        if topic in COMMANDS:
            self.sent += len(messages)

    def restore(self) -> None:
        """First parameters, time 0, running; nothing heard."""
        # Whatever an earlier test has sent must have arrived, or it would act in this one.
        self.until_received(self.sent)
        (answer,) = self.set_named(self.first_values, atomically=True)
        assert answer[0], answer
        for name in self.names():
            if name.startswith("ballast."):
                self.set_named({name: [0.0, 0.0, 0.0, 0.0]})
        self.forget("events")
        self.start_over(paused=False)

    def stand(self) -> int:
        """Pause; the time that stands [ns], once all states from before have been heard: one topic may be far behind
        another on a busy machine, but each keeps its order, and a paused node says its state again and again.
        """
        self.pause(True)
        standing_ns = int(self.diagnostics()["sim_time_ns"])
        for topic in ("pose", "twist", "odom"):
            self.until(lambda topic=topic: self.newest_ns(topic) == standing_ns, "state of the time that stands")
        return standing_ns

    def start_over(self, paused: bool) -> None:
        """Time 0, paused or running; nothing heard of what was before."""
        self.stand()
        self.forget("pose", "twist", "odom")
        resets = len(self.events("reset"))
        self.trigger("reset")
        self.until(lambda: len(self.events("reset")) > resets, "the reset")
        # While paused states come at 10 Hz: once one of time 0 is here, no older one can follow.
        for topic in ("pose", "twist", "odom"):
            self.until(lambda topic=topic: self.newest_ns(topic) == 0, "state of time 0")
        self.forget("pose", "twist", "odom", "applied", "events")
        if not paused:
            self.pause(False)
            self.until(lambda: self.events("pause"), "the start")
            self.forget("events")

    def counters(self) -> dict[str, int]:
        """All whole-number counters of a report that has everything sent so far, and its consequences."""
        self.until_received(self.sent)
        return {key: int(value) for key, value in self.diagnostics().items() if str(value).lstrip("-").isdigit()}

    def gained(self, before: dict[str, int], *more: str) -> dict[str, int]:
        """Counters that rose since ``before``, of commands and refusals."""
        after = self.counters()
        kinds = ("refused_", "late", "wall_stamp", "messages_lost", "queue_full", *more)
        return {k: v - before[k] for k, v in after.items() if k.startswith(kinds) and v != before.get(k)}

    def wait_event(self, kind: str, count: int = 1) -> list[dict]:
        """The events of a kind since the test began, once there are ``count``."""
        return self.until(lambda: len(e := self.events(kind)) >= count and e, f"{count} events {kind}")

    def state_at(self, time_ns: int) -> tuple[dict, dict]:
        """Pose and twist as published with this stamp."""

        def both():
            pose, twist = (self.heard(topic, last=1, stamp=time_ns) for topic in ("pose", "twist"))
            return (pose[0], twist[0]) if pose and twist else None

        return self.until(both, f"a state at {time_ns} ns")

    def close(self) -> None:
        super().close()
        self.node_process.end()

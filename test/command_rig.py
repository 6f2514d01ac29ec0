# SPDX-License-Identifier: MIT
"""Real nodes and ROS clients as processes, for tests. Each is ended by its own pid."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
import time
from pathlib import Path

from ros_process import READY_S, RosProcess

from rigid_proto_ros.base.rotation import rotate

TEST_FOLDER = Path(__file__).parent
TYPES = {
    "wrench": "WrenchStamped",
    "poke": "WrenchStamped",
    "string/target": "PointStamped",
    "string/attach": "PointStamped",
    "inertia/set": "InertiaStamped",
    "schedule": "String",
    "thrusters": "Float64MultiArray",
    "pose": "PoseStamped",
    "twist": "TwistStamped",
    "odom": "Odometry",
    "imu": "Imu",
    "inertia": "InertiaStamped",
    "applied": "WrenchStamped",
    "events": "String",
    "scene": "String",
}
COMMANDS = ("wrench", "poke", "string/target", "string/attach", "inertia/set", "schedule")
STATES = ("pose", "twist")
LATCHED = ("inertia", "scene")


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


def stamp_ns(message: dict) -> int:
    """The header's stamp [ns]."""
    stamp = message["header"]["stamp"]
    return stamp["sec"] * 1_000_000_000 + stamp["nanosec"]


class NodeProcess(RosProcess):
    """A ``rigid_body_node`` with these parameters; ``log`` is what it says on stderr."""

    def __init__(
        self,
        environment: dict,
        log: Path,
        values: dict | None = None,
        *ros_arguments: str,
        name: str = "rigid_body_node",
    ) -> None:
        self.log = log.with_suffix(".err")
        given = [part for n, v in (values or {}).items() for part in ("-p", f"{n}:={_text(v)}")]
        super().__init__(name, "--ros-args", *given, *ros_arguments, environment=environment, log=log)

    @property
    def alive(self) -> bool:
        return self.process.poll() is None

    def stop(self) -> int:
        """Ask it to end; returns the exit status."""
        return self.end()


class RosClient:
    """A process of test/ros_client.py, and short ways to talk to one node through it."""

    def __init__(self, environment: dict, node: str = "/rigid_body") -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(TEST_FOLDER / "ros_client.py")],
            env=environment,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self.node = node

    def __enter__(self) -> RosClient:
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def meet(self) -> None:
        """Hear the node's states and reports from now on, and be ready to command it."""
        self.listen(*STATES)
        self.watch_diagnostics()
        self.advertise(*COMMANDS)

    def send(self, do: str, **job) -> None:
        """Ask for something without waiting for the answer; ``answer`` fetches it."""
        self.process.stdin.write(json.dumps({"do": do, **job}) + "\n")
        self.process.stdin.flush()

    def answer(self):
        line = self.process.stdout.readline()
        assert line, "the client process has ended"
        answer = json.loads(line)
        assert "failed" not in answer, answer["failed"]
        return answer["done"]

    def do(self, do: str, **job):
        self.send(do, **job)
        return self.answer()

    def name(self, topic: str) -> str:
        return topic if topic.startswith("/") else f"{self.node}/{topic}"

    def listen(self, *topics: str) -> None:
        for topic in topics:
            self.do("listen", topic=self.name(topic), type=TYPES[topic], latched=topic in LATCHED)

    def heard(self, topic: str, last: int = 0, stamp: int | None = None, after: int | None = None) -> list[dict]:
        return self.do("heard", topic=self.name(topic), last=last, stamp=stamp, after=after)

    def forget(self, *topics: str) -> None:
        """Drop what was heard."""
        self.do("forget", topics=[self.name(topic) for topic in topics])

    def heard_count(self, topic: str) -> int:
        return self.do("heard_count", topic=self.name(topic))

    def advertise(self, *topics: str) -> None:
        for topic in topics:
            self.do("advertise", topic=self.name(topic), type=TYPES[topic])

    def publish(self, topic: str, *messages: dict) -> None:
        self.do("publish", topic=self.name(topic), messages=list(messages))

    def schedule(self, *entries: str) -> None:
        self.publish("schedule", *({"data": entry} for entry in entries))

    def trigger(self, service: str) -> dict:
        return self.do("call", service=self.name(service), type="Trigger")

    def pause(self, paused: bool) -> dict:
        return self.do("call", service=self.name("pause"), type="SetBool", request={"data": paused})

    def set(self, atomically: bool = False, **values) -> list:
        """Parameters by name, double underscores for dots; [[successful, reason]]."""
        return self.set_named({n.replace("__", "."): v for n, v in values.items()}, atomically)

    def set_named(self, values: dict, atomically: bool = False) -> list:
        pairs = [[name, _alike(value)] for name, value in values.items()]
        return self.do("set_parameters", node=self.node, values=pairs, atomically=atomically)

    def get(self, *names: str) -> dict:
        return self.do("get_parameters", node=self.node, names=list(names))

    def names(self) -> list[str]:
        """All parameters of the node."""
        answer = self.do("call", service=self.name("list_parameters"), type="ListParameters")
        return answer["result"]["names"]

    def watch_diagnostics(self) -> None:
        self.do("listen", topic="/diagnostics", type="DiagnosticArray", depth=100)

    def all_diagnostics(self, last: int = 0, after: int | None = None) -> list[dict]:
        """Reports of the node so far, among the ``last`` or those made after a time of the system's clock [ns].

        Each as keys and values, with ``level``, ``message``, ``name`` and ``stamp_ns``.
        """
        reports = []
        for message in self.heard("/diagnostics", last=last, after=after):
            for status in message["status"]:
                if status["name"] == f"{self.node}: simulation":
                    values = {entry["key"]: entry["value"] for entry in status["values"]}
                    said = {k: status[k] for k in ("level", "message", "name")}
                    reports.append({**values, **said, "stamp_ns": stamp_ns(message)})
        return reports

    def diagnostics(self) -> dict:
        """A report of what is so after this call began: it is stamped before its values are read."""
        asked_ns = time.time_ns()
        return self.until(lambda: self.all_diagnostics(after=asked_ns), "diagnostics")[0]

    def until(self, condition, what: str, timeout_s: float = READY_S):
        """Wait for a condition; returns its value."""
        deadline = time.monotonic() + timeout_s
        while not (found := condition()):
            assert time.monotonic() < deadline, f"no {what} within {timeout_s} s"
            time.sleep(0.02)
        return found

    def until_received(self, count: int, topic: str = "commands") -> dict:
        """The first report that has received so many commands since the counters were read."""

        def covered():
            reports = self.all_diagnostics(last=5)
            return reports and int(reports[-1][f"{topic}_received"]) >= count and reports[-1]

        return self.until(covered, f"{count} {topic} received")

    def events(self) -> list[dict]:
        return [json.loads(message["data"]) for message in self.heard("events")]

    def now_ns(self) -> int:
        """The stamp of the newest state heard on pose."""
        return stamp_ns(self.until(lambda: self.heard("pose", last=1), "a state")[-1])

    def runs(self) -> int:
        """How often simulated time has begun anew in the states heard, on every topic."""
        stamps = [self.do("stamps", topic=self.name(topic)) for topic in STATES]
        return min(sum(b < a for a, b in itertools.pairwise(own)) for own in stamps)

    def reset(self) -> None:
        """Time 0, and states heard that were published since; some must have been heard before."""
        self.fly_until(1)
        before = self.runs()
        assert self.trigger("reset")["success"]
        self.until(lambda: self.runs() > before, "states since the reset")

    def fly_until(self, time_ns: int) -> None:
        """Wait until the newest states heard have reached ``time_ns``."""

        def reached() -> bool:
            newest = [self.heard(topic, last=1) for topic in STATES]
            return all(messages and stamp_ns(messages[0]) >= time_ns for messages in newest)

        self.until(reached, f"states at {time_ns} ns")

    def rows(self) -> dict[str, dict[int, list[float]]]:
        """Pose [p, q] and twist [v, ω] heard since simulated time last began anew, by stamp [ns]."""
        found: dict[str, dict[int, list[float]]] = {topic: {} for topic in STATES}
        for topic, parts in (("pose", ("position", "orientation")), ("twist", ("linear", "angular"))):
            for message in self.heard(topic):
                time_ns = stamp_ns(message)
                if found[topic] and time_ns < max(found[topic]):
                    found[topic].clear()
                found[topic][time_ns] = [x for part in parts for x in message[topic][part].values()]
        return found

    def close(self) -> None:
        self.process.stdin.close()
        try:
            self.process.wait(timeout=READY_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def _alike(value):
    """A list of whole numbers and doubles as one of doubles: rclpy takes no mixed ones."""
    mixed = isinstance(value, (list, tuple)) and {type(x) for x in value} == {int, float}
    return [float(x) for x in value] if mixed else value


def published(row) -> tuple[list[float], list[float]]:
    """What pose and twist carry for a state row (13,)."""
    row = row.tolist()
    return row[:7], [*row[7:10], *rotate(*row[3:7], *row[10:13])]


def _text(value) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return json.dumps(value)


UNSTAMPED = {"header": {"stamp": {"sec": -1, "nanosec": 0}}}

SCENE = {
    "mesh": "t_handle",
    "density": 7850.0,
    "integrator": "rk4",
    "initial.angular_velocity": [0.05, 0.1, 12.0],
    "contacts.tip": [0.0, 0.0, 0.07],
    "contacts.left": [0.0, -0.05, 0.0],
}
"""What the shared node flies."""


class Commanded(RosClient):
    """A node, and a client that listens to all it says and can publish all it takes. ``sent`` counts commands."""

    def __init__(self, environment: dict, folder: Path, node: str = "/rigid_body", scene: dict = SCENE) -> None:
        self.environment = environment
        self.folder = folder
        self.scene = scene
        self.sent = 0
        self.node_process = NodeProcess(environment, folder / "node.log", scene, name="often_reporting_node")
        try:
            super().__init__(environment, node)
            self.node_process.wait_for("is simulating")
            self.listen("pose", "twist", "odom", "inertia", "applied", "events", "scene")
            self.watch_diagnostics()
            self.advertise(*COMMANDS)
            self.diagnostics()
            # The clients of services used most, matched once.
            self.pause(False)
            names = [n for n in self.names() if not n.startswith(("qos_overrides", "use_sim_time", "start_type"))]
            described = self.do(
                "call", service=self.name("describe_parameters"), type="DescribeParameters", request={"names": names}
            )
            live = [d["name"] for d in described["descriptors"] if not d["read_only"]]
            self.first_values = self.get(*live)
        except BaseException:
            self.node_process.stop()
            raise

    def publish(self, topic: str, *messages: dict) -> None:
        super().publish(topic, *messages)
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

    def start_over(self, paused: bool) -> None:
        """Time 0, paused or running; nothing heard of what was before."""
        self.pause(True)
        self.forget("pose", "twist", "odom")
        resets = len([event for event in self.events() if event["kind"] == "reset"])
        self.trigger("reset")
        self.until(lambda: len([e for e in self.events() if e["kind"] == "reset"]) > resets, "the reset")
        # While paused states come at 10 Hz: once one of time 0 is here, no older one can follow.
        for topic in ("pose", "twist", "odom"):
            self.until(lambda topic=topic: stamp_ns((self.heard(topic, last=1) or [UNSTAMPED])[0]) == 0, "time 0")
        self.forget("pose", "twist", "odom", "applied", "events")
        if not paused:
            self.pause(False)
            self.until(lambda: [e for e in self.events() if e["kind"] == "pause"], "the start")
            self.forget("events")

    def counters(self) -> dict[str, int]:
        """All whole-number counters of a report that has everything sent so far, and its consequences."""
        self.until_received(self.sent)
        return self.counters_now()

    def counters_now(self) -> dict[str, int]:
        """All whole-number counters now."""
        report = self.diagnostics()
        return {key: int(value) for key, value in report.items() if str(value).lstrip("-").isdigit()}

    def gained(self, before: dict[str, int], *more: str) -> dict[str, int]:
        """Counters that rose since ``before``, of commands and refusals."""
        after = self.counters()
        kinds = ("refused_", "late", "wall_stamp", "messages_lost", "queue_full", *more)
        return {k: v - before[k] for k, v in after.items() if k.startswith(kinds) and v != before.get(k)}

    def wait_event(self, kind: str, count: int = 1) -> list[dict]:
        """The first ``count`` events of a kind since the test began."""

        def found():
            events = [event for event in self.events() if event["kind"] == kind]
            return events[: max(count, len(events))] if len(events) >= count else None

        return self.until(found, f"{count} events {kind}")

    def state_at(self, time_ns: int) -> tuple[dict, dict]:
        """Pose and twist as published with this stamp."""

        def both():
            pose, twist = (self.heard(topic, last=1, stamp=time_ns) for topic in ("pose", "twist"))
            return (pose[0], twist[0]) if pose and twist else None

        return self.until(both, f"a state at {time_ns} ns")

    def close(self) -> None:
        super().close()
        self.node_process.stop()

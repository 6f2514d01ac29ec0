# SPDX-License-Identifier: MIT
"""A plain rclpy client of a node, for tests."""

from __future__ import annotations

import os
import time

from ros_process import READY_S

SECOND = 10**9


class NodeClient:
    """Calls services, publishes commands, collects states and diagnostics of the node ``/<name>``."""

    def __init__(self, environment: dict[str, str], name: str = "rigid_body") -> None:
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
        from nav_msgs.msg import Odometry
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions
        from std_msgs.msg import String

        range_before = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE")
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = environment["ROS_AUTOMATIC_DISCOVERY_RANGE"]
        try:
            self.context = rclpy.Context()
            rclpy.init(
                args=[],
                context=self.context,
                domain_id=int(environment["ROS_DOMAIN_ID"]),
                signal_handler_options=SignalHandlerOptions.NO,
            )
            self.node = rclpy.create_node("test_client", context=self.context)
        finally:
            if range_before is None:
                del os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"]
            else:
                os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = range_before
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.name = f"/{name}"
        self.states: list = []
        self.odometry: list = []
        self.diagnostics: list[dict] = []
        self.levels: list[bytes] = []
        self._services: dict = {}
        subscribe = self.node.create_subscription
        subscribe(PoseStamped, f"{self.name}/pose", lambda m: self.states.append(("pose", m)), 1000)
        subscribe(TwistStamped, f"{self.name}/twist", lambda m: self.states.append(("twist", m)), 1000)
        subscribe(Odometry, f"{self.name}/odom", self.odometry.append, 1000)
        subscribe(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        publisher = self.node.create_publisher
        self._publishers = {
            "wrench": publisher(WrenchStamped, f"{self.name}/wrench", 5000),
            "poke": publisher(WrenchStamped, f"{self.name}/poke", 5000),
            "schedule": publisher(String, f"{self.name}/schedule", 5000),
        }
        self.spin_until(
            lambda: self.diagnostics and all(p.get_subscription_count() for p in self._publishers.values()), "the node"
        )

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def _on_diagnostics(self, message) -> None:
        for status in message.status:
            if status.name == f"{self.name}: simulation":
                stamp = message.header.stamp
                values = {v.key: v.value for v in status.values}
                self.diagnostics.append({**values, "stamp_ns": stamp.sec * SECOND + stamp.nanosec})
                self.levels.append(status.level)

    def spin_until(self, condition, what: str) -> None:
        """Serve what arrives until ``condition()``."""
        deadline = time.monotonic() + READY_S
        while not condition():
            assert time.monotonic() < deadline, f"no {what}"
            self.executor.spin_once(timeout_sec=0.05)

    def call(self, service: str, service_type, request):
        """The response of a service of the node."""
        if service not in self._services:
            self._services[service] = self.node.create_client(service_type, f"{self.name}/{service}")
            self.spin_until(self._services[service].service_is_ready, service)
        future = self._services[service].call_async(request)
        self.spin_until(future.done, f"answer of {service}")
        return future.result()

    def trigger(self, service: str):
        from std_srvs.srv import Trigger

        return self.call(service, Trigger, Trigger.Request())

    def pause(self, data: bool):
        from std_srvs.srv import SetBool

        return self.call("pause", SetBool, SetBool.Request(data=data))

    def set(self, atomically: bool = False, **values):
        """Set parameters (``__`` stands for the dot) to ParameterValue; returns the results."""
        from rcl_interfaces.msg import Parameter
        from rcl_interfaces.srv import SetParameters, SetParametersAtomically

        given = [Parameter(name=n.replace("__", "."), value=parameter_value(v)) for n, v in values.items()]
        if atomically:
            request = SetParametersAtomically.Request(parameters=given)
            return [self.call("set_parameters_atomically", SetParametersAtomically, request).result]
        return self.call("set_parameters", SetParameters, SetParameters.Request(parameters=given)).results

    def get(self, *names: str) -> list:
        from rcl_interfaces.srv import GetParameters
        from rclpy.parameter import parameter_value_to_python

        answer = self.call("get_parameters", GetParameters, GetParameters.Request(names=list(names)))
        return [_plain(parameter_value_to_python(value)) for value in answer.values]

    def wrench(self, topic: str, stamp_ns: int = 0, frame: str = "", force=(0, 0, 0), torque=(0, 0, 0)) -> None:
        from geometry_msgs.msg import WrenchStamped

        message = WrenchStamped()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, SECOND)
        message.header.frame_id = frame
        for vector, given in ((message.wrench.force, force), (message.wrench.torque, torque)):
            vector.x, vector.y, vector.z = map(float, given)
        self._publishers[topic].publish(message)

    def schedule(self, text: str) -> None:
        from std_msgs.msg import String

        self._publishers["schedule"].publish(String(data=text))

    def fresh_diagnostics(self, reached=lambda values: True) -> dict:
        """The first report of what is so from now on for which ``reached`` holds."""
        self.diagnostics.clear()
        asked_ns = time.time_ns()

        def last() -> dict:
            return self.diagnostics[-1]

        self.spin_until(lambda: self.diagnostics and last()["stamp_ns"] > asked_ns and reached(last()), "diagnostics")
        return last()

    def received(self, count: int) -> dict:
        """Diagnostics once ``commands_received`` is at least ``count``."""
        return self.fresh_diagnostics(lambda values: int(values["commands_received"]) >= count)

    def rows(self) -> dict[str, dict[int, list[float]]]:
        """What was received on pose and twist by stamp [ns] since the last reset; the buffer is emptied."""
        found: dict[str, dict[int, list[float]]] = {"pose": {}, "twist": {}}
        for topic, m in self.states:
            ns = m.header.stamp.sec * SECOND + m.header.stamp.nanosec
            if found[topic] and ns < max(found[topic]):
                found[topic].clear()
            if topic == "pose":
                p, q = m.pose.position, m.pose.orientation
                found[topic][ns] = [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
            else:
                v, w = m.twist.linear, m.twist.angular
                found[topic][ns] = [v.x, v.y, v.z, w.x, w.y, w.z]
        self.states.clear()
        return found

    def reset(self) -> None:
        """Time 0, and none of the states that were published before; some must have been."""
        self.states.clear()
        self.spin_until(lambda: len(self._latest()) == 2, "states")
        before = self._latest()
        assert self.trigger("reset").success
        self.spin_until(lambda: all(now < before[topic] for topic, now in self._latest().items()), "states of time 0")
        self.rows()

    def _latest(self) -> dict[str, int]:
        """Stamps of the newest pose and twist [ns]."""
        return {t: m.header.stamp.sec * SECOND + m.header.stamp.nanosec for t, m in self.states[-4:]}

    def fly_until(self, time_ns: int) -> dict[str, dict[int, list[float]]]:
        """Collect states until both topics have reached ``time_ns``."""

        def reached() -> bool:
            latest = self._latest()
            return len(latest) == 2 and min(latest.values()) >= time_ns

        self.spin_until(reached, f"states at {time_ns} ns")
        return self.rows()


def parameter_value(value):
    """A ParameterValue; text goes as ``ros2 param set`` would type a list of mixed numbers: as text."""
    from rclpy.parameter import Parameter

    return Parameter("p", value=value).get_parameter_value()


def _plain(value):
    return list(value) if hasattr(value, "tolist") or isinstance(value, (list, tuple)) else value


def published(row) -> tuple[list[float], list[float]]:
    """What pose and twist carry for a state row (13,)."""
    from rigid_proto_ros.core.rotation import rotate

    row = row.tolist()
    return row[:7], [*row[7:10], *rotate(*row[3:7], *row[10:13])]

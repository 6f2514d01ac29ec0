# SPDX-License-Identifier: MIT
"""Clients and baselines of the node's benchmark, each a process of its own: python node_clients.py NAME [ARGUMENT ...]."""

from __future__ import annotations

import json
import signal
import sys
import threading
import time

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, PoseStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger

from rigid_proto_ros.scene import cdr

SPIN = (0.05, 0.1, 12.0)


def subscribe(topic: str, seconds: str = "0") -> None:
    """Count messages of a topic of states without reading them: says ``hearing`` at the first, and at the end, or ``seconds``
    later, the intervals of their times of publication.
    """
    node = Node("listener_" + topic)
    times: list[int] = []
    message_type = {"pose": PoseStamped, "twist": TwistStamped, "odom": Odometry, "imu": Imu}[topic]
    subscription = node.create_subscription(message_type, f"/rigid_body/{topic}", lambda m: None, 100, raw=True)
    end = float("inf")
    while time.monotonic() < end and not STOP.is_set():
        with subscription.handle:
            while (taken := subscription.handle.take_message(message_type, True)) is not None:
                times.append(taken[1]["source_timestamp"])
        if times and end == float("inf"):
            print("hearing", flush=True)
            end = time.monotonic() + float(seconds) if float(seconds) else sys.float_info.max
        time.sleep(0.02)
    intervals = np.diff(times[len(times) // 10 :]) * 1e-6
    if len(intervals):
        shown = {f"p{q}": float(np.percentile(intervals, q)) for q in (1, 50, 99, 99.9)}
        print(json.dumps({"messages": len(times), "rate": 1e3 / float(intervals.mean()), **shown}))


def latency(count: str) -> None:
    """Wrenches at random moments; for each the time from its publication to that of the first twist that shows it."""
    node = Node("latency")
    publisher = node.create_publisher(WrenchStamped, "/rigid_body/wrench", QoSProfile(depth=10))
    twists: list[tuple[int, float]] = []
    subscription = node.create_subscription(TwistStamped, "/rigid_body/twist", lambda m: None, 1000, raw=True)
    random = np.random.default_rng(1)
    while publisher.get_subscription_count() == 0:
        time.sleep(0.05)
    time.sleep(0.5)
    delays = []
    sign = 1.0
    for _ in range(int(count)):
        time.sleep(0.02 + 0.02 * random.random())
        sent = time.time_ns()
        publisher.publish(cdr.wrench_stamped(0, "world@com", (sign * 1.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
        sign = -sign
        time.sleep(0.03)
        with subscription.handle:
            while (taken := subscription.handle.take_message(TwistStamped, True)) is not None:
                velocity = np.frombuffer(taken[0], "<f8", count=1, offset=len(taken[0]) - 48)[0]
                twists.append((taken[1]["source_timestamp"], float(velocity)))
        times = np.array([t for t, _ in twists])
        slopes = np.diff([v for _, v in twists])
        before = np.nonzero(times[1:] <= sent)[0]
        if not len(before):
            continue
        # Under a held force the velocity changes evenly; where it doesn't, the new force has acted for a while.
        even = slopes[before[-1]]
        after = np.nonzero((times[1:] > sent) & (np.abs(slopes - even) > 0.02 * abs(even)))[0]
        if len(after):
            delays.append((times[1:][after[0]] - sent) * 1e-6)
        twists = twists[-3:]
    print(json.dumps({"count": len(delays), **{f"p{q}": float(np.percentile(delays, q)) for q in (50, 99)}}))


def flood(rate: str, seconds: str) -> None:
    """Held wrenches at a rate; prints how many were sent."""
    node = Node("flood")
    publisher = node.create_publisher(WrenchStamped, "/rigid_body/wrench", QoSProfile(depth=1000))
    while publisher.get_subscription_count() == 0:
        time.sleep(0.05)
    message = cdr.wrench_stamped(0, "world@com", (1e-9, 0.0, 0.0), (0.0, 0.0, 0.0))
    start, sent = time.monotonic(), 0
    while (elapsed := time.monotonic() - start) < float(seconds) and not STOP.is_set():
        while sent < elapsed * float(rate):
            publisher.publish(message)
            sent += 1
        time.sleep(0.0005)
    print(json.dumps({"sent": sent}), flush=True)
    STOP.wait()


def soak(seed: str) -> None:
    """Random commands, good and bad, and parameter changes until the end; then prints what was sent."""
    node = Node("soak")
    random = np.random.default_rng(int(seed))
    reliable = QoSProfile(depth=100)
    topics = {
        "wrench": node.create_publisher(WrenchStamped, "/rigid_body/wrench", reliable),
        "poke": node.create_publisher(WrenchStamped, "/rigid_body/poke", reliable),
        "target": node.create_publisher(PointStamped, "/rigid_body/string/target", reliable),
    }
    setter = node.create_client(SetParameters, "/rigid_body/set_parameters")
    services = {name: node.create_client(Trigger, f"/rigid_body/{name}") for name in ("reset", "clear_wrench")}
    while not all(p.get_subscription_count() for p in topics.values()) and not STOP.is_set():
        time.sleep(0.05)
    sent = {"messages": 0, "bad": 0, "changes": 0}
    good = ["world", "body", "world@vertex/3", "body@point/0.0,0.01,0.02", "normal@vertex/7", "world@com;impulse"]
    bad = ["nowhere", "world@vertex/99999999", "body@point/1,2", "world@com;duration=-1", "x" * 2000]
    next_change = 0.0
    while not STOP.is_set():
        force = (1e-3 * random.standard_normal(3)).tolist()
        kind = random.random()
        if kind < 0.6:
            frame = good[random.integers(len(good))]
            topic = "poke" if ";" in frame or random.random() < 0.5 else "wrench"
            topics[topic].publish(cdr.wrench_stamped(0, frame, force, (0.0, 0.0, 0.0)))
        elif kind < 0.8:
            frame = bad[random.integers(len(bad))]
            topics["poke"].publish(cdr.wrench_stamped(0, frame, force, (0.0, 0.0, 0.0)))
            sent["bad"] += 1
        elif kind < 0.85:
            topics["poke"].publish(cdr.wrench_stamped(0, "world", (float("nan"), 0.0, 0.0), force))
            sent["bad"] += 1
        else:
            target = (0.05 * random.standard_normal(3)).tolist()
            topics["target"].publish(cdr.stamped_doubles(0, "world", target))
        sent["messages"] += 1
        if time.monotonic() > next_change:
            next_change = time.monotonic() + 2.0
            sent["changes"] += 1
            name, value = [
                ("density", float(random.uniform(500, 9000))),
                ("scale", float(random.uniform(0.5, 2.0))),
                ("inertia_model", ["solid", "bounding_box", "points", "shell"][random.integers(4)]),
                ("gravity", [0.0, 0.0, float(random.uniform(-0.1, 0.1))]),
                ("mesh", ["t_handle", "hammer", "teapot", "book"][random.integers(4)]),
                ("mass", -1.0),
            ][random.integers(6)]
            setter.call_async(SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()]))
            if sent["changes"] % 20 == 0:
                services["reset" if sent["changes"] % 40 == 0 else "clear_wrench"].call_async(Trigger.Request())
        rclpy.spin_once(node, timeout_sec=0.0)
        time.sleep(0.02)
    print(json.dumps(sent), flush=True)


def diagnostics() -> None:
    """The newest counters of the node."""
    node = Node("reader")
    found: list[dict] = []
    node.create_subscription(
        DiagnosticArray, "/diagnostics", lambda m: found.append({v.key: v.value for v in m.status[0].values}), 10
    )
    while not found and not STOP.is_set():
        rclpy.spin_once(node, timeout_sec=0.2)
    print(json.dumps(found[-1]), flush=True)


def plain_node(engine: str, rate: str) -> None:
    """A fair baseline: the same job as the usual rclpy node does it, a timer, message objects, a subscription callback.

    engine ``ours`` steps our core; ``mujoco`` steps MuJoCo's RK4 with the same body through its Python bindings.
    """
    node = Node("rigid_body")
    pose_publisher = node.create_publisher(PoseStamped, "~/pose", 10)
    twist_publisher = node.create_publisher(TwistStamped, "~/twist", 10)
    step = {"ours": _our_step, "mujoco": _mujoco_step}[engine](1.0 / float(rate))
    force = np.zeros(3)

    def on_wrench(message: WrenchStamped) -> None:
        force[:] = message.wrench.force.x, message.wrench.force.y, message.wrench.force.z

    def on_timer() -> None:
        x, q, v, w = step(force)
        pose, twist = PoseStamped(), TwistStamped()
        pose.header.stamp = twist.header.stamp = node.get_clock().now().to_msg()
        pose.header.frame_id = twist.header.frame_id = "world"
        p, o = pose.pose.position, pose.pose.orientation
        p.x, p.y, p.z = x
        o.x, o.y, o.z, o.w = q
        linear, angular = twist.twist.linear, twist.twist.angular
        linear.x, linear.y, linear.z = v
        angular.x, angular.y, angular.z = w
        pose_publisher.publish(pose)
        twist_publisher.publish(twist)

    node.create_subscription(WrenchStamped, "~/wrench", on_wrench, 100)
    node.create_timer(1.0 / float(rate), on_timer)
    while not STOP.is_set():
        rclpy.spin_once(node, timeout_sec=0.1)


def _our_step(period: float):
    from rigid_proto_ros.scene.scenario import make_scenario
    from rigid_proto_ros.simulation.simulation import Simulation

    simulation = Simulation(make_scenario({"initial.angular_velocity": list(SPIN)}).setup)

    def step(force):
        state = simulation.advance(simulation.time_ns + round(period * 1e9))
        rows = state.position, state.orientation_xyzw, state.linear_velocity, state.angular_velocity
        return tuple(row.tolist() for row in rows)

    return step


def _mujoco_step(period: float):
    import mujoco

    from rigid_proto_ros.scene.scenario import make_scenario

    body = make_scenario({}).setup.body
    moments = " ".join(repr(float(m)) for m in body.principal_moments)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{period!r}" gravity="0 0 0" integrator="RK4"/><worldbody><body><freejoint/>'
        f'<inertial pos="0 0 0" mass="{body.mass!r}" diaginertia="{moments}"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    data.qvel[3:] = SPIN

    def step(force):
        data.xfrc_applied[1, :3] = force
        mujoco.mj_step(model, data)
        x, (w, i, j, k), v = data.qpos[:3].tolist(), data.qpos[3:].tolist(), data.qvel.tolist()
        return x, (i, j, k, w), v[:3], v[3:]

    return step


STOP = threading.Event()

if __name__ == "__main__":
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: STOP.set())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    {
        "subscribe": subscribe,
        "latency": latency,
        "flood": flood,
        "plain": plain_node,
        "diagnostics": diagnostics,
        "soak": soak,
    }[sys.argv[1]](*sys.argv[2:])
    rclpy.try_shutdown()

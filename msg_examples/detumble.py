#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Four thrusters stop the T-handle's tumbling and turn it upright: a PD law on the rotation group.

rigid_body_node --ros-args --params-file config/t_handle.yaml &
python msg_examples/detumble.py               # free-running: answers each state as it comes, a period late or more
python msg_examples/detumble.py --lockstep    # paused and stepped: acts at the very state that it answers
"""

import argparse

import numpy as np
import rclpy
from nav_msgs.msg import Odometry
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger

# thrusters.a to d of config/t_handle.yaml: their torques are along the corners of a tetrahedron, so that one-sided
# thrusters reach every direction.
POINTS = np.array([[0, -1, 1], [0, 1, -1], [0, 1, 1], [0, -1, -1]]).T * 0.05  # m from the COM, body axes
FORCES = np.array([[2, -1, -1], [2, 1, 1], [2, 1, -1], [2, -1, 1]]).T / 6**0.5  # directions, body axes
TORQUES = np.cross(POINTS, FORCES, axis=0)  # N m per newton of thrust
MAX_THRUST = 0.1  # N
STIFFNESS, DAMPING = 1.5e-3, 1e-3  # N m, N m s: about 3 rad/s and well damped for moments of 1e-4 kg m²


def thrusts(odometry: Odometry) -> np.ndarray:
    """What the four thrusters give (4,) [N], none negative, towards rest at identity attitude."""
    q, w = odometry.pose.pose.orientation, odometry.twist.twist.angular  # the twist is in body axes
    error = 2.0 * np.copysign(1.0, q.w) * np.array([q.x, q.y, q.z])  # axis · 2 sin(angle / 2), the short way round
    torque = -STIFFNESS * error - DAMPING * np.array([w.x, w.y, w.z])
    wanted = TORQUES.T @ torque / (TORQUES[0] ** 2).sum()  # the rows are orthogonal and of one length
    wanted -= wanted.min()
    return wanted * min(1.0, MAX_THRUST / max(wanted.max(), 1e-300))


class Controller(Node):
    """Answers states of a rigid_body node with what the thrusters are to push with."""

    def __init__(self, target: str) -> None:
        super().__init__("detumble", start_parameter_services=False)
        # One that stays: rclpy's own functions would give the node to an executor and take it away at every call.
        self.calls = SingleThreadedExecutor()
        self.calls.add_node(self)
        self.state: Odometry | None = None
        self.create_subscription(Odometry, f"{target}/odom", self.on_state, 10)
        self.thrusters = self.create_publisher(Float64MultiArray, f"{target}/thrusters", 10)
        self.reset, self.step = (self.create_client(Trigger, f"{target}/{name}") for name in ("reset", "step"))
        self.pause = self.create_client(SetBool, f"{target}/pause")
        while not self.thrusters.get_subscription_count():
            self.calls.spin_once(timeout_sec=0.1)

    def on_state(self, state: Odometry) -> None:
        """Keep the newest state."""
        self.state = state

    @property
    def seconds(self) -> float:
        """Simulated time of the newest state; before the first one -1."""
        stamp = self.state.header.stamp if self.state else None
        return stamp.sec + 1e-9 * stamp.nanosec if stamp else -1.0

    def call(self, client: Client, request: object) -> None:
        """Call a service and wait for its answer."""
        client.wait_for_service()
        future = client.call_async(request)
        while not future.done():
            self.calls.spin_once()
        if not future.result().success:
            raise SystemExit(f"{client.srv_name}: {future.result().message}")

    def answer(self) -> None:
        """Publish the forces that answer the newest state."""
        self.thrusters.publish(Float64MultiArray(data=thrusts(self.state).tolist()))

    def run(self, until_s: float, lockstep: bool) -> None:
        """From a reset on, until this simulated time."""
        self.call(self.pause, SetBool.Request(data=True))
        self.call(self.reset, Trigger.Request())
        while self.seconds != 0.0:
            self.calls.spin_once()
        if not lockstep:
            self.call(self.pause, SetBool.Request(data=False))
        while (answered_s := self.seconds) < until_s:
            self.answer()
            if lockstep:
                self.call(self.step, Trigger.Request())
            while self.seconds <= answered_s:  # while paused the present state comes again ten times a second
                self.calls.spin_once()


def main() -> None:
    """Detumble, and say how well."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--node", default="/rigid_body")
    parser.add_argument("--lockstep", action="store_true", help="pause the simulation and step it")
    parser.add_argument("--seconds", type=float, default=6.0, help="of simulated time (default 6)")
    args = parser.parse_args()
    rclpy.init()
    controller = Controller(args.node)
    controller.run(args.seconds, args.lockstep)
    w = controller.state.twist.twist.angular
    print(f"after {controller.seconds:.2f} s it turns at {np.linalg.norm([w.x, w.y, w.z]):.2g} rad/s")
    controller.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()

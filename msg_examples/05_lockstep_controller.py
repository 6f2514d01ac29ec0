#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""A controller in lockstep with the node: four thrusters stop the T-handle's tumbling and turn it upright.

The node waits for each command, so every run is the same, bit for bit; it stays paused. Start the node first: make up
"""

import numpy as np
import rclpy
from nav_msgs.msg import Odometry
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger

POINTS = np.array([[0, -1, 1], [0, 1, -1], [0, 1, 1], [0, -1, -1]]) * 0.05  # m; a to d of config/t_handle.yaml
TORQUES = np.cross(POINTS, np.array([[2, -1, -1], [2, 1, 1], [2, 1, -1], [2, -1, 1]]) / 6**0.5).T

rclpy.init()
node = rclpy.create_node("controller")
executor = rclpy.executors.SingleThreadedExecutor()
executor.add_node(node)
states = []
node.create_subscription(Odometry, "/rigid_body/odom", states.append, 10)
thrusters = node.create_publisher(Float64MultiArray, "/rigid_body/thrusters", 10)
pause = node.create_client(SetBool, "/rigid_body/pause")
reset, step = (node.create_client(Trigger, f"/rigid_body/{name}") for name in ("reset", "step"))
pause.wait_for_service()
executor.spin_until_future_complete(pause.call_async(SetBool.Request(data=True)))
executor.spin_until_future_complete(reset.call_async(Trigger.Request()))
while not (thrusters.get_subscription_count() and states and states[-1].header.stamp == rclpy.time.Time().to_msg()):
    executor.spin_once()
for k in range(200):  # steps of 10 ms
    q, w = states[-1].pose.pose.orientation, states[-1].twist.twist.angular
    turn, rate = 2.0 * np.copysign(1.0, q.w) * np.array([q.x, q.y, q.z]), np.array([w.x, w.y, w.z])
    torque = -1.5e-3 * turn - 1e-3 * rate  # N m
    force = TORQUES.T @ torque / (TORQUES[0] ** 2).sum()  # the rows are orthogonal and of equal length
    thrusters.publish(Float64MultiArray(data=(force - force.min()).tolist()))
    executor.spin_until_future_complete(step.call_async(Trigger.Request()))
    while rclpy.time.Time.from_msg(states[-1].header.stamp).nanoseconds <= k * 10_000_000:
        executor.spin_once()
print(f"after 2 s: {np.linalg.norm(rate):.2g} rad/s")

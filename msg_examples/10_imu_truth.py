#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Ground truth for an attitude filter: ~/imu has angular rate and specific force with errors, and the true attitude.

A book swings on a string. Start the node first, with a biased gyroscope:
rigid_body_node --ros-args --params-file config/plumb_line.yaml -p noise.imu:="[0.001, 0.0, 0.02, 0.0]"
"""

import numpy as np
import rclpy
from sensor_msgs.msg import Imu

PROPORTIONAL, INTEGRAL = 0.5, 0.05  # gains of Mahony's filter (IEEE Trans. Automatic Control 53, 1203, 2008)
alone, filtered, last_s, first_s, bias = None, None, None, None, np.zeros(3)


def on_imu(imu: Imu) -> None:
    """Track the vertical in body axes: with the gyroscope alone, and corrected by the accelerometer."""
    global alone, filtered, last_s, first_s, bias, error
    time_s = imu.header.stamp.sec + 1e-9 * imu.header.stamp.nanosec
    q, rate, force = imu.orientation, imu.angular_velocity, imu.linear_acceleration
    rate, force = (np.array([v.x, v.y, v.z]) for v in (rate, force))
    truth = np.array([2 * (q.x * q.z - q.w * q.y), 2 * (q.y * q.z + q.w * q.x), 1 - 2 * (q.x**2 + q.y**2)])
    if first_s is None:
        alone, filtered, last_s, first_s = truth, truth, time_s, time_s
    step_s, last_s = time_s - last_s, time_s
    correction = np.cross(force / np.linalg.norm(force), filtered)
    bias = bias - INTEGRAL * step_s * correction
    alone = alone + step_s * np.cross(alone, rate)
    filtered = filtered + step_s * np.cross(filtered, rate - bias + PROPORTIONAL * correction)
    alone, filtered = alone / np.linalg.norm(alone), filtered / np.linalg.norm(filtered)
    error = [float(np.linalg.norm(np.cross(up, truth))) for up in (alone, filtered)]


rclpy.init()
node = rclpy.create_node("attitude_filter")
node.create_subscription(Imu, "/rigid_body/imu", on_imu, 1000)
while first_s is None or last_s < first_s + 30.0:
    rclpy.spin_once(node)
print(f"error of the vertical after 30 s: gyroscope alone {error[0]:.2g} rad, filter {error[1]:.2g} rad")

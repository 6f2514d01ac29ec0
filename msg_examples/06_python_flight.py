#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Simulations from Python, without ROS, on all cores: which gains stop the T-handle's tumbling fastest?"""

from itertools import product

import numpy as np

from rigid_proto_ros.sweep.flights import Flight, fly_all, load_scene

POINTS = np.array([[0, -1, 1], [0, 1, -1], [0, 1, 1], [0, -1, -1]]) * 0.05  # m; a to d of config/t_handle.yaml
TORQUES = np.cross(POINTS, np.array([[2, -1, -1], [2, 1, 1], [2, 1, -1], [2, -1, 1]]) / 6**0.5).T  # N m per N
SCENE = load_scene("t_handle", {"wrench_timeout": 0.0})
SPINS = np.random.default_rng(1).normal(0.0, 4.0, (8, 3))  # rad/s


def cost(gains: tuple[float, float]) -> float:
    """Mean of |attitude error|² + (|ω|/3)² over 2 s at 50 Hz and over the initial spins."""
    total = 0.0
    for spin in SPINS:
        flight = Flight(SCENE)
        flight.command({"state": {"angular_velocity": spin}})
        for _ in range(100):
            state = flight.sample()
            error = 2.0 * np.copysign(1.0, state.orientation_xyzw[3]) * state.orientation_xyzw[:3]
            rate = state.angular_velocity_body
            total += error @ error + rate @ rate / 9.0
            force = TORQUES.T @ (-gains[0] * error - gains[1] * rate) / (TORQUES[0] ** 2).sum()
            flight.command({"thrusters": force - force.min()})
            flight.step(0.02)
    return total / (100 * len(SPINS))


if __name__ == "__main__":
    trials = list(product(np.geomspace(1e-4, 1e-2, 5), repeat=2))  # N m, N m s
    costs = list(fly_all(cost, trials))
    stiffness, damping = trials[int(np.argmin(costs))]
    print(f"best of {len(trials)}: {stiffness:.2g} N m, {damping:.2g} N m s, cost {min(costs):.3g}")

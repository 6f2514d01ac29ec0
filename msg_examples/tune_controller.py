#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Tune a controller over 10,000 flights, without ROS: which PD gains stop the T-handle's tumbling soonest?

python msg_examples/tune_controller.py                 # 625 pairs of gains, 16 starts each, on all cores
python msg_examples/tune_controller.py --side 5 --starts 4

Each flight begins with a random spin and is closed over four thrusters with a limit at 50 Hz.
"""

import argparse
import time
from typing import NamedTuple

import numpy as np

from rigid_proto_ros.sweep.flights import Flight, Scene, fly_all, load_scene

PERIOD_S, FLIGHT_S = 0.02, 2.0
POINTS = np.array([[0, -1, 1], [0, 1, -1], [0, 1, 1], [0, -1, -1]]) * 0.05  # m from the COM, body axes
FORCES = np.array([[2, -1, -1], [2, 1, 1], [2, 1, -1], [2, -1, 1]]) / 6**0.5
TORQUES = np.cross(POINTS, FORCES).T  # N m per newton of each thruster
THRUSTERS = {
    f"thrusters.{name}": [*(point + [0.0, 0.0, 0.0123]), *force, 0.1]  # 0.1 N at most
    for name, point, force in zip("abcd", POINTS, FORCES, strict=True)
}


class Trial(NamedTuple):
    """One flight: the gains [N m, N m s] and the spin that it begins with [rad/s]."""

    stiffness: float
    damping: float
    spin: tuple[float, float, float]


def scene() -> Scene:
    """The T-handle with thrusters."""
    return load_scene("t_handle", {**THRUSTERS, "wrench_timeout": 0.0})


def cost(trial: Trial) -> float:
    """Mean of |attitude error|² + (|ω|/3)² over the flight."""
    flight, total = Flight(SCENE), 0.0
    flight.command({"state": {"angular_velocity": list(trial.spin)}})
    for _ in range(round(FLIGHT_S / PERIOD_S)):
        state = flight.sample()
        *vector, w = state.orientation_xyzw.tolist()
        error, rate = 2.0 * np.copysign(1.0, w) * np.array(vector), state.angular_velocity_body
        total += float(error @ error + rate @ rate / 9.0)
        wanted = TORQUES.T @ (-trial.stiffness * error - trial.damping * rate) / (TORQUES[0] ** 2).sum()
        flight.command({"thrusters": (wanted - wanted.min()).tolist()})
        flight.step(PERIOD_S)
    return total * PERIOD_S / FLIGHT_S


SCENE = scene()


def main() -> None:
    """Fly them all, and say which gains are best."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=25, help="gains of each kind (default 25)")
    parser.add_argument("--starts", type=int, default=16, help="random spins (default 16)")
    args = parser.parse_args()
    stiffnesses, dampings = np.geomspace(1e-4, 1e-2, args.side), np.geomspace(1e-4, 1e-2, args.side)
    spins = [tuple(spin) for spin in np.random.default_rng(1).normal(0.0, 4.0, (args.starts, 3)).tolist()]
    trials = [Trial(float(k), float(d), spin) for k in stiffnesses for d in dampings for spin in spins]
    began = time.perf_counter()
    costs = np.array(list(fly_all(cost, trials))).reshape(args.side, args.side, args.starts).mean(axis=2)
    best = np.unravel_index(costs.argmin(), costs.shape)
    print(f"{len(trials)} flights of {FLIGHT_S:g} s in {time.perf_counter() - began:.1f} s")
    print(
        f"best: stiffness {stiffnesses[best[0]]:.2g} N m, damping {dampings[best[1]]:.2g} N m s, cost {costs.min():.3g}"
    )


if __name__ == "__main__":
    main()

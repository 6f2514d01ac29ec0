# SPDX-License-Identifier: MIT
"""Random flights with pokes, held wrenches, strings and damping, the same for every run of a seed."""

from __future__ import annotations

import numpy as np
from flights import SECOND, flight_setup, wrench

from rigid_proto_ros.motion.body import Body, make_body
from rigid_proto_ros.motion.string import StringSettings
from rigid_proto_ros.simulation.simulation import Simulation

DURATION_S = 2.0


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(10.0 ** rng.uniform(np.log10(low), np.log10(high)))


def random_turn(rng: np.random.Generator) -> np.ndarray:
    """A random rotation matrix (3, 3)."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def turned_body(rng: np.random.Generator, mass: float, reach: float, thinnest: float) -> Body:
    """Anything from stick (1 to ``thinnest``) to ball, turned in its mesh."""
    second = mass * reach**2 * np.array([1.0, log_uniform(rng, thinnest, 1.0), log_uniform(rng, thinnest, 1.0)])
    turn = random_turn(rng)
    inertia = turn @ np.diag(second.sum() - second) @ turn.T
    return make_body(mass, np.zeros(3), 0.5 * (inertia + inertia.T))


def random_body(rng: np.random.Generator) -> Body:
    """0.1 to 10 kg, a few cm to a metre."""
    return turned_body(rng, log_uniform(rng, 0.1, 10.0), log_uniform(rng, 0.03, 1.0), 0.01)


def random_scene(seed: int, integrator: str, accuracy: float = 1e-9, step_s: float = 1e-3) -> Simulation:
    """A Simulation at time 0 with all its commands submitted."""
    rng = np.random.default_rng(seed)
    body = random_body(rng)
    arm = np.sqrt(body.principal_moments.max() / body.mass)
    row = np.zeros(13)
    row[0:3], row[3:7] = rng.normal(size=3), rng.normal(size=4)
    row[3:7] /= np.linalg.norm(row[3:7])
    row[7:10], row[10:13] = rng.normal(size=3), log_uniform(rng, 0.1, 20.0) * rng.normal(size=3) / 1.7
    gravity = np.array([0.0, 0.0, -9.81]) if rng.random() < 0.6 else np.zeros(3)
    linear = body.mass * log_uniform(rng, 0.01, 3.0) if rng.random() < 0.3 else 0.0
    angular = body.principal_moments.min() * log_uniform(rng, 0.01, 3.0) if rng.random() < 0.3 else 0.0
    setup = flight_setup(
        body,
        integrator=integrator,
        step_s=step_s,
        accuracy=accuracy,
        initial=row,
        gravity=gravity,
        linear_damping=linear,
        angular_damping=angular,
        string=_random_string(rng, arm) if rng.random() < 0.5 else StringSettings(),
    )
    simulation = Simulation(setup)
    for _k in range(rng.integers(0, 6)):
        point = ",".join(repr(float(c)) for c in arm * rng.normal(size=3))
        axes = rng.choice(["world", "body"])
        force = body.mass * log_uniform(rng, 0.3, 30.0) * rng.normal(size=3)
        torque = body.principal_moments.min() * log_uniform(rng, 0.3, 30.0) * rng.normal(size=3) * (rng.random() < 0.3)
        kind = rng.choice(["poke", "held", "impulse"], p=[0.6, 0.25, 0.15])
        frame = f"{axes}@point/{point}"
        if kind == "poke":
            frame += f";duration={rng.uniform(0.01, 0.3):.9f}"
        elif kind == "impulse":
            frame += ";impulse"
            force, torque = 0.05 * force, 0.05 * torque
        command = wrench(frame, force.tolist(), torque.tolist(), held=kind == "held")
        simulation.submit(command, int(rng.integers(0, round(DURATION_S * SECOND))))
    return simulation


def _random_string(rng: np.random.Generator, arm: float) -> StringSettings:
    return StringSettings(
        attached=True,
        attach=tuple((arm * rng.normal(size=3)).tolist()),
        target=tuple((2.0 * rng.normal(size=3)).tolist()),
        frequency=log_uniform(rng, 2.0, 300.0),
        damping_ratio=float(rng.choice([0.0, 0.1, 0.5])),
        rest_length=float(rng.choice([0.0, 0.5, 1.0])),
        bilateral=bool(rng.random() < 0.3),
    )
